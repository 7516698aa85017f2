"""Views of a scene by the names of camera and light."""

import re
from collections.abc import Sequence
from pathlib import Path
from typing import TypeVar

from shadowbench.errors import InputError, alternatives
from shadowbench.scenes.assumed import as_asked
from shadowbench.scenes.library import load_scene
from shadowbench.scenes.model import Camera, Light, Scene, View, view_of

LARGEST = 16384
"""Largest view size, in pixels along a side."""

Named = TypeVar("Named", Camera, Light)


def chosen_view(
    scene: str | Path | Scene,
    size: int,
    camera: str | None = None,
    light: str | None = None,
    assets: Path | None = None,
    up: str | None = None,
    sun: bool = False,
    no_ground: bool = False,
) -> View:
    """The view of size × size pixels of a scene, by default of its first camera and light.

    scene: a name, a file or a loaded scene; assets, up: as for `load_scene`; sun, no_ground: as for `as_asked`. Raises
    InputError for an unknown scene, camera or light, or an invalid size.
    """
    if not 1 <= size <= LARGEST:
        raise InputError(f"view size {size}: allowed are 1 to {LARGEST}")
    loaded = scene if isinstance(scene, Scene) else load_scene(scene, assets, up)
    loaded = as_asked(loaded, sun, no_ground)
    chosen = named(loaded.cameras, camera, "view") if camera else loaded.cameras[0]
    lamp = named(loaded.lights, light, "light") if light else loaded.lights[0]
    return view_of(loaded, chosen, lamp, size)


def notes_on(view: View, camera: str | None, light: str | None) -> list[str]:
    """Notes on a chosen view: the scene's own, and the names of the cameras and lights not used."""
    scene = view.scene
    return [
        *scene.notes,
        *([] if camera else first_of(scene.name, "cameras", scene.cameras, "--view")),
        *([] if light else first_of(scene.name, "lights", scene.lights, "--light")),
    ]


def first_of(scene: str, what: str, things: Sequence[Camera] | Sequence[Light], option: str) -> list[str]:
    """The note that the first of several cameras or lights is used; empty if there is only one."""
    names = ", ".join(thing.name for thing in things)
    line = f"{scene}: {len(things)} {what}: {names}; the first is used, {option} names another"
    return [line] if len(things) > 1 else []


def named(things: Sequence[Named], name: str, where: str) -> Named:
    """The camera or light with this name. Raises InputError that begins with `where` and lists the names."""
    for thing in things:
        if thing.name == name:
            return thing
    size = re.fullmatch(r"(\d+)(x\d+)?", name)
    hint = f"; a view is square, and --view-size {size[1]} is its size" if size else ""
    raise InputError(f"{where}: found {name!r:.60}{alternatives(name, [thing.name for thing in things])}{hint}")
