"""Handles of lights, and their motion."""

import math
from collections.abc import Callable
from dataclasses import replace
from typing import get_args

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from shadowbench.scenes.assumed import sun_direction
from shadowbench.scenes.model import Camera, Light, LightShape, View
from shadowbench.scenes.vectors import unit
from shadowbench.viewer.lights import (
    LightPath,
    azimuth_elevation,
    dome_radius,
    dragged,
    handles,
    is_far,
    travelled,
    with_kind,
)
from shadowbench.viewer.navigation import projected

CAMERA = Camera("camera", (3.0, 2.0, 4.0), (0.5, 0.5, -0.2), math.radians(40.0))
SUN = Light("sun", "directional", direction=(0.4, -1.0, -0.3))
SPOT = Light("spot", "spot", direction=(0.0, -1.0, 0.2), position=(0.3, 2.0, 0.4), angle=1.0)
PLACE = st.floats(-0.5, 0.5)


@given(PLACE, PLACE, st.booleans())
def test_a_suns_handle_goes_where_it_is_dragged(x: float, y: float, far: bool) -> None:
    moved = dragged(SUN, CAMERA, "light", (x, y), far)
    elevation = azimuth_elevation(moved)[1]
    assert elevation >= math.radians(0.99)
    if elevation > math.radians(1.01):  # not held above the horizon
        assert projected(CAMERA, handles(moved, CAMERA)["light"])[:2] == pytest.approx((x, y), abs=1e-6)
        assert is_far(moved, CAMERA) == far


def test_a_suns_handle_stays_on_its_dome_when_it_is_dragged_off() -> None:
    moved = dragged(SUN, CAMERA, "light", (0.9, 0.9), False)
    assert math.dist(handles(moved, CAMERA)["light"], CAMERA.target) == pytest.approx(dome_radius(CAMERA))
    x, y, _ = projected(CAMERA, handles(moved, CAMERA)["light"])
    assert x == pytest.approx(y), "in the direction in which it was dragged"


@given(PLACE, PLACE)
def test_a_lamps_handle_moves_parallel_to_the_picture(x: float, y: float) -> None:
    depth = projected(CAMERA, SPOT.position)[2]
    moved = dragged(SPOT, CAMERA, "light", (x, y), False)
    assert projected(CAMERA, moved.position) == pytest.approx((x, y, depth))
    assert moved.direction == SPOT.direction


def test_a_lamp_behind_the_camera_comes_to_the_depth_of_its_target() -> None:
    behind = replace(SPOT, position=(8.0, 5.0, 9.0))
    assert projected(CAMERA, behind.position)[2] < 0
    place = projected(CAMERA, dragged(behind, CAMERA, "light", (0.2, -0.1), False).position)
    assert place == pytest.approx((0.2, -0.1, math.dist(CAMERA.position, CAMERA.target)))


@given(PLACE, PLACE)
def test_a_spot_shines_to_where_its_aim_is_dragged(x: float, y: float) -> None:
    moved = dragged(SPOT, CAMERA, "aim", (x, y), False)
    aim = handles(SPOT, CAMERA)["aim"]
    target = np.add(moved.position, np.asarray(moved.direction) * 1.0)
    assert moved.position == SPOT.position
    assert np.linalg.norm(moved.direction) == pytest.approx(1.0)
    to = dragged(replace(SPOT, position=aim), CAMERA, "light", (x, y), False).position
    assert unit(np.subtract(target, SPOT.position)) == pytest.approx(unit(np.subtract(to, SPOT.position)))


@given(st.floats(-3.0, 3.0), st.floats(-1.5, 1.5))
def test_azimuth_and_elevation_are_those_of_the_sun(azimuth: float, elevation: float) -> None:
    sun = replace(SUN, direction=sun_direction(azimuth, elevation))
    assert azimuth_elevation(sun) == pytest.approx((azimuth, elevation))


