"""Default ground, camera and light of a file that has none. Each assumption is a line of `Scene.notes`."""

import math
from collections.abc import Sequence
from dataclasses import replace

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
    bounds = bounds_of(np.concatenate([bounds_of(mesh.vertices) for mesh in meshes]))
    diagonal = float(np.linalg.norm(bounds[1] - bounds[0]))
    if diagonal < SMALLEST:
        raise InputError(f"{where}: all meshes together span {diagonal:.3g} m; at least {SMALLEST:.0e} m is needed")
    return bounds


def assumed_camera(bounds: Floats, where: str) -> tuple[Camera, str]:
    """A camera that shows the whole bounding sphere of (2, 3) bounds, and the note about it."""
    center, diagonal = bounds.mean(axis=0), float(np.linalg.norm(bounds[1] - bounds[0]))
    position = center + unit(VIEW_FROM) * (diagonal / 2) / math.sin(FOV_Y / 2)
    camera = Camera("camera", vec3(position), vec3(center), FOV_Y)
    pose = f"at {_text(camera.position)} looking at {_text(camera.target)}, fov_y {math.degrees(FOV_Y):.0f}°"
    return camera, f"no camera in {where}: assumed {pose}"


def assumed_sun(where: str) -> tuple[Light, str]:
    """A sun 45° above the horizon, and the note about it."""
    height = math.degrees(math.asin(-unit(SUN)[1]))
    note = f"no light in {where}: assumed a sun travelling along {_text(SUN)}, {height:.0f}° above the horizon"
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
    place = f"at y = {float(low[1]):.6g} around ({center[0]:.6g}, {center[2]:.6g})"
    shown = "which receives and casts shadows; --no-ground leaves it out"
    return ground, f"no ground in {where}: assumed a square of side {side:.6g} {place}, {shown}"


def _floor_area(meshes: Sequence[Mesh], y: float, thickness: float) -> float:
    """Area, projected on the xz plane, of the upward-facing triangles within `thickness` of the height `y`."""
    area = 0.0
    for mesh in meshes:
        corners = mesh.vertices[mesh.faces]
        low = corners[(np.abs(corners[:, :, 1] - y) <= thickness).all(axis=1)]
        ab, ac = low[:, 1] - low[:, 0], low[:, 2] - low[:, 0]
        doubled = ab[:, 2] * ac[:, 0] - ab[:, 0] * ac[:, 2]  # the y of their cross product
        area += float(np.maximum(doubled, 0.0).sum()) / 2
    return area


def with_assumptions(scene: Scene, bounds: Floats, where: str) -> Scene:
    """The scene with a default camera and light if it has none, and a note on its zero-area triangles.

    bounds: (2, 3) lowest and highest corner of the meshes.
    """
    if not scene.cameras:
        camera, note = assumed_camera(bounds, where)
        scene = replace(scene, cameras=(camera,), notes=(*scene.notes, note))
    if not scene.lights:
        light, note = assumed_sun(where)
        scene = replace(scene, lights=(light,), notes=(*scene.notes, note))
    left_out = f"{where}: {scene.dropped} zero-area triangle(s) left out"
    return replace(scene, notes=(*scene.notes, left_out)) if scene.dropped else scene


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
    ground, told = scene.ground
    none = f"{told.partition(': assumed a square')[0]}: none assumed"
    notes = tuple(none if note == told else note for note in scene.notes)
    return replace(scene, meshes=tuple(mesh for mesh in scene.meshes if mesh is not ground), notes=notes, ground=None)


def _text(values: Vec3) -> str:
    return f"({', '.join(f'{value:.6g}' for value in values)})"
