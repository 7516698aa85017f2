"""Views of a scene by the names of camera and light."""

import re
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TypeVar

from shadowbench.errors import InputError, alternatives
from shadowbench.options import FIRST, VIEW_SIZE, SceneOptions, ViewOptions
from shadowbench.scenes.assumed import with_sun, without_ground
from shadowbench.scenes.contents import Chosen
from shadowbench.scenes.library import load_scene
from shadowbench.scenes.model import Camera, Light, Scene, View, view_of

Named = TypeVar("Named", Camera, Light)


def chosen_view(
    scene: str | Path | Scene, size: int, options: ViewOptions = FIRST, note: Callable[[str], None] = lambda line: None
) -> View:
    """The view of size × size pixels of a scene that options name.

    scene: a name, a file or a loaded scene; note: receives the scene's notes, and the names of the cameras and lights
    that are not used. Raises InputError for an unknown scene, camera or light, or an invalid size.
    """
    least, most = VIEW_SIZE
    if not least <= size <= most:
        raise InputError(f"view size {size}: allowed are {least} to {most}")
    loaded = opened(scene, options)
    camera = named(loaded.cameras, options.view, "view") if options.view else loaded.cameras[0]
    light = named(loaded.lights, options.light, "light") if options.light else loaded.lights[0]
    for line in _notes(loaded, options):
        note(line)
    return view_of(loaded, camera, light, size)


def opened(scene: str | Path | Scene, options: SceneOptions) -> Scene:
    """A scene by name or file, or a loaded one, with what options ask of its light and ground. Raises InputError."""
    loaded = (
        scene
        if isinstance(scene, Scene)
        else load_scene(scene, options.assets, options.up, Chosen(options.time, options.clip, options.variant))
    )
    loaded = without_ground(loaded) if options.no_ground else loaded
    return with_sun(loaded) if options.sun else loaded


def _notes(scene: Scene, options: ViewOptions) -> list[str]:
    return [
        *scene.notes,
        *([] if options.view else first_of(scene.name, "cameras", scene.cameras, "--view")),
        *([] if options.light else first_of(scene.name, "lights", scene.lights, "--light")),
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
