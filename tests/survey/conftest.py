"""Scenes with known needs: plates and boxes over a ground, seen from above or from a side."""

import math
from collections.abc import Sequence

import numpy as np
import pytest
import trimesh

from shadowbench.scenes.model import Light, Mesh, View
from shadowbench.scenes.vectors import Vec3
from shadowbench.survey.survey import explanations_of, needs
from tests.drawing import view_at as looking

DOWN = Light("sun", "directional", (0.0, -1.0, 0.0))
SUN = Light("sun", "directional", (0.5, -1.0, -0.3))
LIGHTS = (
    SUN,
    Light("spot", "spot", (-0.5, -1.0, 0.2), (2.0, 4.0, -0.8), math.radians(70.0)),
    Light("lamp", "point", position=(1.5, 3.0, -1.0)),
)


@pytest.fixture(params=LIGHTS, ids=lambda light: light.kind)
def light(request: pytest.FixtureRequest) -> Light:
    chosen: Light = request.param
    return chosen


def plate(side: float, center: Vec3 = (0.0, 0.0, 0.0), **flags: bool) -> Mesh:
    """A horizontal square, facing up."""
    corners = np.array([[-1, 0, 1], [1, 0, 1], [1, 0, -1], [-1, 0, -1]]) * side / 2 + center
    return Mesh("plate", corners, np.array([[0, 1, 2], [0, 2, 3]], dtype=np.int32), **flags)


def box(side: float, center: Vec3 = (0.0, 0.0, 0.0), inside_out: bool = False) -> Mesh:
    made = trimesh.creation.box([side] * 3)
    faces = np.asarray(made.faces, dtype=np.int32)
    return Mesh("box", made.vertices + center, faces[:, ::-1].copy() if inside_out else faces)


def ball(subdivisions: int, radius: float = 1.0) -> Mesh:
    made = trimesh.creation.icosphere(subdivisions)
    return Mesh("ball", made.vertices * radius, np.asarray(made.faces, dtype=np.int32))


def from_above(meshes: Sequence[Mesh], light: Light = DOWN, size: int = 64, width: float = 2.0) -> View:
    """A view from above, this many metres wide at y = 0, from five times that height."""
    return looking(meshes, light, size, (0.0, 5 * width, 0.0), fov=math.degrees(2 * math.atan(0.1)))


def tilted(elevation: float) -> Light:
    """A sun at an elevation in degrees."""
    angle = math.radians(elevation)
    return Light("sun", "directional", (math.cos(angle), -math.sin(angle), 0.0))


def reasons(view: View) -> dict[str, str]:
    """The reasons of a view's needs, by need."""
    return {row.need: row.reason for row in explanations_of(needs(view, penumbrae=False))}
