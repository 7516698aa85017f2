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
from shadowbench.viewer.camera import distance, dragged, handles, looked, orbited, panned, projected, walked, zoomed

CAMERA = Camera("camera", (3.0, 2.0, 4.0), (0.5, 0.5, -0.2), math.radians(40.0), near=0.1, far=50.0)
SUN = Light("sun", "directional", direction=(0.4, -1.0, -0.3))
SPOT = Light("spot", "spot", direction=(0.0, -1.0, 0.2), position=(0.3, 2.0, 0.4), angle=1.0)
ANGLE = st.floats(-6.0, 6.0)
PLACE = st.floats(-0.5, 0.5)


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


@given(PLACE, PLACE, st.floats(0.1, 100.0))
def test_panning_takes_the_target_along_and_a_point_on_a_ray_is_projected_back(
    x: float, y: float, depth: float
) -> None:
    assert projected(panned(CAMERA, x, y), CAMERA.target)[:2] == pytest.approx((x, y), abs=1e-9)
    point = np.add(CAMERA.position, by_hand.ray(CAMERA, x, y) * depth)
    assert projected(CAMERA, point) == pytest.approx((x, y, depth))


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


def test_walking_forward_stays_level() -> None:
    moved = walked(CAMERA, 0.0, 0.0, 2.0)
    step = np.subtract(moved.position, CAMERA.position)
    assert step[1] == pytest.approx(0.0)
    assert np.linalg.norm(step) == pytest.approx(2.0)
    assert np.subtract(moved.target, CAMERA.target) == pytest.approx(step)
    assert -CAMERA.basis()[2] @ step > 0


@given(PLACE, PLACE, st.booleans())
def test_a_suns_handle_goes_where_it_is_dragged(x: float, y: float, far: bool) -> None:
    moved = dragged(SUN, CAMERA, "light", (x, y), far)
    elevation = by_hand.sun_angles(moved)[1]
    assert elevation >= math.radians(0.99)
    if elevation > math.radians(1.01):  # not held above the horizon
        assert projected(CAMERA, handles(moved, CAMERA)["light"])[:2] == pytest.approx((x, y), abs=1e-6)
        assert by_hand.is_far(moved, CAMERA) == far


def test_a_suns_handle_stays_on_its_dome_when_it_is_dragged_off() -> None:
    moved = dragged(SUN, CAMERA, "light", (0.9, 0.9), False)
    assert math.dist(handles(moved, CAMERA)["light"], CAMERA.target) == pytest.approx(by_hand.dome_radius(CAMERA))
    x, y, _ = projected(CAMERA, handles(moved, CAMERA)["light"])
    assert x == pytest.approx(y), "in the direction in which it was dragged"


@given(PLACE, PLACE)
def test_a_lamps_handles_move_parallel_to_the_picture(x: float, y: float) -> None:
    moved = dragged(SPOT, CAMERA, "light", (x, y), False)
    assert projected(CAMERA, moved.position) == pytest.approx((x, y, projected(CAMERA, SPOT.position)[2]))
    assert moved.direction == SPOT.direction
    aimed, aim = dragged(SPOT, CAMERA, "aim", (x, y), False), handles(SPOT, CAMERA)["aim"]
    goal = dragged(replace(SPOT, position=aim), CAMERA, "light", (x, y), False).position
    assert aimed.position == SPOT.position
    assert aimed.direction == pytest.approx(tuple(unit(np.subtract(goal, SPOT.position))))


def test_a_lamp_behind_the_camera_comes_to_the_depth_of_its_target() -> None:
    behind = replace(SPOT, position=(8.0, 5.0, 9.0))
    assert projected(CAMERA, behind.position)[2] < 0
    place = projected(CAMERA, dragged(behind, CAMERA, "light", (0.2, -0.1), False).position)
    assert place == pytest.approx((0.2, -0.1, distance(CAMERA)))


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
