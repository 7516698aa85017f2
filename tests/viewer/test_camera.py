"""Motions of camera and light, as closed forms and as what must not change."""

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from shadowbench.scenes.assumed import sun_direction
from shadowbench.scenes.model import Camera, Light, LightShape, View
from shadowbench.scenes.triangles import LARGEST
from shadowbench.scenes.vectors import unit
from shadowbench.viewer import camera as by_hand
from shadowbench.viewer.camera import distance, dragged, looked, orbited, panned, zoomed

CAMERA = Camera("camera", (3.0, 2.0, 4.0), (0.5, 0.5, -0.2), math.radians(40.0), near=0.1, far=50.0)
FLAT = replace(CAMERA, fov_y=0.0, height=3.0)
BOTH = pytest.mark.parametrize("camera", [CAMERA, FLAT], ids=["perspective", "orthographic"])
SUN = Light("sun", "directional", direction=(0.4, -1.0, -0.3))
SPOT = Light("spot", "spot", direction=(0.0, -1.0, 0.2), position=(0.3, 2.0, 0.4), angle=1.0)
ANGLE = st.floats(-6.0, 6.0)
PLACE = st.floats(-0.5, 0.5)


def projected(camera: Camera, point: object) -> tuple[float, float]:
    """The place of a point in the picture."""
    right, up, back = camera.basis()
    offset = np.subtract(point, camera.position)
    scale = camera.half_height(float(-back @ offset))
    return float(right @ offset) / scale, float(up @ offset) / scale


@given(ANGLE, ANGLE)
def test_orbiting_keeps_the_target_and_the_distance_and_stops_short_of_the_poles(yaw: float, pitch: float) -> None:
    moved = orbited(CAMERA, yaw, pitch)
    assert moved.target == CAMERA.target
    assert distance(moved) == pytest.approx(distance(CAMERA))
    assert orbited(orbited(CAMERA, yaw, 0.0), -yaw, 0.0).position == pytest.approx(CAMERA.position)
    x, _, z = np.subtract(moved.position, CAMERA.target)
    assert math.hypot(x, z) >= 0.999 * math.sin(by_hand.LEAST_TILT) * distance(CAMERA)


def test_orbiting_by_a_quarter_turn_turns_the_offset_about_the_up_vector() -> None:
    moved = orbited(replace(CAMERA, position=(4.5, 0.5, -0.2)), math.pi / 2, 0.0)
    assert moved.position == pytest.approx((0.5, 0.5, -4.2)), "from +x to −z"
    assert (moved.near, moved.far) == (None, None), "a file's planes were for its own place"


@given(ANGLE, PLACE)
def test_looking_around_keeps_the_position_and_looking_left_shows_the_target_at_the_right(
    yaw: float, pitch: float
) -> None:
    moved = looked(CAMERA, yaw, pitch)
    assert moved.position == CAMERA.position
    assert distance(moved) == pytest.approx(distance(CAMERA))
    assert projected(looked(CAMERA, 0.1, 0.0), CAMERA.target)[0] > 0
    assert projected(looked(CAMERA, 0.0, 0.1), CAMERA.target)[1] < 0


@BOTH
@given(PLACE, PLACE)
def test_panning_takes_the_target_along(camera: Camera, x: float, y: float) -> None:
    assert projected(panned(camera, x, y), camera.target) == pytest.approx((x, y), abs=1e-9)


@BOTH
@given(st.floats(0.1, 10.0), PLACE, PLACE)
def test_zooming_shrinks_what_is_beside_the_target(camera: Camera, factor: float, x: float, y: float) -> None:
    right, up, _ = camera.basis()
    point = camera.target + x * right + y * up
    before, after = (projected(each, point) for each in (camera, zoomed(camera, factor)))
    assert np.multiply(after, factor) == pytest.approx(before, abs=1e-9)


@pytest.mark.parametrize("factor", [0.5, 2.0])
def test_zooming_scales_the_distance_and_ends_while_the_camera_has_a_direction(factor: float) -> None:
    assert distance(zoomed(CAMERA, factor)) == pytest.approx(factor * distance(CAMERA))
    camera = CAMERA
    for _ in range(2000):
        camera = zoomed(camera, factor)
    assert np.abs(camera.position).max() <= LARGEST
    back = zoomed(camera, 1 / factor)
    assert distance(back) == pytest.approx(distance(camera) / factor, rel=1e-3)
    assert np.allclose(back.basis(), CAMERA.basis(), atol=1e-4)


def test_a_sun_is_dragged_around_and_up_and_stays_above_the_horizon() -> None:
    azimuth, elevation = by_hand.sun_angles(SUN)
    assert by_hand.sun_angles(dragged(SUN, CAMERA, 0.2, 0.1)) == pytest.approx(
        (azimuth + 0.1 * math.pi, elevation + 0.025 * math.pi)
    )
    assert by_hand.sun_angles(dragged(SUN, CAMERA, 0.0, -2.0))[1] == pytest.approx(by_hand.LOWEST)


@BOTH
@given(PLACE, PLACE)
def test_a_lamp_is_dragged_parallel_to_the_picture(camera: Camera, x: float, y: float) -> None:
    moved = dragged(SPOT, camera, x, y)
    assert np.subtract(projected(camera, moved.position), projected(camera, SPOT.position)) == pytest.approx((x, y))
    assert moved.direction == SPOT.direction
    behind = replace(SPOT, position=(8.0, 5.0, 9.0))
    step = np.subtract(dragged(behind, camera, x, y).position, behind.position)
    assert projected(camera, camera.target + step) == pytest.approx((x, y), abs=1e-9)


@given(st.floats(-3.0, 3.0), st.floats(-1.5, 1.5))
def test_azimuth_and_elevation_are_those_of_the_sun(azimuth: float, elevation: float) -> None:
    sun = replace(SUN, direction=sun_direction(azimuth, elevation))
    assert by_hand.sun_angles(sun) == pytest.approx((azimuth, elevation))


@pytest.mark.parametrize("kind", ["spot", "point", "rectangle"])
def test_a_light_of_another_kind_shines_from_the_same_side(builtin: Callable[..., View], kind: LightShape) -> None:
    view = builtin("sphere-and-torus")
    lamp = by_hand.with_kind(view.light, kind, view.scene)
    assert lamp.kind == kind
    toward = unit(lamp.position - view.scene.geometry.bounds.mean(axis=0))
    assert toward == pytest.approx(-unit(view.light.direction))
    sun = by_hand.with_kind(lamp, "directional", view.scene)
    assert unit(sun.direction) == pytest.approx(unit(view.light.direction))
