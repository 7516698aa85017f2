"""What each array of a truth says, on scenes where it is known."""

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from scipy.ndimage import maximum_filter, minimum_filter

from shadowbench.errors import InputError
from shadowbench.scenes.model import Floats, Light, Mesh, View
from shadowbench.truth.trace import Truth, trace

Shape = Callable[..., Mesh]
Looking = Callable[..., View]
PixelRays = Callable[[View], tuple[Floats, Floats]]

SUN = Light("sun", "directional", (0.5, -1.0, -0.3))
SPOT = Light("spot", "spot", (-0.5, -1.0, 0.2), (2.0, 4.0, -0.8), math.radians(60.0))
LAMP = Light("lamp", "point", position=(1.5, 3.0, -1.0))
LIGHTS = pytest.mark.parametrize("light", [SUN, SPOT, LAMP], ids=lambda light: light.kind)


def on_ground(view: View, pixel_rays: PixelRays) -> Floats:
    """(size, size, 3) where pixels' rays meet y = 0."""
    eye, directions = pixel_rays(view)
    return (eye - directions * (eye[1] / directions[:, 1:2])).reshape(view.size, view.size, 3)


def toward(light: Light, points: Floats) -> tuple[Floats, Floats]:
    """Unit vectors from points to the light, and the distances."""
    position, w = light.homogeneous
    ways = position - w * points
    lengths = np.linalg.norm(ways, axis=-1)
    return ways / lengths[..., None], lengths


def test_shapes_and_types(shape: Shape, looking: Looking) -> None:
    truth = trace(looking([shape("plane", 8.0), shape("box", at=(0, 0.5, 0))], SUN, size=48))
    types = {
        "visibility": np.float32,
        "receivers": np.bool_,
        "undecided": np.bool_,
        "area": np.float32,
        "blocker": np.float32,
        "triangle": np.int32,
        "cosine": np.float32,
    }
    arrays = truth.arrays()
    assert arrays.keys() == {*types, "diagonal"}
    assert {name: arrays[name].dtype for name in types} == types
    assert all(arrays[name].shape == (48, 48) for name in types)
    assert set(np.unique(truth.visibility)) == {0.0, 1.0}


def test_tracing_again_gives_the_same_bits(shape: Shape, looking: Looking) -> None:
    view = looking([shape("plane", 8.0), shape("sphere", at=(0, 0.5, 0))], LAMP, size=48)
    first, second = trace(view).arrays(), trace(view).arrays()
    assert all(np.array_equal(first[name], second[name]) for name in first)


@LIGHTS
def test_outside_receivers_nothing_is_in_shadow(light: Light, shape: Shape, looking: Looking) -> None:
    truth = trace(looking([shape("plane", 3.0), shape("box", at=(0, 0.5, 0))], light, size=96))
    outside = ~truth.receivers
    assert (truth.triangle[outside] >= 0).any()
    assert (truth.triangle[outside] < 0).any()
    assert (truth.visibility[outside] == 1).all()
    assert (truth.area[outside] == 1).all()
    assert np.isinf(truth.blocker[outside]).all()
    assert (truth.cosine[outside] == 0).all()
    assert (truth.cosine[truth.receivers] > 0).all()


# area


def test_area_is_visibility_where_no_edge_is_near(shape: Shape, looking: Looking) -> None:
    truth = trace(looking([shape("plane", 8.0), shape("box", at=(0, 0.5, 0))], SUN, size=128))
    code = truth.receivers + 2 * truth.visibility
    flat = maximum_filter(code, 3) == minimum_filter(code, 3)
    assert flat.mean() > 0.8
    assert (truth.area == truth.visibility)[flat].all()
    assert ((truth.area > 0) & (truth.area < 1)).any()


