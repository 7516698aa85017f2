"""Motions of the camera, as closed forms and as what must not change."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from shadowbench.scenes.model import Camera
from shadowbench.scenes.triangles import LARGEST
from shadowbench.scenes.vectors import vec3
from shadowbench.viewer.navigation import LEAST_TILT, distance, looked, orbited, panned, projected, ray, walked, zoomed

CAMERA = Camera("camera", (3.0, 2.0, 4.0), (0.5, 0.5, -0.2), math.radians(40.0), near=0.1, far=50.0)
ANGLE = st.floats(-6.0, 6.0)
PLACE = st.floats(-1.0, 1.0)


@given(ANGLE, ANGLE)
def test_orbiting_keeps_the_target_and_the_distance_to_it(yaw: float, pitch: float) -> None:
    moved = orbited(CAMERA, yaw, pitch)
    assert moved.target == CAMERA.target
    assert distance(moved) == pytest.approx(distance(CAMERA))
    assert orbited(orbited(CAMERA, yaw, 0.0), -yaw, 0.0).position == pytest.approx(CAMERA.position)


def test_orbiting_by_a_quarter_turn_turns_the_offset_about_the_up_vector() -> None:
    moved = orbited(replace(CAMERA, position=(4.5, 0.5, -0.2)), math.pi / 2, 0.0)
    assert moved.position == pytest.approx((0.5, 0.5, -4.2)), "from +x to −z"


@given(st.floats(-10.0, 10.0))
def test_orbiting_stops_short_of_the_poles(pitch: float) -> None:
    x, _, z = np.subtract(orbited(CAMERA, 0.0, pitch).position, CAMERA.target)
    assert math.hypot(x, z) >= 0.999 * math.sin(LEAST_TILT) * distance(CAMERA)


@given(ANGLE, st.floats(-0.5, 0.5))
def test_looking_around_keeps_the_position(yaw: float, pitch: float) -> None:
    moved = looked(CAMERA, yaw, pitch)
    assert moved.position == CAMERA.position
    assert distance(moved) == pytest.approx(distance(CAMERA))


def test_looking_left_shows_the_target_at_the_right() -> None:
    assert projected(looked(CAMERA, 0.1, 0.0), CAMERA.target)[0] > 0
    assert projected(looked(CAMERA, 0.0, 0.1), CAMERA.target)[1] < 0


@given(PLACE, PLACE)
def test_panning_takes_the_target_along(x: float, y: float) -> None:
    assert projected(panned(CAMERA, x, y), CAMERA.target)[:2] == pytest.approx((x, y), abs=1e-9)


@given(st.floats(0.1, 10.0))
def test_zooming_scales_the_distance_and_zooming_back_returns(factor: float) -> None:
    assert distance(zoomed(CAMERA, factor)) == pytest.approx(factor * distance(CAMERA))
    assert zoomed(zoomed(CAMERA, factor), 1 / factor).position == pytest.approx(CAMERA.position)


@pytest.mark.parametrize("factor", [0.5, 2.0])
def test_zooming_without_end_keeps_a_camera_that_has_a_direction(factor: float) -> None:
    camera = CAMERA
    for _ in range(2000):
        camera = zoomed(camera, factor)
    assert np.abs(camera.position).max() <= LARGEST
    back = zoomed(camera, 1 / factor)
    assert distance(back) == pytest.approx(distance(camera) / factor, rel=1e-3)
    assert np.allclose(back.basis(), CAMERA.basis(), atol=1e-4)


def test_walking_forward_stays_level() -> None:
    moved = walked(CAMERA, 0.0, 0.0, 2.0)
    step = np.subtract(moved.position, CAMERA.position)
    assert step[1] == pytest.approx(0.0)
    assert np.linalg.norm(step) == pytest.approx(2.0)
    assert np.subtract(moved.target, CAMERA.target) == pytest.approx(step)
    assert -CAMERA.basis()[2] @ step > 0


@given(PLACE, PLACE, st.floats(0.1, 100.0))
def test_a_point_on_a_ray_is_projected_back(x: float, y: float, depth: float) -> None:
    point = np.add(CAMERA.position, ray(CAMERA, x, y) * depth)
    assert projected(CAMERA, point) == pytest.approx((x, y, depth))


def test_what_is_behind_the_camera_has_a_depth_below_zero() -> None:
    assert projected(CAMERA, vec3(np.add(CAMERA.position, CAMERA.basis()[2])))[2] == pytest.approx(-1.0)


@pytest.mark.parametrize("move", [lambda c: orbited(c, 0.1, 0.1), lambda c: zoomed(c, 2.0), lambda c: panned(c, 1, 0)])
def test_a_moved_camera_has_no_planes_of_a_file(move: object) -> None:
    moved = move(CAMERA)  # type: ignore[operator]
    assert (moved.near, moved.far) == (None, None)
