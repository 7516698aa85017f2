"""Hard truths: which pixels are receivers, which meshes cast, the values of the arrays, and views at extremes."""

import math
from dataclasses import replace

import numpy as np
import pytest

from shadowbench.errors import InputError
from shadowbench.scenes.model import Light
from shadowbench.truths.trace import trace


def test_cosine_is_of_the_angle_between_normal_and_light(sun, shape, looking, on_ground, toward) -> None:
    view = looking([shape("plane", 8.0)], sun, size=96)
    truth = trace(view)
    ways = np.broadcast_to(toward(sun, on_ground(view)), (96, 96, 3))
    assert truth.cosine[truth.receivers] == pytest.approx(ways[truth.receivers][:, 1], rel=1e-6)


def test_winding_does_not_decide_what_a_receiver_is(shape, looking, sun) -> None:
    ground = shape("plane", 8.0)
    for faces in (ground.faces, np.ascontiguousarray(ground.faces[:, ::-1])):
        above, below = (trace(looking([replace(ground, faces=faces)], sun, eye=(1.0, y, 2.0))) for y in (3.0, -3.0))
        assert (above.receivers == (above.triangle >= 0)).all()
        assert (below.triangle >= 0).any() and not below.receivers.any()


def test_mesh_that_does_not_receive_or_cast_is_seen_and_no_more(sun, shape, looking) -> None:
    ground, box = shape("plane", 8.0), shape("box", at=(0, 1.0, 0))
    casting = trace(looking([ground, box], sun))
    silent = trace(looking([replace(ground, receives=False), replace(box, casts=False)], sun))
    assert (casting.visibility == 0).any() and (silent.visibility == 1).all() and np.isinf(silent.blocker).all()
    assert (silent.triangle == casting.triangle).all()
    on_ground = (silent.triangle >= 0) & (silent.triangle < 2)
    assert not silent.receivers[on_ground].any() and silent.receivers[~on_ground].any()
    nothing_casts = [replace(mesh, casts=False) for mesh in (ground, box)]
    assert (trace(looking(nothing_casts, sun)).visibility == 1).all()


def test_sky_is_no_part_of_the_scene_s_size(shape, looking, sun) -> None:
    ground, box = shape("plane", 8.0), shape("box", at=(0, 0.5, 0))
    sky = shape("sphere", 100.0, casts=False, receives=False)
    views = [looking(meshes, sun, target=(0.0, 3.5, 0.0)) for meshes in ([ground, box], [ground, box, sky])]
    alone, under = (trace(view) for view in views)
    assert (under.triangle >= 0).all() and not (alone.triangle >= 0).all()
    assert under.diagonal == pytest.approx(alone.diagonal, rel=1e-9)


def test_what_a_lamp_on_a_plate_lights_is_undecided(shape, looking) -> None:
    """On either side of the plate, however it is turned: rounding alone decides."""
    axis = np.array([0.48, 0.6, 0.64])
    turn = 2 * np.outer(axis, axis) - np.eye(3)
    plate = shape("plane", 1.0)
    for x, z in ((0.0, 0.0), (0.2, 0.1), (-0.3, 0.4)):
        turned = replace(plate, vertices=plate.vertices @ turn + [0.0, 1.0, 0.0])
        at = np.array([x, 0.0, z]) @ turn + [0.0, 1.0, 0.0]
        truth = trace(looking([shape("plane", 8.0), turned], Light("lamp", "point", position=tuple(at))))
        assert (truth.undecided[truth.receivers]).mean() > 0.99


def test_one_receiver_is_as_good_as_many(sun, shape, looking) -> None:
    """Two pixels see the ground at their centres, and only one of them does at its lower samples."""
    ground = shape("plane", 8.0, (4.0, 0.0, -3.7))
    truth = trace(looking([ground], sun, 2, (0.0, 1.0, 0.0), (0.0, 0.0, -1e-4), math.degrees(2 * math.atan(0.5))))
    assert (truth.receivers == [[False, True], [False, True]]).all()
    assert (truth.visibility == 1).all() and (truth.area == 1).all()


