"""Light space and light views: the relations between their numbers."""

import numpy as np
import pytest

from shadowbench.geometry.lights import Box, LightSpace, LightView, light_space
from shadowbench.scenes.model import Light

KINDS = ["directional", "spot"]


def space_of(kind: str) -> LightSpace:
    return light_space(Light(kind, kind, (0.3, -1.0, 0.2), (0.4, 3.0, -0.2), 1.0))


def view_of(kind: str) -> LightView:
    return LightView(space_of(kind), Box(np.array([-0.4, -0.3, 1.0]), np.array([0.2, 0.5, 5.0])), 64)


def along(
    kind: str, distance: np.ndarray, across: float | np.ndarray = 0.1, up: float | np.ndarray = 0.2
) -> np.ndarray:
    """(N, 4) points at box coordinates: distances along the light's axis, and offsets from it."""
    space, widen = space_of(kind), distance if kind == "spot" else np.ones_like(distance)
    points = space.origin + np.column_stack([across * widen, up * widen, -distance]) @ space.basis
    return np.column_stack([points, np.ones(len(points))])


def test_depth_scale_is_the_slope_of_depth_over_distance() -> None:
    for kind in KINDS:
        seen, distance, step = view_of(kind), np.linspace(1, 5, 9), 1e-6
        depths = [
            (places @ seen.to_map().T)[:, 2:] for places in (along(kind, distance - step), along(kind, distance + step))
        ]
        near, far = (places[:, 0] / places[:, 1] for places in depths)
        expected = seen.depth_scale / (distance**2 if kind == "spot" else 1)
        assert (far - near) / (2 * step) == pytest.approx(expected, rel=1e-6)


def test_a_texel_is_that_part_of_the_map() -> None:
    for kind in KINDS:
        seen = view_of(kind)
        assert seen.texel == pytest.approx((0.6 / 64, 0.8 / 64))
        width, height = seen.texel
        corner, across, up = (
            (along(kind, np.array([2.0]), *place) @ seen.to_map().T)[0] for place in ((0, 0), (width, 0), (0, height))
        )
        assert (across / across[3] - corner / corner[3])[:2] * 64 == pytest.approx((1, 0), abs=1e-9)
        assert (up / up[3] - corner / corner[3])[:2] * 64 == pytest.approx((0, 1), abs=1e-9)


def test_linear_depth_is_the_share_of_the_way_from_near_to_far() -> None:
    for kind in KINDS:
        for reversed_depth in (False, True):
            seen, distance = view_of(kind), np.linspace(1, 5, 9)
            place = along(kind, distance) @ seen.to_map(reversed_depth).T
            assert seen.linear(place[:, 2] / place[:, 3], reversed_depth) == pytest.approx((distance - 1) / 4)


def test_planes_bound_what_the_map_shows_and_all_before_it() -> None:
    for kind in KINDS:
        seen, random = view_of(kind), np.random.default_rng(3)
        distance = random.uniform(0.2, 7, 500)
        points = along(kind, distance, *random.uniform(-0.8, 0.8, (2, 500)))
        place = points @ seen.to_map().T
        u, v, depth = (place[:, :3] / place[:, 3:]).T
        shown = (np.abs(u - 0.5) <= 0.5) & (np.abs(v - 0.5) <= 0.5) & (depth <= 1)
        assert 50 < shown.sum() < 300
        assert np.array_equal((points @ seen.planes.T >= 0).all(axis=1), shown)
        on_a_side = along(kind, distance, -0.4, 0.5) @ seen.planes.T
        assert on_a_side[:, [0, 3]] == pytest.approx(0, abs=1e-12) and (on_a_side[:, [1, 2]] > 0).all()
        assert (along(kind, np.array([5.0])) @ seen.planes.T)[0, 4] == pytest.approx(0, abs=1e-12)
