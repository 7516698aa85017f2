"""A camera and a lamp inside an interior: at eye height, in its largest free space."""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from shadowbench.errors import InputError
from shadowbench.scenes.assumed import SUN, content_of, pose_of
from shadowbench.scenes.geometry import facet_normals
from shadowbench.scenes.model import Camera, Light, Scene
from shadowbench.scenes.placement import Placement
from shadowbench.scenes.vectors import Floats, Vec3, unit, vec3
from shadowbench.truths.embree import Tracer, over_slices
from shadowbench.truths.instances import tracer_of

FOV_Y = math.radians(60.0)
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
MOST = 0.5
"""Least share of the places of an interior, seen from above, where one stands inside; 0.67 to 0.87 in rooms."""
_OFF_WALLS = 0.02  # least distance from walls, as a share of the scene's size; few places in an engine have it
_PLACES, _FEW_PLACES, _LEVELS = 1600, 256, 8  # from which floors are sought: seen from above, and levels of each
_AROUND, _ABOVE = 72, 56  # directions of rays: horizontal, and of the upper half of the sphere
_ROOM = 0.005  # least distance of walls from the camera, as a share of the scene's size
_BACK = 0.8  # how far the camera stands back, as a share of the distance of the nearest wall
_DOWN = math.radians(8.0)  # below the horizon
_LAMP = 0.7  # height of the lamp, as a share of the way from the eye to the ceiling
_FAR = 4.0  # beyond any local scene
Mask = NDArray[np.bool_]
_UP: Floats = np.array([[0.0, 1.0, 0.0]])


class Interior(NamedTuple):
    """A camera inside and a note on it; a lamp above where most is free; whether the assumed sun comes in."""

    camera: Camera
    note: str
    lamp: Light
    sunny: bool


class _Places(NamedTuple):
    """Points at eye height, in local coordinates, those of `placement`; a row each.

    eye: (N, 3); floor: (N,) height of the floor; height: (N,) from floor to ceiling; in_metres: (N,) whether the eye is
    at `EYE_M`; around: (N, _AROUND) distances of horizontal rays, `_FAR` or more for none; inside: (N,) whether
    surfaces surround the point; facing: (N,) whether they face it as well, as they do not inside a solid; sunny: (N,)
    whether the assumed sun reaches it.
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


def interior(scene: Scene) -> Interior:
    """A view through the largest free space of an interior, at eye height.

    That is around the point whose nearest wall is farthest; the distance is that of horizontal rays, as floor and
    ceiling are near everywhere. The camera looks past it to where most is free, and a little down, from four fifths of
    that distance behind; the lamp is above it. Points inside a solid count only if there is no other. Raises InputError
    if none is inside.
    """
    found = _places(scene, _PLACES)
    inside = (found.facing if found.facing.any() else found.inside) & (found.wall >= _ROOM)
    if not inside.any():
        raise InputError(f"--camera inside: {scene.name} encloses no free space; allowed: a side, or X,Y,Z")
    level = found.floor.round(2)
    levels, of_level = np.unique(level[inside], return_inverse=True)
    shared = inside & np.isin(level, levels[np.bincount(of_level) >= SHARED * inside.sum()])
    best = int(np.argmax(np.where(shared if shared.any() else inside, found.wall, -1.0)))
    eye, around, wall = found.eye[best], found.around[best], float(found.wall[best])
    free = np.where(around < _FAR, around, 0.0)  # out of a window nothing is seen
    half = round(_AROUND * FOV_Y / (4 * math.pi))
    across = np.median([np.roll(free, turn) for turn in range(-half, half + 1)], axis=0).round(3)  # more than a door
    ahead = int(np.argmax(across))
    start = eye - _BACK * wall * _around()[ahead]
    aim = start + (_around()[ahead] - math.tan(_DOWN) * _UP[0]) * (_BACK * wall + float(across[ahead]))
    camera = Camera("inside", _placed(start, found.placement), _placed(aim, found.placement), FOV_Y)
    lamp = eye + _LAMP * (found.floor[best] + found.height[best] - eye[1]) * _UP[0]
    height = f"{EYE_M} m above the floor" if found.in_metres[best] else "half way from floor to ceiling"
    note = f"inside of {scene.name}: camera {pose_of(camera)}, {height}"
    light = Light("lamp", "point", position=_placed(lamp, found.placement))
    return Interior(camera, note, light, bool(found.sunny[inside].mean() >= SUNNY))


def is_interior(scene: Scene) -> bool:
    """Whether in most places of a scene one stands inside, off its walls: from outside only they would be seen."""
    found = _places(scene, _FEW_PLACES)
    stands = found.facing & (found.wall >= _OFF_WALLS)
    inside, of_all = (len(np.unique(eyes[:, [0, 2]], axis=0)) for eyes in (found.eye[stands], found.eye))
    return inside > MOST * of_all


def _places(scene: Scene, places: int) -> _Places:
    """Points at eye height above each floor at about so many places of a scene, seen from above."""
    place = content_of(scene).placement
    geometry = place.scene(scene).geometry
    tracer = tracer_of(geometry)
    eye, floor, height, in_metres = _eyes(tracer, place.points(content_of(scene).geometry.bounds), place.scale, places)
    rise = (np.arange(_ABOVE) + 0.5) / _ABOVE  # a spiral of directions that are equally dense
    turn, level = math.pi * (3 - math.sqrt(5)) * np.arange(_ABOVE), np.sqrt(1 - rise**2)
    directions = np.concatenate([_around(), np.stack([level * np.cos(turn), rise, level * np.sin(turn)], axis=1)])

    def traced(part: slice) -> tuple[Floats, Floats, Floats]:
        shape = part.stop - part.start, len(directions)
        origins, rays = np.repeat(eye[part], shape[1], axis=0), np.tile(directions, (shape[0], 1))
        triangle, reach = tracer.hits(origins, rays, _FAR)
        normals = facet_normals(geometry.corners(np.maximum(triangle, 0)))
        facing = (triangle >= 0) & (np.einsum("ij,ij->i", normals, rays) < 0.0)
        distance = reach.astype(np.float64).reshape(shape)
        hits, faces = (each.reshape(shape).mean(axis=1) for each in (triangle >= 0, facing))
        return distance[:, :_AROUND], hits, faces

    parts = list(over_slices(traced, len(eye), 256)) or [traced(slice(0, 0))]
    around, hits, faces = (np.concatenate(each) for each in zip(*parts, strict=True))
    inside = hits >= ENCLOSED
    sunny = ~tracer.occluded(eye, -unit(SUN)[None], _FAR)
    return _Places(place, eye, floor, height, in_metres, around, inside, inside & (faces >= hits / 2), sunny)


def _eyes(tracer: Tracer, bounds: Floats, scale: float, places: int) -> tuple[Floats, Floats, Floats, Mask]:
    """(N, 3) points at eye height, (N,) heights of their floors, heights from those to ceilings, whether in metres."""
    low, high = bounds
    width, _, depth = np.maximum(high - low, 1e-3)
    across, along = (math.ceil(math.sqrt(places * share)) for share in (width / depth, depth / width))
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
