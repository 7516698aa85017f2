"""Views of a scene: its cameras and lights by name, or others that options place."""

import hashlib
import math
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from importlib.util import find_spec
from pathlib import Path
from typing import TypeVar

from shadowbench.errors import InputError, alternatives
from shadowbench.options import FIRST, VIEW_SIZE, SceneOptions, ViewOptions, azimuth_elevation, coordinates
from shadowbench.scenes.assumed import (
    FOV_Y,
    content_of,
    point_text,
    pose_of,
    sun_direction,
    whole_view,
    with_cameras,
    with_lights,
    with_sun,
    without_ground,
)
from shadowbench.scenes.contents import Chosen
from shadowbench.scenes.library import load_scene
from shadowbench.scenes.model import Camera, Light, Scene, View, view_of
from shadowbench.scenes.tables import LONGEST_NAME
from shadowbench.scenes.vectors import Vec3, vec3

_RISE = math.tan(math.radians(15.0))
SIDES: Mapping[str, Vec3] = {
    "front": (0.0, _RISE, 1.0),
    "back": (0.0, _RISE, -1.0),
    "left": (-1.0, _RISE, 0.0),
    "right": (1.0, _RISE, 0.0),
    "top": (0.0, 1.0, 0.0),
}
"""Directions from the middle of a scene to the cameras of `--camera`: front is +z, as in glTF, right is +x."""
INSIDE = "inside"
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
    """A scene by name or file, or a loaded one, with what options ask of camera, lights and ground. Raises InputError.

    A camera that stands inside gets a lamp in place of a sun that was assumed and does not come in.
    """
    if isinstance(scene, Scene):
        loaded = scene
    else:
        loaded = load_scene(scene, options.assets, options.up, Chosen(options.time, options.clip))
    loaded = without_ground(loaded) if options.no_ground else loaded
    if options.camera is not None:
        loaded = _seen_from(loaded, options.camera, options.target)
    elif loaded is not scene and "camera" in loaded.assumed and find_spec("embreex") and _is_interior(loaded):
        note = f"{loaded.name} seems to be an interior, which the assumed camera sees from outside: --camera inside"
        loaded = replace(loaded, notes=(note, *loaded.notes))
    if options.lamp is not None:
        loaded = with_lights(loaded, [_lamp(options.lamp)])
    elif options.sun_at is not None:
        loaded = with_lights(loaded, [_sun(options.sun_at)])
    return with_sun(loaded) if options.sun else loaded


def _is_interior(scene: Scene) -> bool:
    from shadowbench.survey.interior import is_interior  # with Embree and Numba

    return is_interior(scene)


def _seen_from(scene: Scene, camera: str, target: str | None) -> Scene:
    """The scene with the camera that `--camera` means, alone."""
    own = [one for one in scene.cameras if one.name == camera and "camera" not in scene.assumed]
    if own:
        return with_cameras(scene, own)
    bounds = content_of(scene).geometry.bounds
    if "," in camera:
        place = coordinates(camera, "--camera")
        aim = vec3(bounds.mean(axis=0)) if target is None else coordinates(target, "--target")
        name = _name("at", place, *([aim] if target else []))
        return with_cameras(scene, [Camera(name, place, aim, FOV_Y)])
    if camera in SIDES:
        up = (0.0, 0.0, -1.0) if camera == "top" else (0.0, 1.0, 0.0)
        view = whole_view(bounds, SIDES[camera], camera, up)
        return with_cameras(scene, [view], f"{camera} of {scene.name}: camera {pose_of(view)}")
    if camera == INSIDE:
        from shadowbench.survey.interior import interior

        found = interior(scene)
        inside = with_cameras(scene, [found.camera], found.note)
        if "light" not in scene.assumed or found.sunny:
            return inside
        size = math.dist(found.lamp.position, found.camera.position)
        lamp = f"assumed a lamp at {point_text(found.lamp.position, size)}"
        note = f"no light in {scene.name}, and the sun that is assumed outside does not come in: {lamp}"
        return with_lights(inside, [found.lamp], note)
    names = [one.name for one in scene.cameras if "camera" not in scene.assumed]
    known = alternatives(camera, dict.fromkeys([*names, *SIDES, INSIDE]))
    raise InputError(f"--camera: found {camera!r:.60}{known}, or X,Y,Z")


def _lamp(text: str) -> Light:
    place = coordinates(text, "--lamp")
    return Light(_name("lamp", place), "point", position=place)


def _sun(text: str) -> Light:
    azimuth, elevation = azimuth_elevation(text)
    direction = sun_direction(math.radians(azimuth), math.radians(elevation))
    return Light(_name("sun", (azimuth, elevation)), "directional", direction=direction)


def _name(kind: str, *points: Sequence[float]) -> str:
    """A name that differs for other points, whose files and rows may be in one folder."""
    name = f"{kind} {' to '.join(' '.join(f'{value:.9g}' for value in point) for point in points)}"
    digest = hashlib.sha256(repr(points).encode()).hexdigest()
    return name if len(name) <= LONGEST_NAME else f"{kind} {digest[:12]}"


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
