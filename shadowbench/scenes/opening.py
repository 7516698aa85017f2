"""From options to a scene, and to the view of one of its cameras and lights: those by name, or others placed here.

`--camera inside` is at eye height in the largest free space of an interior, which rays find; their tracer is given.
"""

import hashlib
import math
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from shadowbench.errors import InputError, alternatives
from shadowbench.options import FIRST, SceneOptions, ViewOptions, ViewSizeLike, azimuth_elevation, coordinates
from shadowbench.scenes.assumed import (
    FOV_Y,
    SUN,
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
from shadowbench.scenes.file_contents import Chosen
from shadowbench.scenes.library import load_scene
from shadowbench.scenes.model import Camera, Light, Placement, Scene, View, view_of
from shadowbench.scenes.scene_tables import LONGEST_NAME
from shadowbench.scenes.triangles import Geometry, facet_normals, in_slices
from shadowbench.scenes.vectors import Floats, Vec3, unit, vec3

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
_INSIDE_FOV_Y = math.radians(60.0)
EYE_M = 1.6
"""Height of the eye above the floor in metres, where floor and ceiling are as far apart as in `ROOM_M`."""
ROOM_M = (2.1, 20.0)
"""Heights of rooms in metres; where one is outside them, the file has other units, and the eye is half way up."""
ENCLOSED = 0.65
"""Least share of the directions in which a point inside sees a surface; in a street it is about 0.7."""
SHARED = 0.1
"""Least share of the points inside that stand on one floor; on the top of a table fewer do."""
SUNNY = 0.02
"""Least share of the points inside that the assumed sun must reach to be kept."""
_PLACES, _LEVELS = 1600, 8  # from which floors are sought: seen from above, and levels of each
_AROUND, _ABOVE = 72, 56  # directions of rays: horizontal, and of the upper half of the sphere
_ROOM = 0.005  # least distance of walls from the camera, as a share of the scene's size
_BACK = 0.8  # how far the camera stands back, as a share of the distance of the nearest wall
_DOWN = math.radians(8.0)  # below the horizon
_LAMP = 0.7  # height of the lamp, as a share of the way from the eye to the ceiling
_FAR = 4.0  # beyond any local scene
_UP: Floats = np.array([[0.0, 1.0, 0.0]])
Named = TypeVar("Named", Camera, Light)
Mask = NDArray[np.bool_]
TracerOf = Callable[[Geometry], Any]
"""A `truths.embree.Tracer` of a geometry's triangles."""


def chosen_view(
    scene: str | Path | Scene,
    size: ViewSizeLike,
    options: ViewOptions = FIRST,
    note: Callable[[str], None] = lambda line: None,
    tracer_of: TracerOf | None = None,
) -> View:
    """The view of a size of a scene that options name.

    scene: a name, a file or a loaded scene; note: receives the scene's notes, and the names of the cameras and lights
    that are not used; tracer_of: as by `opened`. Raises InputError for an unknown scene, camera or light, or an invalid
    size.
    """
    loaded = opened(scene, options, tracer_of)
    camera = named(loaded.cameras, options.view, "view") if options.view else loaded.cameras[0]
    light = named(loaded.lights, options.light, "light") if options.light else loaded.lights[0]
    for line in _notes(loaded, options):
        note(line)
    return view_of(loaded, camera, light, size)


def opened(scene: str | Path | Scene, options: SceneOptions, tracer_of: TracerOf | None = None) -> Scene:
    """A scene by name or file, or a loaded one, with what options ask of camera, lights and ground. Raises InputError.

    tracer_of: places a camera inside an interior, which gets a lamp in place of a sun that was assumed and does not
    come in.
    """
    if isinstance(scene, Scene):
        loaded = scene
    else:
        loaded = load_scene(scene, options.assets, options.up, Chosen(options.time, options.clip))
    loaded = without_ground(loaded) if options.no_ground else loaded
    if options.camera is not None:
        loaded = _seen_from(loaded, options.camera, options.target, tracer_of)
    if options.lamp is not None:
        loaded = with_lights(loaded, [_lamp(options.lamp)])
    elif options.sun_at is not None:
        loaded = with_lights(loaded, [_sun(options.sun_at)])
    return with_sun(loaded) if options.sun else loaded


def _seen_from(scene: Scene, camera: str, target: str | None, tracer_of: TracerOf | None) -> Scene:
    """The scene with the camera that `--camera` means, alone."""
    cameras = [] if "camera" in scene.assumed else scene.cameras
    own = [one for one in cameras if one.name == camera]
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
    if camera == INSIDE and tracer_of:
        return _seen_from_inside(scene, tracer_of)
    known = alternatives(camera, dict.fromkeys([*(one.name for one in cameras), *SIDES, INSIDE]))
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
    raise InputError(f"{where}: found {name!r:.60}{alternatives(name, [thing.name for thing in things])}")


class _Places(NamedTuple):
    """N points at eye height, in local coordinates: a row each.

    floor: height of the floor; height: from there to the ceiling; in_metres: whether the eye is at `EYE_M`; around:
    (N, _AROUND) distances of horizontal rays, `_FAR` or more for none; inside: whether surfaces surround the point;
    facing: whether they face it as well, as they do not inside a solid; sunny: whether the assumed sun reaches it.
    """

    placement: Placement
    eye: Floats
    floor: Floats
    height: Floats
    in_metres: Mask
    around: Floats
    inside: Mask
    facing: Mask
    sunny: Mask

    @property
    def wall(self) -> Floats:
        """(N,) distance of the nearest wall; rounded, as the last bits depend on the processor."""
        nearest: Floats = self.around.min(axis=1).round(3)
        return nearest


def _seen_from_inside(scene: Scene, tracer_of: TracerOf) -> Scene:
    """The scene with a camera in its largest free space, and with a lamp there if no sun comes in that was assumed.

    That is around the point at eye height whose nearest wall is farthest; the distance is that of horizontal rays, as
    floor and ceiling are near everywhere. The camera looks past it to where most is free, and a little down, from four
    fifths of that distance behind; the lamp is above it. Points inside a solid count only if there is no other. Raises
    InputError if none is inside.
    """
    places = _places(scene, tracer_of)
    inside = (places.facing if places.facing.any() else places.inside) & (places.wall >= _ROOM)
    if not inside.any():
        raise InputError(f"--camera inside: {scene.name} encloses no free space; allowed: a side, or X,Y,Z")
    level = places.floor.round(2)
    levels, of_level = np.unique(level[inside], return_inverse=True)
    shared = inside & np.isin(level, levels[np.bincount(of_level) >= SHARED * inside.sum()])
    best = int(np.argmax(np.where(shared if shared.any() else inside, places.wall, -1.0)))
    eye, around, wall = places.eye[best], places.around[best], float(places.wall[best])
    free = np.where(around < _FAR, around, 0.0)  # out of a window nothing is seen
    half = round(_AROUND * _INSIDE_FOV_Y / (4 * math.pi))
    across = np.median([np.roll(free, turn) for turn in range(-half, half + 1)], axis=0).round(3)  # more than a door
    ahead = int(np.argmax(across))
    start = eye - _BACK * wall * _around()[ahead]
    aim = start + (_around()[ahead] - math.tan(_DOWN) * _UP[0]) * (_BACK * wall + float(across[ahead]))
    camera = Camera("inside", _placed(start, places.placement), _placed(aim, places.placement), _INSIDE_FOV_Y)
    height = f"{EYE_M} m above the floor" if places.in_metres[best] else "half way from floor to ceiling"
    seen = with_cameras(scene, [camera], f"inside of {scene.name}: camera {pose_of(camera)}, {height}")
    if "light" not in scene.assumed or places.sunny[inside].mean() >= SUNNY:
        return seen
    above = eye + _LAMP * (places.floor[best] + places.height[best] - eye[1]) * _UP[0]
    lamp = Light("lamp", "point", position=_placed(above, places.placement))
    where = point_text(lamp.position, math.dist(lamp.position, camera.position))
    note = f"no light in {scene.name}, and the sun that is assumed outside does not come in: assumed a lamp at {where}"
    return with_lights(seen, [lamp], note)


def _places(scene: Scene, tracer_of: TracerOf) -> _Places:
    """Points at eye height above each floor of a scene."""
    place = content_of(scene).placement
    geometry = place.scene(scene).geometry
    tracer = tracer_of(geometry)
    eye, floor, height, in_metres = _eyes(tracer, place.points(content_of(scene).geometry.bounds), place.scale)
    rise = (np.arange(_ABOVE) + 0.5) / _ABOVE  # a spiral of directions that are equally dense
    turn, level = math.pi * (3 - math.sqrt(5)) * np.arange(_ABOVE), np.sqrt(1 - rise**2)
    directions = np.concatenate([_around(), np.stack([level * np.cos(turn), rise, level * np.sin(turn)], axis=1)])

    around, hits, faces = [np.empty((0, _AROUND))], [np.empty(0)], [np.empty(0)]
    for part in in_slices(len(eye), 256):
        shape = len(eye[part]), len(directions)
        rays = np.tile(directions, (shape[0], 1))
        nearest = tracer.hits(np.repeat(eye[part], shape[1], axis=0), rays, _FAR)
        normals = facet_normals(geometry.corners(np.maximum(nearest.triangle, 0)))
        hit = nearest.triangle >= 0
        around.append(nearest.distance.astype(np.float64).reshape(shape)[:, :_AROUND])
        hits.append(hit.reshape(shape).mean(axis=1))
        faces.append((hit & (np.einsum("ij,ij->i", normals, rays) < 0.0)).reshape(shape).mean(axis=1))
    enclosed, facing = np.concatenate(hits), np.concatenate(faces)
    inside = enclosed >= ENCLOSED
    return _Places(
        placement=place,
        eye=eye,
        floor=floor,
        height=height,
        in_metres=in_metres,
        around=np.concatenate(around),
        inside=inside,
        facing=inside & (facing >= enclosed / 2),
        sunny=~tracer.occluded(eye, -unit(SUN)[None], _FAR),
    )


def _eyes(tracer: Any, bounds: Floats, scale: float) -> tuple[Floats, Floats, Floats, Mask]:
    """(N, 3) points at eye height, (N,) heights of their floors, heights from those to ceilings, whether in metres."""
    low, high = bounds
    width, _, depth = np.maximum(high - low, 1e-3)
    across, along = (math.ceil(math.sqrt(_PLACES * share)) for share in (width / depth, depth / width))
    steps = [(np.arange(count) + 0.5) / count for count in (across, _LEVELS, along)]
    start = low + np.stack(np.meshgrid(*steps, indexing="ij"), axis=-1).reshape(-1, 3) * (high - low)
    down = tracer.hits(start, -_UP, _FAR).distance.astype(np.float64)
    start, floor = start[down < _FAR], (start[:, 1] - down)[down < _FAR]
    _, first = np.unique(np.column_stack([start[:, [0, 2]], floor.round(4)]), axis=0, return_index=True)
    start, floor = start[first], floor[first]
    height = np.minimum(start[:, 1] + tracer.hits(start, _UP, _FAR).distance, high[1]) - floor
    in_metres = (ROOM_M[0] <= height / scale) & (height / scale <= ROOM_M[1])
    eye = floor + np.where(in_metres, EYE_M * scale, height / 2)
    return np.column_stack([start[:, 0], eye, start[:, 2]]), floor, height, in_metres


def _around() -> Floats:
    """(_AROUND, 3) horizontal unit vectors."""
    turn = 2 * math.pi * np.arange(_AROUND) / _AROUND
    return np.stack([np.cos(turn), 0.0 * turn, np.sin(turn)], axis=1)


def _placed(point: Floats, place: Placement) -> Vec3:
    """A local point in the scene's coordinates, to a ten-thousandth of its size: the rest depends on the processor."""
    digits = 4 + round(math.log10(place.scale))
    return vec3([round(float(value), digits) + 0.0 for value in point / place.scale + place.center])