@given(st.floats(0.0, 5.0))
def test_a_lamp_that_travels_keeps_its_distance_and_returns(builtin: Callable[..., View], turns: float) -> None:
    scene = builtin("post").scene
    center = scene.geometry.bounds.mean(axis=0)
    circled, later = (travelled(SPOT, scene, path, turns) for path in ("circle", "day"))
    for moved in (circled, later):
        assert math.dist(moved.position, center) == pytest.approx(math.dist(SPOT.position, center))
    assert circled.position[1] == pytest.approx(SPOT.position[1])
    assert unit(later.direction) == pytest.approx(unit(center - later.position)), "it shines to the centre"
    back = travelled(circled, scene, "circle", -turns)
    assert (*back.position, *back.direction) == pytest.approx((*SPOT.position, *SPOT.direction))
    assert travelled(SPOT, scene, "circle", 1.0).position == pytest.approx(SPOT.position)
    assert travelled(SPOT, scene, "rest", turns) is SPOT


def test_a_day_goes_from_east_over_south_to_west_and_begins_anew(builtin: Callable[..., View]) -> None:
    scene = builtin("post").scene
    morning = travelled(replace(SUN, direction=(-1.0, 0.0, 0.0)), scene, "day", 0.01)
    noon, evening, next_morning = (travelled(morning, scene, "day", turns) for turns in (0.495, 0.98, 1.0))
    (east, low, _), (middle, high, south) = (-unit(sun.direction) for sun in (morning, noon))
    assert east > 0.99 and 0 < low < 0.1
    assert abs(middle) < 0.05 and high > 0.8 and south > 0.5
    assert -unit(evening.direction)[0] < -0.99
    assert next_morning.direction == pytest.approx(morning.direction)
    suns = [morning := travelled(morning, scene, "day", 1 / 64) for _ in range(128)]
    assert min(azimuth_elevation(sun)[1] for sun in suns) >= math.radians(0.999)


@pytest.mark.parametrize("kind", get_args(LightShape))
def test_a_light_of_another_kind_shines_from_the_same_side(builtin: Callable[..., View], kind: LightShape) -> None:
    view = builtin("sphere-and-torus")
    changed = with_kind(view.light, kind, view.scene)
    assert changed.kind == kind
    low, high = view.scene.geometry.bounds
    xyz, w = changed.homogeneous
    toward = unit(np.subtract(xyz, w * (low + high) / 2))
    assert toward == pytest.approx(-unit(view.light.direction))
    assert with_kind(changed, "directional", view.scene).direction == pytest.approx(
        view.light.direction if kind != "point" else tuple(-toward), rel=1e-6
    )


@pytest.mark.parametrize("kind", ["spot", "point", "disc", "rectangle"])
def test_a_lamp_that_becomes_a_sun_and_a_lamp_again_keeps_its_place(
    builtin: Callable[..., View], kind: LightShape
) -> None:
    scene = builtin("spot-lamp").scene
    lamp = with_kind(builtin("spot-lamp").light, kind, scene)
    sun = with_kind(lamp, "directional", scene)
    for again in ("spot", "disc", "point"):
        back = with_kind(sun, again, scene)
        assert back.position == lamp.position
    assert with_kind(sun, "spot", scene).direction == pytest.approx(sun.direction)


def test_a_sun_that_was_moved_becomes_a_lamp_as_far_away_as_it_was(builtin: Callable[..., View]) -> None:
    scene, lamp = builtin("spot-lamp").scene, builtin("spot-lamp").light
    center = scene.geometry.bounds.mean(axis=0)
    moved = replace(with_kind(lamp, "directional", scene), direction=sun_direction(2.0, 0.3))
    back = with_kind(moved, "spot", scene)
    assert math.dist(back.position, center) == pytest.approx(math.dist(lamp.position, center))
    assert unit(center - back.position) == pytest.approx(unit(moved.direction))


@pytest.mark.parametrize("path", ["circle", "day"])
def test_a_sun_that_travels_gets_no_place(builtin: Callable[..., View], path: LightPath) -> None:
    scene = builtin("post").scene
    low, high = scene.geometry.bounds
    lamp = with_kind(travelled(SUN, scene, path, 0.1), "spot", scene)
    assert math.dist(lamp.position, (low + high) / 2) == pytest.approx(math.dist(low, high))


def test_a_spot_that_becomes_a_point_light_and_a_spot_again_keeps_its_aim(builtin: Callable[..., View]) -> None:
    scene = builtin("post").scene
    spot = replace(SPOT, direction=(-0.2, -0.9, -0.1))
    assert with_kind(with_kind(spot, "point", scene), "spot", scene) == spot