@pytest.mark.parametrize("samples", [4, 8])
def test_area_of_a_straight_edge_is_its_coverage(
    samples: int, shape: Shape, looking: Looking, pixel_rays: PixelRays
) -> None:
    """A row of an n × n grid misjudges a straight edge by half a sample at most."""
    plate = shape("plane", (20.0, 1.0, 10.0), (0.0, 2.0, 5.0))  # its edge over z = 0 casts one straight shadow
    view = looking([shape("plane", 40.0), plate], SUN, eye=(0.3, 1.2, 1.6), target=(0.9, 0.0, -0.6))
    truth = trace(view, pixel_samples=samples)
    fine = 32
    points = on_ground(replace(view, size=view.size * fine), pixel_rays)
    crossing = points + (2.0 / -SUN.direction[1]) * -np.asarray(SUN.direction)
    lit = (crossing[..., 2] < 0).reshape(view.size, fine, view.size, fine).mean(axis=(1, 3))
    at_edge = (lit > 0) & (lit < 1)
    assert at_edge.sum() > view.size / 2
    assert truth.receivers.all()
    error = truth.area - lit
    assert np.abs(error).max() <= 0.5 / samples + 0.5 / fine
    assert np.abs(error[at_edge].mean()) < 0.02
    assert np.abs(error[~at_edge]).max() == 0


def test_area_counts_only_samples_that_hit_receivers(shape: Shape, looking: Looking) -> None:
    """At the rim of a lit ground before nothing, all samples that are receivers are lit."""
    truth = trace(looking([shape("plane", 2.0)], SUN, size=96))
    assert (truth.triangle < 0).any()
    assert (truth.area == 1).all()


# blocker


@LIGHTS
def test_blocker_is_the_way_to_a_plate(light: Light, shape: Shape, looking: Looking, pixel_rays: PixelRays) -> None:
    height = 0.8
    view = looking([shape("plane", 8.0), shape("plane", 1.0, (0.0, height, 0.0))], light, size=96)
    truth = trace(view)
    ways, distances = toward(light, on_ground(view, pixel_rays))
    ground = (truth.triangle >= 0) & (truth.triangle < 2)
    shadowed = ground & (truth.visibility == 0)
    assert shadowed.sum() > 50
    expected = np.broadcast_to(height / ways[..., 1], shadowed.shape)[shadowed]
    assert (expected < np.broadcast_to(distances, shadowed.shape)[shadowed]).all()
    assert truth.blocker[shadowed] == pytest.approx(expected, rel=1e-5)
    assert np.isinf(truth.blocker[truth.visibility == 1]).all()


@LIGHTS
def test_blocker_is_the_way_to_the_near_side_of_a_box(
    light: Light, shape: Shape, looking: Looking, pixel_rays: PixelRays
) -> None:
    """The first crossing of six planes, seen from outside: the entry of the slab test."""
    box = shape("box", (1.0, 0.4, 1.2), (0.0, 0.9, 0.1))
    view = looking([shape("plane", 8.0), box], light, size=96)
    truth = trace(view)
    points = on_ground(view, pixel_rays)
    ways = np.broadcast_to(toward(light, points)[0], points.shape)
    shadowed = (truth.triangle >= 0) & (truth.triangle < 2) & (truth.visibility == 0) & ~truth.undecided
    low, high = box.vertices.min(axis=0), box.vertices.max(axis=0)
    crossings = np.stack([(low - points) / ways, (high - points) / ways])[:, shadowed]
    entry = crossings.min(axis=0).max(axis=1)
    assert len(entry) > 50
    assert truth.blocker[shadowed] == pytest.approx(entry, rel=1e-4)


# receivers


@LIGHTS
def test_receivers_face_the_light(light: Light, shape: Shape, looking: Looking) -> None:
    view = looking([shape("plane", 3.0), shape("box", at=(0, 0.5, 0))], light, size=96)
    truth = trace(view)
    hit = truth.triangle >= 0
    assert (truth.receivers & ~hit).sum() == 0
    faces = view.scene.geometry.normals[truth.triangle[hit]]  # all wound outward, and seen from outside
    if light.kind == "directional":
        facing = faces @ np.asarray(light.direction) < 0
        assert (truth.receivers[hit] == facing).all()
        assert truth.cosine[hit][facing] == pytest.approx((faces @ toward(light, np.zeros(3))[0])[facing], rel=1e-6)
    away = {(0.0, 0.0, 1.0)}
    seen = {tuple(face) for face in np.round(faces, 6) + 0.0}
    assert away <= seen
    if light.kind != "spot":
        assert not truth.receivers[hit][np.isclose(faces, (0.0, 0.0, 1.0)).all(axis=1)].any() or light is SUN


