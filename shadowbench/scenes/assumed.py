"""Default ground, camera and light of a file that has none. Each assumption is a line of `Scene.notes`."""

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from shadowbench.errors import InputError
from shadowbench.scenes.model import SUN_RADIUS, Camera, Light, Mesh, Scene
from shadowbench.scenes.triangles import bounds_of, in_slices
from shadowbench.scenes.vectors import Floats, Vec3, unit, vec3

VIEW_FROM = (1.25, 1.2, 2.7)
FOV_Y = math.radians(36.0)
SUN = (0.8, -1.0, -0.6)
GROUND_SIDE = 4.0
"""Side of the default ground, in diagonals of the bounds."""
GROUND_THICKNESS, GROUND_RELIEF = 0.05, 0.1
"""Largest thickness of a file's own ground, and its height above a plane below the scene, in sides of the footprint."""
STEEPEST_GROUND = math.radians(30.0)
COLUMNS = 32
"""Vertical rays along each side of the footprint that look for a ground."""
_BATCH = 1 << 15  # triangles, and pairs of these with rays
_ROUNDING = 1e-9  # of coordinates in cells
SMALLEST = 1e-18
"""Smallest diagonal of a scene, in metres: the squared areas of a smaller one would underflow float64."""


def mesh_bounds(meshes: Sequence[Mesh], where: str) -> Floats:
    """(2, 3) lowest and highest corner of all meshes. Raises InputError for a diagonal below `SMALLEST`."""
    bounds = bounds_of(np.concatenate([mesh.bounds for mesh in meshes]))
    diagonal = float(np.linalg.norm(bounds[1] - bounds[0]))
    if diagonal < SMALLEST:
        raise InputError(f"{where}: all meshes together span {diagonal:.3g} m; at least {SMALLEST:.0e} m is needed")
    return bounds


def content_of(scene: Scene) -> Scene:
    """The scene without the ground that was assumed."""
    if scene.ground is None:
        return scene
    return replace(scene, meshes=tuple(mesh for mesh in scene.meshes if mesh is not scene.ground[0]))


def whole_view(bounds: Floats, away: Vec3, name: str, up: Vec3 = (0.0, 1.0, 0.0)) -> Camera:
    """A camera that shows the whole bounding sphere of (2, 3) bounds; away: direction from their middle to it."""
    center, diagonal = bounds.mean(axis=0), float(np.linalg.norm(bounds[1] - bounds[0]))
    position = center + unit(away) * (diagonal / 2) / math.sin(FOV_Y / 2)
    return Camera(name, vec3(position), vec3(center), FOV_Y, up)


def pose_of(camera: Camera) -> str:
    """Where a camera stands, for a note."""
    size = math.dist(camera.position, camera.target)
    place = f"at {point_text(camera.position, size)} looking at {point_text(camera.target, size)}"
    return f"{place}, fov_y {math.degrees(camera.fov_y):.0f}°"


def sun_direction(azimuth: float, elevation: float) -> Vec3:
    """Direction in which the light of a sun travels.

    azimuth: clockwise from north (−z), seen from above, so that π/2 is east (+x), as of a compass; elevation: above the
    horizon; both in radians.
    """
    level = math.cos(elevation)
    return vec3((-level * math.sin(azimuth), -math.sin(elevation), level * math.cos(azimuth)))


def assumed_ground(meshes: Sequence[Mesh], bounds: Floats, where: str) -> tuple[Mesh, str] | None:
    """A square ground below the meshes and the note about it; None if the meshes have a ground of their own."""
    if _has_ground(meshes, bounds):
        return None
    low, high = bounds
    diagonal = float(np.linalg.norm(high - low))
    side = GROUND_SIDE * diagonal
    center = np.array([(low[0] + high[0]) / 2, low[1], (low[2] + high[2]) / 2])
    corners = center + np.array([[-1, 0, 1], [1, 0, 1], [1, 0, -1], [-1, 0, -1]]) * (side / 2)
    ground = Mesh("ground", corners, np.array([[0, 1, 2], [0, 2, 3]], dtype=np.int32))
    x, y, z = _rounded(center, diagonal)
    place = f"at y = {y:.6g} around ({x:.6g}, {z:.6g})"
    shown = "which receives and casts shadows; --no-ground leaves it out"
    return ground, f"no ground in {where}: assumed a square of side {side:.6g} {place}, {shown}"


