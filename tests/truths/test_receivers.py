"""The pixels that are receivers, and the meshes that cast."""

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from shadowbench.scenes.model import Light, Mesh, View
from shadowbench.scenes.vectors import Floats
from shadowbench.truths.trace import OFFSET, trace

Shape = Callable[..., Mesh]
Looking = Callable[..., View]
OnGround = Callable[[View], Floats]
Toward = Callable[[Light, Floats], Floats]


def test_receivers_face_the_light(light, shape, looking) -> None:
    """All points of a plane face a light, or none does."""
    view = looking([shape("plane", 3.0), shape("box", at=(0, 0.5, 0))], light, size=96)
    truth, geometry = trace(view), view.scene.geometry
    position, w = light.homogeneous
    corners = geometry.vertices[geometry.faces[:, 0]]
    facing = (geometry.normals * (position - w * corners)).sum(axis=1) > 0  # all are wound outward, seen from outside
    hit = truth.triangle >= 0
    expected = hit & facing[truth.triangle]
    assert (hit & ~expected).any()
    if light.kind == "spot":  # its cone leaves out some more
        assert not (truth.receivers & ~expected).any()
    else:
        assert (truth.receivers == expected).all()


def test_cosine_is_of_the_angle_between_normal_and_light(light, shape, looking, on_ground, toward) -> None:
    view = looking([shape("plane", 8.0)], light, size=96)
    truth = trace(view)
    ways = np.broadcast_to(toward(light, on_ground(view)), (96, 96, 3))
    assert truth.cosine[truth.receivers] == pytest.approx(ways[truth.receivers][:, 1], rel=1e-6)


def test_receivers_lie_inside_a_spots_cone(shape, looking, on_ground, toward) -> None:
    spot = Light("spot", "spot", (-0.5, -1.0, 0.2), (1.0, 2.0, -0.4), math.radians(40.0))
    view = looking([shape("plane", 8.0)], spot, size=256)
    truth = trace(view)
    ways = toward(spot, on_ground(view))
    axis = np.asarray(spot.direction) / np.linalg.norm(spot.direction)
    inside = (-ways @ axis >= math.cos(math.radians(20.0))) & (truth.triangle >= 0)
    assert 0.02 < inside.mean() < 0.9
    assert (truth.receivers == inside)[~truth.undecided].all()
    assert (truth.receivers != inside).sum() == 0


@pytest.mark.parametrize("kind", ["directional", "spot"])
@pytest.mark.parametrize("length", [1e-320, 1e-170, 1e200])
def test_the_length_of_a_direction_changes_nothing(shape, looking, kind, length) -> None:
    meshes = [shape("plane", 8.0), shape("box", at=(0, 0.5, 0))]
    usual = Light("light", kind, (-0.5, -1.0, 0.25), (1.0, 2.0, -0.4), math.radians(40.0))
    light = replace(usual, direction=(-0.5 * length, -1.0 * length, 0.25 * length))
    found, expected = (trace(looking(meshes, one, size=96)) for one in (light, usual))
    assert found.receivers.any()
    for name in ("receivers", "visibility", "triangle"):
        same = getattr(found, name) == getattr(expected, name)
        assert same[~expected.undecided].all()


def test_winding_does_not_decide_what_a_receiver_is(shape, looking, sun) -> None:
    ground = shape("plane", 8.0)
    for faces in (ground.faces, np.ascontiguousarray(ground.faces[:, ::-1])):
        above, below = (trace(looking([replace(ground, faces=faces)], sun, eye=(1.0, y, 2.0))) for y in (3.0, -3.0))
        assert (above.receivers == (above.triangle >= 0)).all()
        assert (below.triangle >= 0).any() and not below.receivers.any()


def test_mesh_that_does_not_receive_has_no_receivers(shape, looking, sun) -> None:
    box = shape("box", at=(0, 0.5, 0))
    view = looking([shape("plane", 8.0, receives=False), box], sun, size=96)
    truth = trace(view)
    ground = (truth.triangle == 0) | (truth.triangle == 1)
    assert ground.any()
    assert not truth.receivers[ground].any()
    assert truth.receivers[~ground].any()


def test_mesh_that_does_not_cast_casts_nothing(light, shape, looking) -> None:
    ground, box = shape("plane", 8.0), shape("box", at=(0, 1.0, 0))
    casting = trace(looking([ground, box], light, size=96))
    silent = trace(looking([ground, replace(box, casts=False)], light, size=96))
    assert (casting.visibility == 0).any()
    assert (silent.visibility == 1).all()
    assert np.isinf(silent.blocker).all()
    assert (silent.triangle == casting.triangle).all()
    nothing_casts = [replace(mesh, casts=False) for mesh in (ground, box)]
    assert (trace(looking(nothing_casts, light, size=96)).visibility == 1).all()


def test_sky_is_no_part_of_the_scene_s_size(shape, looking, sun) -> None:
    ground, box = shape("plane", 8.0), shape("box", at=(0, 0.5, 0))
    sky = shape("sphere", 100.0, casts=False, receives=False)
    views = [looking(meshes, sun, target=(0.0, 3.5, 0.0)) for meshes in ([ground, box], [ground, box, sky])]
    alone, under = (trace(view) for view in views)
    assert (under.triangle >= 0).all() and not (alone.triangle >= 0).all()
    assert under.diagonal == pytest.approx(alone.diagonal, rel=1e-9)


@pytest.mark.parametrize(("above", "visibility"), [(0.5, 1), (-8.0, 0)])
def test_plate_behind_a_lamp_casts_nothing(shape, looking, above, visibility) -> None:
    """Half a ray's offset behind the lamp: the way from the offset to the lamp is that much shorter."""
    offset = OFFSET * math.hypot(8, 8)
    meshes = [shape("plane", 8.0), shape("plane", 2.0, (0.0, 1.0 + above * offset, 0.0))]
    lamp = Light("lamp", "point", position=(0.0, 1.0, 0.0))
    truth = trace(looking(meshes, lamp, eye=(0.0, 0.5, 0.0), fov=60.0))
    assert truth.receivers.all()
    assert (truth.visibility == visibility).all()


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


def test_one_receiver_is_as_good_as_many(light, shape, looking) -> None:
    """Two pixels see the ground at their centres, and only one of them does at its lower samples."""
    ground = shape("plane", 8.0, (4.0, 0.0, -3.7))
    truth = trace(looking([ground], light, 2, (0.0, 1.0, 0.0), (0.0, 0.0, -1e-4), math.degrees(2 * math.atan(0.5))))
    assert (truth.receivers == [[False, True], [False, True]]).all()
    assert (truth.visibility == 1).all() and (truth.area == 1).all()