def test_receivers_lie_inside_a_spots_cone(shape: Shape, looking: Looking, pixel_rays: PixelRays) -> None:
    spot = Light("spot", "spot", (-0.5, -1.0, 0.2), (1.0, 2.0, -0.4), math.radians(40.0))
    view = looking([shape("plane", 8.0)], spot, size=256)
    truth = trace(view)
    ways = toward(spot, on_ground(view, pixel_rays))[0]
    axis = np.asarray(spot.direction) / np.linalg.norm(spot.direction)
    inside = (-ways @ axis >= math.cos(math.radians(20.0))) & (truth.triangle >= 0)
    assert 0.02 < inside.mean() < 0.9
    assert (truth.receivers == inside)[~truth.undecided].all()
    assert (truth.receivers != inside).sum() == 0


def test_ground_seen_from_below_is_no_receiver_of_a_light_above(shape: Shape, looking: Looking) -> None:
    truth = trace(looking([shape("plane", 8.0)], SUN, eye=(1.0, -3.0, 2.0)))
    assert (truth.triangle >= 0).any()
    assert not truth.receivers.any()


def test_ground_wound_downward_is_a_receiver_all_the_same(shape: Shape, looking: Looking) -> None:
    ground = shape("plane", 8.0)
    truth = trace(looking([replace(ground, faces=np.ascontiguousarray(ground.faces[:, ::-1]))], SUN))
    assert (truth.receivers == (truth.triangle >= 0)).all()


def test_mesh_that_does_not_receive_has_no_receivers(shape: Shape, looking: Looking) -> None:
    box = shape("box", at=(0, 0.5, 0))
    view = looking([shape("plane", 8.0, receives=False), box], SUN, size=96)
    truth = trace(view)
    ground = (truth.triangle == 0) | (truth.triangle == 1)
    assert ground.any()
    assert not truth.receivers[ground].any()
    assert truth.receivers[~ground].any()


@LIGHTS
def test_mesh_that_does_not_cast_casts_nothing(light: Light, shape: Shape, looking: Looking) -> None:
    ground, box = shape("plane", 8.0), shape("box", at=(0, 1.0, 0))
    casting = trace(looking([ground, box], light, size=96))
    silent = trace(looking([ground, replace(box, casts=False)], light, size=96))
    assert (casting.visibility == 0).any()
    assert (silent.visibility == 1).all()
    assert np.isinf(silent.blocker).all()
    assert (silent.triangle == casting.triangle).all()
    nothing_casts = [replace(mesh, casts=False) for mesh in (ground, box)]
    assert (trace(looking(nothing_casts, light, size=96)).visibility == 1).all()


# triangle, diagonal


def test_triangles_are_counted_over_meshes_in_file_order(shape: Shape, looking: Looking) -> None:
    ground, box, sphere = shape("plane", 3.0), shape("box", at=(-0.8, 0.5, 0)), shape("sphere", at=(0.8, 0.5, 0))
    view = looking([ground, box, sphere], SUN, size=128)
    truth = trace(view)
    ends = np.cumsum([len(mesh.faces) for mesh in view.scene.meshes])
    mesh_of = np.searchsorted(ends, truth.triangle, side="right")
    assert set(np.unique(mesh_of)) == {0, 1, 2}
    assert truth.triangle.min() == -1
    half = view.size // 2
    assert (mesh_of[:, :half] == 2).sum() < (mesh_of[:, half:] == 2).sum()  # the sphere stands on the right
    assert (mesh_of[:, :half] == 1).sum() > (mesh_of[:, half:] == 1).sum()


def test_triangle_is_the_one_that_the_ray_meets_first(
    shape: Shape, looking: Looking, pixel_rays: PixelRays
) -> None:
    view = looking([shape("plane", 8.0)], SUN, size=96)
    truth = trace(view)
    points = on_ground(view, pixel_rays)
    inside = (np.abs(points[..., [0, 2]]) < 4).all(axis=-1)
    first = np.where(points[..., 0] > -points[..., 2], 0, 1)  # split from (−, +) to (+, −); the first holds (+, +)
    assert (truth.triangle == np.where(inside, first, -1))[~truth.undecided].mean() > 0.999


