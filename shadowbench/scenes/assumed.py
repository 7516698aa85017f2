"""Default ground, camera and light of a file that has none. Each assumption is a line of `Scene.notes`."""

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from shadowbench.errors import InputError
from shadowbench.scenes.geometry import bounds_of
from shadowbench.scenes.model import SUN_RADIUS, Camera, Light, Mesh, Scene
from shadowbench.scenes.vectors import Floats, Vec3, unit, vec3

VIEW_FROM = (1.25, 1.2, 2.7)
FOV_Y = math.radians(36.0)
SUN = (0.8, -1.0, -0.6)
GROUND_SIDE = 4.0
"""Side of the default ground, in diagonals of the bounds."""
GROUND_THICKNESS = 1e-3
"""Largest distance from the lowest height, in diagonals of the bounds, at which a triangle counts as ground."""
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


def assumed_camera(bounds: Floats, where: str) -> tuple[Camera, str]:
    """A camera that shows the whole bounding sphere of (2, 3) bounds, and the note about it."""
    camera = whole_view(bounds, VIEW_FROM, "camera")
    return camera, f"no camera in {where}: assumed {pose_of(camera)}"


def sun_direction(azimuth: float, elevation: float) -> Vec3:
    """Direction in which the light of a sun travels.

    azimuth: clockwise from north (−z), seen from above, so that π/2 is east (+x), as of a compass; elevation: above the
    horizon; both in radians.
    """
    level = math.cos(elevation)
    return vec3((-level * math.sin(azimuth), -math.sin(elevation), level * math.cos(azimuth)))


def assumed_sun(where: str) -> tuple[Light, str]:
    """A sun 45° above the horizon, and the note about it."""
    height = math.degrees(math.asin(-unit(SUN)[1]))
    note = f"no light in {where}: assumed a sun travelling along {point_text(SUN)}, {height:.0f}° above the horizon"
    return Light("light", "directional", direction=SUN), note


def assumed_ground(meshes: Sequence[Mesh], bounds: Floats, where: str) -> tuple[Mesh, str] | None:
    """A square ground below the meshes and the note about it; None if the meshes have a ground of their own."""
    low, high = bounds
    diagonal = float(np.linalg.norm(high - low))
    footprint = float((high[0] - low[0]) * (high[2] - low[2]))
    if footprint > 0.0 and _floor_area(meshes, low[1], GROUND_THICKNESS * diagonal) >= footprint / 2:
        return None
    side = GROUND_SIDE * diagonal
    center = np.array([(low[0] + high[0]) / 2, low[1], (low[2] + high[2]) / 2])
    corners = center + np.array([[-1, 0, 1], [1, 0, 1], [1, 0, -1], [-1, 0, -1]]) * (side / 2)
    ground = Mesh("ground", corners, np.array([[0, 1, 2], [0, 2, 3]], dtype=np.int32))
    x, y, z = (_coordinate(float(value), diagonal) for value in center)
    place = f"at y = {y} around ({x}, {z})"
    shown = "which receives and casts shadows; --no-ground leaves it out"
    return ground, f"no ground in {where}: assumed a square of side {side:.6g} {place}, {shown}"


def _floor_area(meshes: Sequence[Mesh], y: float, thickness: float) -> float:
    """Area, projected on the xz plane, of the upward-facing triangles within `thickness` of the height `y`."""
    area = 0.0
    for mesh in meshes:
        if mesh.bounds[0, 1] > y + thickness:
            continue
        vertices = mesh.vertices
        low = vertices[mesh.faces[(np.abs(vertices[:, 1] - y) <= thickness)[mesh.faces].all(axis=1)]]
        ab, ac = low[:, 1] - low[:, 0], low[:, 2] - low[:, 0]
        doubled = ab[:, 2] * ac[:, 0] - ab[:, 0] * ac[:, 2]  # the y of their cross product
        area += float(np.maximum(doubled, 0.0).sum()) / 2
    return area


def with_assumptions(scene: Scene, bounds: Floats, where: str) -> Scene:
    """The scene with a default camera and light if it has none, and a note on its zero-area triangles.

    bounds: (2, 3) lowest and highest corner of the meshes.
    """
    assumed: dict[str, str] = {}
    if not scene.cameras:
        camera, assumed["camera"] = assumed_camera(bounds, where)
        scene = replace(scene, cameras=(camera,))
    if not scene.lights:
        light, assumed["light"] = assumed_sun(where)
        scene = replace(scene, lights=(light,))
    scene = replace(scene, notes=(*scene.notes, *assumed.values()), assumed=assumed)
    left_out = f"{where}: {scene.dropped} zero-area triangle(s) left out"
    return replace(scene, notes=(*scene.notes, left_out)) if scene.dropped else scene


def with_cameras(scene: Scene, cameras: Sequence[Camera], note: str = "") -> Scene:
    """The scene with these cameras in place of its own, without the note on an assumed one, and with one on them."""
    return replace(scene, cameras=tuple(cameras), **_told(scene, "camera", note))


def with_lights(scene: Scene, lights: Sequence[Light], note: str = "") -> Scene:
    """The scene with these lights in place of its own, without the note on an assumed one, and with one on them."""
    return replace(scene, lights=tuple(lights), **_told(scene, "light", note))


def _told(scene: Scene, what: str, note: str) -> dict[str, Any]:
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
    told = scene.ground[1]
    none = f"{told.partition(': assumed a square')[0]}: none assumed"
    notes = tuple(none if note == told else note for note in scene.notes)
    return replace(content_of(scene), notes=notes, ground=None)


def point_text(values: Vec3, size: float = 1.0) -> str:
    """A point of a scene of this size, or a direction, for a note."""
    return f"({', '.join(_coordinate(value, size) for value in values)})"


def _coordinate(value: float, size: float) -> str:
    """Text of a coordinate: one far below the scene's size is what rounding left of 0."""
    return f"{value if abs(value) > 1e-6 * size else 0.0:.6g}"
