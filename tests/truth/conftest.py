"""Small scenes made in a line, and how they are viewed."""

import math
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
import pytest

from shadowbench.scenes.model import Camera, Floats, Light, Mesh, Scene, View, view_of
from shadowbench.scenes.shapes import build_shape

Place = tuple[float, float, float]


@pytest.fixture(scope="session")
def shape() -> Callable[..., Mesh]:
    """A named shape, scaled, then moved."""

    def make(
        kind: str,
        scale: float | Sequence[float] = 1.0,
        at: Sequence[float] = (0.0, 0.0, 0.0),
        casts: bool = True,
        receives: bool = True,
        **parameters: int,
    ) -> Mesh:
        triangles = build_shape(kind, parameters, "test")
        vertices = triangles.vertices * np.asarray(scale, dtype=np.float64) + np.asarray(at, dtype=np.float64)
        return Mesh(kind, vertices, triangles.faces, casts=casts, receives=receives)

    return make


@pytest.fixture(scope="session")
def looking() -> Callable[..., View]:
    """A view of some meshes; fov in degrees."""

    def make(
        meshes: Sequence[Mesh],
        light: Light,
        size: int = 64,
        eye: Place = (2.3, 4.0, 3.4),
        target: Place = (0.0, 0.0, 0.0),
        fov: float = 50.0,
        near: float | None = None,
        far: float | None = None,
    ) -> View:
        camera = Camera("camera", eye, target, math.radians(fov), near=near, far=far)
        return view_of(Scene("test", tuple(meshes), (camera,), (light,)), camera, light, size)

    return make


@pytest.fixture(scope="session")
def pixel_rays() -> Callable[..., tuple[Floats, Floats]]:
    """The eye, and (size², 3) directions through pixel centres, worked out anew from the camera's definition."""

    def make(view: View) -> tuple[Floats, Floats]:
        eye, target = np.asarray(view.camera.position), np.asarray(view.camera.target)
        ahead = (target - eye) / np.linalg.norm(target - eye)
        right = np.cross(ahead, view.camera.up)
        if np.linalg.norm(right) < 1e-6:
            raise ValueError("a test's camera does not look along its up")
        right /= np.linalg.norm(right)
        above = np.cross(right, ahead)
        steps = (np.arange(view.size) + 0.5) / view.size * 2 - 1
        half = math.tan(view.camera.fov_y / 2)
        down, across = np.meshgrid(steps, steps, indexing="ij")
        directions = ahead + half * (across[..., None] * right - down[..., None] * above)
        return eye, directions.reshape(-1, 3)

    return make


@pytest.fixture(scope="session")
def lowered() -> Callable[[View, float], View]:
    """The view with its directional light's elevation, in degrees, changed and its azimuth kept."""

    def make(view: View, elevation: float) -> View:
        x, _, z = view.light.direction
        along = math.cos(math.radians(elevation)) / math.hypot(x, z)
        light = replace(view.light, direction=(x * along, -math.sin(math.radians(elevation)), z * along))
        return replace(view, light=light)

    return make
