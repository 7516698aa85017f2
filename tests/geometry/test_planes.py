"""Detection of planar receivers: coplanar and large, at any position and scale of the scene."""

from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from shadowbench.geometry.planes import Plane, find_planes
from shadowbench.scenes.library import load_scene
from shadowbench.scenes.model import Mesh, Scene
from shadowbench.techniques.planar_projection import PlanarProjection


def planes_of(*meshes: Mesh, least: float = 0.01, most: int = 32, tolerance: float = 5e-7) -> tuple[Plane, ...]:
    return find_planes(Scene("test", meshes, (), ()).geometry, least, most, tolerance)


def grid(cells: int, height, size: float = 4.0) -> Mesh:
    """A square of cells² · 2 triangles whose height is a function of x and z."""
    x, z = (part.ravel() for part in np.meshgrid(*[np.linspace(-size / 2, size / 2, cells + 1)] * 2, indexing="ij"))
    first = (np.arange(cells)[:, None] * (cells + 1) + np.arange(cells)).ravel()
    corners = [first, first + 1, first + cells + 1, first + 1, first + cells + 2, first + cells + 1]
    y = np.broadcast_to(height(x, z), x.shape)
    return Mesh("grid", np.column_stack([x, y, z]), np.stack(corners, axis=1).reshape(-1, 3).astype(np.int32))


def flat(x, z):
    return np.zeros_like(x)


def turned(mesh: Mesh, rotation=((1, 0, 0), (0, 1, 0), (0, 0, 1)), scale=1.0, shift=(0.0, 0.0, 0.0)) -> Mesh:
    return Mesh(mesh.name, mesh.vertices @ np.asarray(rotation).T * scale + shift, mesh.faces)


def rotation(quaternion) -> np.ndarray:
    w, x, y, z = np.asarray(quaternion) / np.linalg.norm(quaternion)
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + 2 * w * cross + 2 * cross @ cross


def test_a_box_on_a_ground_has_six_planes_and_its_bottom_lies_on_the_grounds(shape) -> None:
    planes = planes_of(shape("plane", 8.0), shape("box", 1.0, (0.0, 0.5, 0.0)))
    assert [len(plane.triangles) for plane in planes] == [4, 2, 2, 2, 2, 2]
    assert planes[0].share == pytest.approx(65 / 70) and planes[1].share == pytest.approx(1 / 70)
    assert sum(plane.share for plane in planes) == pytest.approx(1.0)
    assert set(planes[0].triangles) > {0, 1}
    np.testing.assert_allclose(np.abs(planes[0].equation), [0, 1, 0, 0], atol=1e-12)


def test_equations_hold_on_their_triangles_and_nowhere_else(shape) -> None:
    turn = rotation([0.3, -0.5, 0.7, 0.2])
    meshes = [turned(mesh, turn, 3.0, (50.0, -20.0, 7.0)) for mesh in (shape("plane", 8.0), shape("stairs", 2.0))]
    geometry = Scene("test", tuple(meshes), (), ()).geometry
    planes = planes_of(*meshes, least=0.001)
    assert len(planes) == 16, "of the stairs, one of whose treads lies in the ground"
    for plane in planes:
        height = geometry.vertices @ plane.equation[:3] + plane.equation[3]
        assert np.linalg.norm(plane.equation[:3]) == pytest.approx(1.0)
        on = (np.abs(height) < 1e-9)[geometry.faces].all(axis=1)
        assert np.array_equal(np.flatnonzero(on), plane.triangles)


def test_coplanar_pieces_are_one_plane_connected_or_not_and_of_either_winding(shape) -> None:
    left, right = shape("plane", 1.0, (-3.0, 0.7, 0.0)), shape("plane", 1.0, (3.0, 0.7, 0.0))
    flipped = Mesh("flipped", right.vertices, right.faces[:, ::-1].copy())
    for other in (right, flipped):
        (plane,) = planes_of(left, other)
        assert list(plane.triangles) == [0, 1, 2, 3] and plane.share == pytest.approx(1.0)
    assert len(planes_of(left, turned(right, shift=(0.0, 1e-4, 0.0)))) == 2


@pytest.mark.parametrize(("bend", "count"), [(1e-7, 1), (1e-4, 2)])
def test_a_ridge_is_two_planes_unless_it_is_within_the_tolerance(bend, count) -> None:
    planes = planes_of(grid(16, lambda x, z: -bend * np.abs(x)), least=0.2)
    assert len(planes) == count
    assert sum(plane.share for plane in planes) == pytest.approx(1.0)


