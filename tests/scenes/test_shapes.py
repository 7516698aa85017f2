"""Built-in shapes: position, size, closed surface and outward orientation."""

import numpy as np
import pytest
import trimesh

from shadowbench.scenes.shapes import SHAPES, build_shape
from shadowbench.scenes.triangles import Triangles, bounds_of, without_zero_area

EXTENTS = {"plane": (1, 0, 1), "torus": (4 / 3, 1 / 3, 4 / 3), "capsule": (1, 2, 1)}
EXTENTS |= dict.fromkeys(("box", "sphere", "cylinder", "cone", "stairs", "terrain"), (1, 1, 1))
OPEN = ("plane", "terrain", "leaves", "foliage")


def solid(triangles: Triangles) -> trimesh.Trimesh:
    return trimesh.Trimesh(triangles.vertices, triangles.faces, process=False)


def test_a_shape_is_centred_and_has_its_size() -> None:
    for name in EXTENTS:
        low, high = bounds_of(build_shape(name, {}, "test").vertices)
        assert high - low == pytest.approx(EXTENTS[name], abs=0.01)
        assert (high + low) / 2 == pytest.approx([0, 0, 0], abs=0.01)


def test_a_shape_is_closed_and_faces_outward() -> None:
    for name in [name for name in SHAPES if name not in OPEN]:
        body = solid(build_shape(name, {}, "test"))
        assert body.is_watertight
        assert body.is_winding_consistent
        assert body.volume > 0


def test_a_shape_is_welded_deterministic_and_without_zero_area() -> None:
    for name in SHAPES:
        first, second = build_shape(name, {}, "test"), build_shape(name, {}, "test")
        assert np.array_equal(first.vertices, second.vertices)
        assert np.array_equal(first.faces, second.faces)
        assert first.faces.dtype == np.int32
        assert first.vertices.dtype == np.float64
        assert without_zero_area(first)[1] == 0
        if name != "leaves":
            assert len(np.unique(first.vertices, axis=0)) == len(first.vertices)


def test_a_flight_of_steps_fills_half_a_cube_and_half_a_step() -> None:
    for steps in (1, 2, 7, 40):
        flight = solid(build_shape("stairs", {"steps": steps}, "test"))
        assert flight.is_watertight
        assert flight.volume == pytest.approx((steps + 1) / (2 * steps))