def test_outside_receivers_nothing_is_in_shadow_and_no_sample_counts(sun, shape, looking) -> None:
    assert (trace(looking([shape("plane", 2.0)], sun, size=96)).area == 1).all()  # also at the rim of a lit ground
    truth = trace(looking([shape("plane", 3.0), shape("box", at=(0, 0.5, 0))], sun, size=96))
    outside = ~truth.receivers
    assert (truth.triangle[outside] >= 0).any() and (truth.triangle[outside] < 0).any()
    assert (truth.visibility[outside] == 1).all() and (truth.area[outside] == 1).all()
    assert np.isinf(truth.blocker[outside]).all() and (truth.cosine[outside] == 0).all()
    assert (truth.cosine[truth.receivers] > 0).all()


def test_area_of_a_straight_edge_is_its_coverage(shape, looking, on_ground, sun) -> None:
    """A row of an n × n grid misjudges a straight edge by half a sample at most."""
    plate = shape("plane", (20.0, 1.0, 10.0), (0.0, 2.0, 5.0))  # its edge over z = 0 casts one straight shadow
    view = looking([shape("plane", 40.0), plate], sun, eye=(0.3, 1.5, 0.3), target=(0.6, 0.0, -0.6))
    truth = trace(view, pixel_samples=4)
    fine = 32
    points = on_ground(replace(view, size=view.size.times(fine)))
    crossing = points + (2.0 / -sun.direction[1]) * -np.asarray(sun.direction)
    size = view.size.height
    lit = (crossing[..., 2] < 0).reshape(size, fine, size, fine).mean(axis=(1, 3))
    at_edge = (lit > 0) & (lit < 1)
    assert at_edge.sum() > size / 2
    assert truth.receivers.all()
    error = truth.area - lit
    assert np.abs(error).max() <= 0.5 / 4 + 0.5 / fine
    assert np.abs(error[at_edge].mean()) < 0.02
    assert np.abs(error[~at_edge]).max() == 0


def test_blocker_is_the_distance_to_the_near_side_of_a_box(light, shape, looking, on_ground, toward) -> None:
    """The first crossing of six planes, seen from outside: the entry of the slab test."""
    box = shape("box", (1.0, 0.4, 1.2), (0.0, 0.9, 0.1))
    view = looking([shape("plane", 8.0), box], light, size=96)
    truth = trace(view)
    points = on_ground(view)
    ways = np.broadcast_to(toward(light, points), points.shape)
    shadowed = (truth.triangle >= 0) & (truth.triangle < 2) & (truth.visibility == 0) & ~truth.undecided
    low, high = box.vertices.min(axis=0), box.vertices.max(axis=0)
    crossings = np.stack([(low - points) / ways, (high - points) / ways])[:, shadowed]
    entry = crossings.min(axis=0).max(axis=1)
    assert len(entry) > 50
    assert truth.blocker[shadowed] == pytest.approx(entry, rel=1e-4)
    assert np.isinf(truth.blocker[truth.visibility == 1]).all()


def test_diagonal_is_of_casters_and_visible_receivers(shape, looking, sun) -> None:
    ground, box = shape("plane", 1000.0, casts=False), shape("box", at=(0, 0.5, 0))
    seen = trace(looking([ground, box], sun, target=(0.0, -1.0, 0.0), fov=30.0)).diagonal
    assert seen < 20
    assert trace(looking([replace(ground, casts=True), box], sun)).diagonal == pytest.approx(1000 * math.sqrt(2))


def test_camera_looking_at_nothing_is_refused(shape, looking, sun) -> None:
    with pytest.raises(InputError, match="shows nothing"):
        trace(looking([shape("plane", 8.0)], sun, target=(2.3, 9.0, 3.5)))


def test_mesh_before_near_is_not_seen_but_casts(shape, looking, sun) -> None:
    """A plate at depth 2 and the ground at depth 5, seen from above through it."""
    meshes = [shape("plane", 8.0), shape("plane", 1.0, (0.0, 3.0, 0.0))]
    whole, cut = (trace(looking(meshes, sun, eye=(0.0, 5.0, 0.0), size=65, near=near)) for near in (None, 2.5))
    assert whole.triangle[32, 32] >= 2
    assert cut.triangle.max() < 2 and cut.triangle[32, 32] >= 0
    assert (cut.visibility == 0).any()