def test_curved_surfaces_are_no_planes() -> None:
    assert planes_of(*load_scene("terrain").meshes, least=0.001) == ()
    assert planes_of(grid(64, lambda x, z: 0.002 * x * x), least=0.04) == ()


def test_a_stack_of_sheets_does_not_hide_the_ground_below_it() -> None:
    """There are more sheets than the maximum number of planes, with far more area than the ground in one cell."""
    sheets = [turned(grid(1, flat, 1.0), shift=(0.0, 0.5 + 1e-4 * k, 0.0)) for k in range(400)]
    planes = planes_of(grid(2, flat, 5.0), *sheets, least=0.0005)
    assert list(planes[0].triangles) == list(range(8)) and len(planes) == 32


@cache
def scene_with_planes(name: str) -> tuple[tuple[Mesh, ...], set[tuple[int, ...]]]:
    """The meshes of a built-in scene, and the triangles of each plane."""
    meshes = load_scene(name).meshes
    return meshes, {tuple(plane.triangles) for plane in planes_of(*meshes, least=0.0008)}


units = st.floats(-1.0, 1.0, allow_nan=False)


@settings(max_examples=40, deadline=None)
@given(
    quaternion=st.tuples(units, units, units, units).filter(lambda q: np.linalg.norm(q) > 0.1),
    exponent=st.floats(-6.0, 6.0),
    shift=st.tuples(units, units, units),
    far=st.sampled_from([0.0, 1.0, 1e3, 1e5]),
)
@pytest.mark.parametrize("name", ["table-top", "stairs"])
def test_a_moved_turned_and_scaled_scene_has_the_same_planes(name, quaternion, exponent, shift, far) -> None:
    meshes, planes = scene_with_planes(name)
    turn, scale = rotation(quaternion), 10.0**exponent
    moved = [turned(mesh, turn, scale, np.multiply(shift, far * scale)) for mesh in meshes]
    assert {tuple(plane.triangles) for plane in planes_of(*moved, least=0.0008)} == planes


SMALL = {
    "ball": (10.0, "sphere", 0.02, (0.5, 0.01, 0.5)),
    "fine ball": (10.0, "sphere", 1.0, (0.5, 0.5, 0.5)),
    **{f"decal at {height}": (10.0, "plane", 0.5, (2.0, height, 1.0)) for height in (2e-5, 5e-5, 7e-5, 1e-4)},
    "marking": (100.0, "plane", [0.3, 1.0, 60.0], (2.0, 3e-4, 1.0)),
}


def test_nearby_triangles_do_not_hide_a_plane(shape) -> None:
    for small in SMALL:
        for tolerance in (5e-7, 1e-5):
            size, kind, scale, place = SMALL[small]
            fine = {"subdivisions": 6} if small == "fine ball" else {}
            meshes = shape("plane", size), shape("box", 1.0, (-1.0, 0.5, 0.0)), shape(kind, scale, place, **fine)
            ground = planes_of(*meshes, least=0.0005, tolerance=tolerance)[0]
            assert set(ground.triangles) > {0, 1}
            assert ground.thickness <= tolerance * np.linalg.norm([size, 1.0, size]) * 1.01


def tilted(cells: int, size: float = 10.0, low: float = 0.0, axis=(0.5, 0.15, 0.35), degrees: float = 3.0) -> Mesh:
    half = np.radians(degrees) / 2
    turn = rotation([np.cos(half), *(np.sin(half) * np.asarray(axis) / np.linalg.norm(axis))])
    return turned(grid(cells, lambda x, z: 0.0 * x, size), turn, shift=(low, low, low))


def written(mesh: Mesh, form: str) -> Mesh:
    """A mesh with coordinates rounded as in a text file."""
    values = [float(format(value, form)) for value in mesh.vertices.ravel()]
    return Mesh(mesh.name, np.reshape(values, (-1, 3)), mesh.faces)


def test_the_default_tolerance_holds_what_exporters_write() -> None:
    for form in (".5f", ".4f", ".6g"):
        for cells in (1, 16, 64, 128):
            tolerance = PlanarProjection.Params().tolerance
            for mesh in (tilted(cells), tilted(cells, degrees=30.0), tilted(cells, low=5.0, degrees=30.0)):
                (plane,) = planes_of(written(mesh, form), least=0.0005, tolerance=tolerance)
                assert plane.share == pytest.approx(1.0)
                height = mesh.vertices @ plane.equation[:3] + plane.equation[3]
                assert max(np.abs(height).max(), plane.thickness) < 0.5e-4 * 3**0.5, "half of the last digit of each"