def _has_ground(meshes: Sequence[Mesh], bounds: Floats) -> bool:
    """Whether over half of the footprint the lowest surface that faces up is a ground.

    Things on a ground may hide it from above. It must be thin, so that a box is none, and near a plane, level or
    tilted, that the meshes stand on, so that a table's top is none.
    """
    x, _, z = bounds[1] - bounds[0]
    side = math.sqrt(float(x * z))
    if side == 0.0:
        return False
    cell = np.array([x / COLUMNS, side, z / COLUMNS])
    columns = _columns(meshes, bounds[0], cell)
    thin = np.isfinite(columns.floor) & (columns.floor <= columns.lowest + GROUND_THICKNESS)
    if 2 * np.count_nonzero(thin) < thin.size:
        return False
    steepest = math.tan(STEEPEST_GROUND)
    planes = _planes_below(columns.feet, steepest * math.hypot(x, z) / side)
    planes = planes[np.hypot(*(planes[:, :2] / cell[[0, 2]]).T) * side <= steepest]
    heights = columns.floor[thin] - (planes[:, :2] @ (np.argwhere(thin).T + 0.5) + planes[:, 2:])
    return bool(2 * np.count_nonzero(heights <= GROUND_RELIEF, axis=1).max(initial=0) >= thin.size)


class _Columns(NamedTuple):
    """Heights along vertical rays through the centres of a grid's cells, in units of the cells.

    lowest: (COLUMNS, COLUMNS) of the lowest surface; floor: of the lowest that faces up; both infinite for none. feet:
    (N, 3) the lowest vertex in each cell that has one.
    """

    lowest: Floats
    floor: Floats
    feet: Floats


def _columns(meshes: Sequence[Mesh], low: Floats, cell: Floats) -> _Columns:
    """The columns of meshes. low: their lowest corner; cell: (3,) the units of x, of heights and of z."""
    first = np.cumsum([0, *(len(mesh.vertices) for mesh in meshes)])
    vertices = (np.concatenate([mesh.vertices for mesh in meshes]) - low) / cell
    faces = np.concatenate([mesh.faces + start for mesh, start in zip(meshes, first, strict=False)])
    height = vertices[:, 1]
    bottom = height[faces].min(axis=1)
    upwards = np.argsort(bottom)
    lowest, floor = np.full((2, COLUMNS, COLUMNS), np.inf)
    for part in in_slices(len(upwards), _BATCH):
        if bottom[upwards[part.start]] >= floor.max():
            break  # all others are above a floor, as most of a forest is
        corners = vertices[faces[upwards[part]]]
        _rasterize(corners[..., [0, 2]] - 0.5, corners[..., 1], lowest, floor)
    cells = np.clip(vertices[:, [0, 2]], 0, COLUMNS - 1).astype(np.intp) @ [COLUMNS, 1]
    by_height = np.lexsort((height, cells))
    feet = by_height[np.unique(cells[by_height], return_index=True)[1]]
    return _Columns(lowest, floor, vertices[feet])


def _rasterize(plan: Floats, height: Floats, lowest: Floats, floor: Floats) -> None:
    """Lower a grid's heights to those of triangles at its points, which have integer coordinates.

    plan: (T, 3, 2) corners seen from above; height: (T, 3); floor: of the triangles that face up.
    """
    a, b, c = np.moveaxis(plan, 1, 0)
    doubled = _cross(b - a, c - a)
    first = np.maximum(np.ceil(np.minimum(np.minimum(a, b), c) - _ROUNDING), 0).astype(np.intp)
    last = np.minimum(np.floor(np.maximum(np.maximum(a, b), c) + _ROUNDING), COLUMNS - 1).astype(np.intp)
    width = np.maximum(last - first + 1, 0)
    count = width.prod(axis=1) * (np.abs(doubled) > _ROUNDING)
    ends = np.cumsum(count)
    for start in range(0, int(ends[-1]), _BATCH):
        pair = np.arange(start, min(start + _BATCH, int(ends[-1])))  # of a triangle and a point in its bounds
        triangle = np.searchsorted(ends, pair, side="right")
        step = np.divmod(pair - (ends - count)[triangle], width[triangle, 1])
        point = first[triangle] + np.stack(step, axis=1)
        away, area = plan[triangle] - point[:, None], doubled[triangle]
        weights = np.stack([_cross(away[:, k - 2], away[:, k - 1]) / area for k in range(3)], axis=1)
        inside = (weights >= -_ROUNDING).all(axis=1)
        (x, z), y, up = point[inside].T, (weights * height[triangle]).sum(axis=1)[inside], area[inside] < 0.0
        np.minimum.at(lowest, (x, z), y)
        np.minimum.at(floor, (x[up], z[up]), y[up])