def test_diagonal_is_of_casters_and_visible_receivers(shape: Shape, looking: Looking) -> None:
    ground, box = shape("plane", 1000.0, casts=False), shape("box", at=(0, 0.5, 0))
    seen = trace(looking([ground, box], SUN, target=(0.0, -1.0, 0.0), fov=30.0)).diagonal
    assert seen < 20
    assert trace(looking([replace(ground, casts=True), box], SUN)).diagonal == pytest.approx(1000 * math.sqrt(2))


# unusual views


def test_camera_inside_a_mesh(shape: Shape, looking: Looking) -> None:
    lamp = Light("lamp", "point", position=(0.3, 0.2, -0.1))
    truth = trace(looking([shape("box", 2.0)], lamp, eye=(0.5, 0.4, 0.6)))
    assert truth.receivers.all()
    assert (truth.visibility == 1).all()
    dark = trace(looking([shape("box", 2.0)], SUN, eye=(0.5, 0.4, 0.6)))
    assert (dark.visibility == 0)[dark.receivers].all()
    assert dark.receivers.any()


def test_light_along_up(shape: Shape, looking: Looking, pixel_rays: PixelRays) -> None:
    """The shadow of a box under the zenith is its footprint."""
    noon = Light("sun", "directional", (0.0, -1.0, 0.0))
    view = looking([shape("plane", 8.0), shape("box", at=(0, 1.5, 0))], noon, size=128)
    truth = trace(view)
    ground = (truth.triangle == 0) | (truth.triangle == 1)
    under = (np.abs(on_ground(view, pixel_rays)[..., [0, 2]]) < 0.5).all(axis=-1)
    decided = ground & ~truth.undecided
    assert (under & decided).any()
    assert ((truth.visibility == 0) == under)[decided].all()


def test_camera_looking_along_up(shape: Shape, looking: Looking) -> None:
    above = trace(looking([shape("plane", 8.0), shape("box", at=(0, 0.5, 0))], SUN, eye=(0.0, 6.0, 0.0)))
    assert above.receivers.any()
    assert (above.visibility == 0).any()


@LIGHTS
def test_ground_alone_is_lit(light: Light, shape: Shape, looking: Looking) -> None:
    truth = trace(looking([shape("plane", 8.0)], light))
    assert truth.receivers.any()
    assert (truth.visibility == 1).all()
    assert (truth.area == 1).all()
    assert np.isinf(truth.blocker).all()


def test_camera_looking_at_nothing_is_refused(shape: Shape, looking: Looking) -> None:
    with pytest.raises(InputError, match="looks at nothing"):
        trace(looking([shape("plane", 8.0)], SUN, target=(2.3, 9.0, 3.5)))


@pytest.mark.parametrize("samples", [(0, 1), (4, 0), (-1, 1)])
def test_no_samples_are_refused(samples: tuple[int, int], shape: Shape, looking: Looking) -> None:
    with pytest.raises(InputError, match="1 and more"):
        trace(looking([shape("plane", 8.0)], SUN), *samples)


@pytest.mark.parametrize("size", [1, 7, 65])
def test_any_size_is_traced(size: int, shape: Shape, looking: Looking) -> None:
    truth = trace(looking([shape("plane", 8.0)], SUN, size=size))
    assert truth.visibility.shape == (size, size)
    assert truth.receivers[size // 2, size // 2]


def between_planes(shape: Shape, looking: Looking, **planes: float) -> Truth:
    """A plate at depth 2 and the ground at depth 5, seen from above through it."""
    plate = shape("plane", 1.0, (0.0, 3.0, 0.0))
    return trace(looking([shape("plane", 8.0), plate], SUN, eye=(0.0, 5.0, 0.0), size=65, **planes))


def test_mesh_before_near_is_not_seen_but_casts(shape: Shape, looking: Looking) -> None:
    assert between_planes(shape, looking).triangle[32, 32] >= 2
    cut = between_planes(shape, looking, near=2.5)
    assert cut.triangle.max() < 2
    assert cut.triangle[32, 32] >= 0
    assert (cut.visibility == 0).any()


def test_mesh_beyond_far_is_not_seen(shape: Shape, looking: Looking) -> None:
    cut = between_planes(shape, looking, far=4.0)
    assert cut.triangle[32, 32] >= 2
    assert (cut.triangle[0] == -1).all()
    assert not cut.receivers[0].any()
