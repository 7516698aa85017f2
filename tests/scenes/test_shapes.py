"""Built-in shapes: position, size, closed surface and outward orientation."""

import numpy as np
import pytest
import trimesh

from shadowbench.errors import InputError
from shadowbench.scenes.shapes import SHAPES, build_shape
from shadowbench.scenes.triangles import Triangles, bounds_of, without_zero_area

EXTENTS = {"plane": (1, 0, 1), "torus": (4 / 3, 1 / 3, 4 / 3), "capsule": (1, 2, 1)}
EXTENTS |= dict.fromkeys(("box", "sphere", "cylinder", "cone", "stairs", "terrain"), (1, 1, 1))
OPEN = ("plane", "terrain", "leaves", "foliage")


def solid(triangles: Triangles) -> trimesh.Trimesh:
    return trimesh.Trimesh(triangles.vertices, triangles.faces, process=False)


@pytest.mark.parametrize("name", EXTENTS)
def test_a_shape_is_centred_and_has_its_size(name: str) -> None:
    low, high = bounds_of(build_shape(name, {}, "test").vertices)
    assert high - low == pytest.approx(EXTENTS[name], abs=0.01)
    assert (high + low) / 2 == pytest.approx([0, 0, 0], abs=0.01)


@pytest.mark.parametrize("name", [name for name in SHAPES if name not in OPEN])
def test_a_shape_is_closed_and_faces_outward(name: str) -> None:
    body = solid(build_shape(name, {}, "test"))
    assert body.is_watertight
    assert body.is_winding_consistent
    assert body.volume > 0


@pytest.mark.parametrize("name", SHAPES)
def test_a_shape_is_welded_deterministic_and_without_zero_area(name: str) -> None:
    first, second = build_shape(name, {}, "test"), build_shape(name, {}, "test")
    assert np.array_equal(first.vertices, second.vertices)
    assert np.array_equal(first.faces, second.faces)
    assert first.faces.dtype == np.int32
    assert first.vertices.dtype == np.float64
    assert without_zero_area(first)[1] == 0
    if name != "leaves":
        assert len(np.unique(first.vertices, axis=0)) == len(first.vertices)


@pytest.mark.parametrize("name", ["plane", "terrain"])
def test_open_ground_faces_up(name: str) -> None:
    assert (solid(build_shape(name, {}, "test")).face_normals[:, 1] > 0).all()


@pytest.mark.parametrize("steps", [1, 2, 7, 40])
def test_a_flight_of_steps_fills_half_a_cube_and_half_a_step(steps: int) -> None:
    flight = solid(build_shape("stairs", {"steps": steps}, "test"))
    assert flight.is_watertight
    assert flight.volume == pytest.approx((steps + 1) / (2 * steps))


TRIMESH = {
    "sphere": lambda: trimesh.creation.icosphere(subdivisions=3, radius=0.5),
    "torus": lambda: trimesh.creation.torus(0.5, 1 / 6, major_sections=48, minor_sections=24),
    "cylinder": lambda: trimesh.creation.cylinder(radius=0.5, height=1.0, sections=48),
    "cone": lambda: trimesh.creation.cone(radius=0.5, height=1.0, sections=48),
    "capsule": lambda: trimesh.creation.capsule(height=1.0, radius=0.5, count=(24, 48)),
}


@pytest.mark.parametrize("name", TRIMESH)
def test_a_round_shape_has_the_triangles_of_trimesh_in_its_order(name: str) -> None:
    """Those of trimesh stand upright along z, and its cone on the origin."""
    made, sphere = TRIMESH[name](), name == "sphere"
    expected = made.triangles if sphere else made.triangles[..., [0, 2, 1]] * [1, 1, -1]
    expected = expected[made.area_faces > 1e-8] - [0, 0.5 if name == "cone" else 0, 0]
    shape = build_shape(name, {"subdivisions": 3} if sphere else {"sections": 48}, "test")
    np.testing.assert_allclose(shape.vertices[shape.faces], expected, rtol=0, atol=1e-15)


def test_a_sphere_rounds_with_its_subdivisions() -> None:
    for subdivisions, faces in ((0, 20), (2, 320), (5, 20_480)):
        sphere = build_shape("sphere", {"subdivisions": subdivisions}, "test")
        assert len(sphere.faces) == faces
        assert np.linalg.norm(sphere.vertices, axis=1) == pytest.approx(0.5)


def test_leaves_stay_inside_their_sphere() -> None:
    leaves = build_shape("leaves", {"count": 2000, "size": 0.2, "seed": 7}, "test")
    assert len(leaves.faces) == 4000
    assert np.linalg.norm(leaves.vertices, axis=1).max() <= 0.5 + 1e-9


def test_an_unknown_shape_lists_the_known() -> None:
    with pytest.raises(InputError, match=r"file\.toml: shape: unknown 'cubus'; allowed: plane, box, sphere"):
        build_shape("cubus", {}, "file.toml")