def _cross(a: Floats, b: Floats) -> Floats:
    """(N,) cross products of (N, 2) vectors."""
    return np.asarray(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0])


def _planes_below(points: Floats, highest: float) -> Floats:
    """(P, 3) planes y = a x + b z + c below (N, 3) points, through three or more of them, which are nowhere higher."""
    from scipy.spatial import ConvexHull  # the import takes 0.3 s, and only mesh files need it

    x, y, z = points.T
    top = [x.mean()], [highest + 1.0], [z.mean()]  # so that points on a plane have a hull
    hull = ConvexHull(np.hstack([[x, np.minimum(y, highest), z], top]).T)
    faces = np.unique(hull.equations.round(9), axis=0)
    faces = faces[faces[:, 1] < 0.0]
    return np.asarray(-faces[:, [0, 2, 3]] / faces[:, 1:2])


def with_assumptions(scene: Scene, bounds: Floats, where: str) -> Scene:
    """The scene with a default camera and light if it has none, and a note on its zero-area triangles.

    bounds: (2, 3) lowest and highest corner of the meshes.
    """
    assumed: dict[str, str] = {}
    if not scene.cameras:
        camera = whole_view(bounds, VIEW_FROM, "camera")
        assumed["camera"] = f"no camera in {where}: assumed {pose_of(camera)}"
        scene = replace(scene, cameras=(camera,))
    if not scene.lights:
        sun = f"{point_text(SUN, 1.0)}, {math.degrees(math.asin(-unit(SUN)[1])):.0f}° above the horizon"
        assumed["light"] = f"no light in {where}: assumed a sun travelling along {sun}"
        scene = replace(scene, lights=(Light("light", "directional", direction=SUN),))
    scene = replace(scene, notes=(*scene.notes, *assumed.values()), assumed=assumed)
    left_out = f"{where}: {scene.dropped} zero-area triangle(s) left out"
    return replace(scene, notes=(*scene.notes, left_out)) if scene.dropped else scene


def with_cameras(scene: Scene, cameras: Sequence[Camera], note: str = "") -> Scene:
    """The scene with these cameras in place of its own, without the note on an assumed one, and with one on them."""
    return replace(scene, cameras=tuple(cameras), **_with_note(scene, "camera", note))


def with_lights(scene: Scene, lights: Sequence[Light], note: str = "") -> Scene:
    """The scene with these lights in place of its own, without the note on an assumed one, and with one on them."""
    return replace(scene, lights=tuple(lights), **_with_note(scene, "light", note))


def _with_note(scene: Scene, what: str, note: str) -> dict[str, Any]:
    """The fields of a scene that tell what was assumed, with another note on one thing."""
    notes = [line for line in scene.notes if line != scene.assumed.get(what)]
    assumed = {name: line for name, line in scene.assumed.items() if name != what}
    return {"notes": (*notes, *([note] if note else [])), "assumed": assumed}


def sunlit(light: Light) -> Light:
    """A directional light without a size with that of the sun; any other light unchanged."""
    return replace(light, radius=SUN_RADIUS) if light.kind == "directional" and not light.soft else light


def with_sun(scene: Scene) -> Scene:
    """The scene with the sun's size for directional lights without one, and a note on them."""
    lights = tuple(sunlit(light) for light in scene.lights)
    names = [light.name for light, given in zip(lights, scene.lights, strict=True) if light is not given]
    note = f"sun: {scene.name} has no directional light without a size"
    if names:
        radius = f"{math.degrees(SUN_RADIUS):.4g}°"
        note = f"no size of {', '.join(names)} in {scene.name}: assumed the sun's angular radius, {radius}"
    return replace(scene, lights=lights, notes=(*scene.notes, note))


def without_ground(scene: Scene) -> Scene:
    """The scene without the ground that was assumed, and a note on it."""
    if scene.ground is None:
        return replace(scene, notes=(*scene.notes, f"no-ground: no ground was assumed in {scene.name}"))
    line = scene.ground[1]
    none = f"{line.partition(': assumed a square')[0]}: none assumed"
    notes = tuple(none if note == line else note for note in scene.notes)
    return replace(content_of(scene), notes=notes, ground=None)


def point_text(values: Vec3, size: float) -> str:
    """A point in a scene of this size, or a direction, for a note."""
    return f"({', '.join(f'{value:.6g}' for value in _rounded(values, size))})"


def _rounded(values: Sequence[float] | Floats, size: float) -> list[float]:
    """Coordinates to a millionth of a size: beyond it, 0 may be −7.45e-09."""
    digits = 6 - math.floor(math.log10(size))
    return [round(float(value), digits) + 0.0 for value in values]
