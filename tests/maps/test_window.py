"""Light-space windows of maps, compared with closed forms; without a device."""

import math

import numpy as np
import pytest

from shadowbench.geometry.convex import SceneHull
from shadowbench.geometry.lights import Box, light_space, window
from shadowbench.maps.fits import FitContext, SceneFit, VisibleFit
from shadowbench.scenes.model import IDENTITY_PLACEMENT, Light, Scene

SUN = light_space(Light("sun", "directional", (0.0, -1.0, 0.0)))
SPOT = light_space(Light("spot", "spot", (0.0, -1.0, 0.0), (0.0, 0.0, 0.0), math.radians(90)))  # base window: ±1


def box(*sides: tuple[float, float]) -> Box:
    low, high = np.array(sides, dtype=float).T
    return Box(low, high)


@pytest.mark.parametrize(("space", "stretch"), [(SUN, 1.0), (SPOT, 5.0)])
def test_near_and_far_leave_room_for_the_padding_and_a_ten_thousandth(space, stretch: float) -> None:
    """A texel of the larger side, at the far plane where a perspective light's texels are widest."""
    shown = window(box((-0.3, 0.5), (-0.1, 0.1), (1.0, 5.0)), space, 64, 2.0, (0.0, 0.0))
    texel = 0.8 / 60
    assert (shown.high - shown.low)[0] == pytest.approx(64 * texel)
    room = 2 * texel * stretch + 4e-4
    assert (shown.low[2], shown.high[2]) == pytest.approx((1 - room, 5 + room), rel=1e-9)


def test_a_perspective_map_begins_at_a_ten_thousandth_of_its_far_plane() -> None:
    for near in (1e-6, 4.9e-4):
        shown = window(box((-0.5, 0.5), (-0.5, 0.5), (near, 5.0)), SPOT, 64, 0.0, (0.0, 0.0))
        assert shown.low[2] == pytest.approx(shown.high[2] / 1e4)
    assert window(box((-0.5, 0.5), (-0.5, 0.5), (-3.0, 5.0)), SUN, 64, 0.0, (0.0, 0.0)).low[2] < -3


def test_a_spot_s_window_ends_with_its_cone() -> None:
    shown = window(box((-3.0, 0.25), (-0.75, 3.0), (1.0, 2.0)), SPOT, 64, 0.0, (0.0, 0.0))
    assert shown.low[:2] == pytest.approx((-1.0, -0.75)) and shown.high[:2] == pytest.approx((0.25, 1.0))


@pytest.mark.parametrize(("depth", "narrowest"), [(4.0, 4e-6), (1e-3, 1e-9), (0.0, 1e-12)])
def test_a_box_without_a_width_has_texels_of_a_millionth_of_its_depth(depth: float, narrowest: float) -> None:
    """And at least of a millionth of the scene, as for a point, so that nothing is divided by zero."""
    shown = window(box((0.5, 0.5), (0.5, 0.5), (1.0, 1.0 + depth)), SUN, 10, 1.0, (0.0, 0.0))
    assert (shown.high - shown.low)[:2] == pytest.approx(narrowest * 10 / 8, rel=1e-3, abs=0)


@pytest.mark.parametrize("size", [1, 2, 3, 4, 5])
def test_a_map_smaller_than_its_padding_shows_the_box_in_one_texel(size: int) -> None:
    shown = window(box((-0.5, 0.5), (-0.25, 0.25), (1.0, 2.0)), SUN, size, 2.0, (0.0, 0.0))
    assert (shown.high - shown.low)[:2] == pytest.approx((size, size / 2))


def context(view, scene: Scene, bounds: Box | None = None) -> FitContext:
    return FitContext(view, IDENTITY_PLACEMENT, SceneHull(scene), lambda space: bounds)


def test_where_no_receiver_is_seen_there_is_a_map_all_the_same(looking, sun, shape) -> None:
    view = looking([shape("plane")], sun())
    shown = VisibleFit().light_view(context(view, view.scene), 64, 0.0, (0.0, 0.0))
    assert np.isfinite(shown.to_map()).all() and shown.near < shown.far and min(shown.texel) > 0


def test_the_near_plane_of_a_spot_inside_the_scene_is_a_millionth_of_the_scene(looking, spot, shape) -> None:
    """The reach: the scene's width and its own distance from the origin."""
    view = looking([shape("box", 4.0)], spot((0.5, 1.5, 0.0), (0.5, 0.0, 0.0), 60.0), eye=(1.0, 1.0, 1.0))
    found = SceneFit().receiver_bounds(light_space(view.light), context(view, view.scene))
    assert found is not None
    assert found.low[2] == pytest.approx((4 + 1.5) * 1e-6) and found.high[2] == pytest.approx(1.5 + 2)


@pytest.mark.parametrize(
    ("kind", "place", "extent", "farthest"),
    [
        ("directional", 64.0, 2.0, 2.0),
        ("directional", 64.0, 2.0**-9, 2.0**-9),
        ("spot", 64.0, 2.0, 64.0),
        ("point", 64.0, 2.0, 64.0),
        ("point", 1.0, 2.0, 2.0),
    ],
)
def test_the_position_step_is_half_a_float32_spacing_of_the_farthest_place(
    shape, kind, place, extent, farthest
) -> None:
    """Rounding to nearest moves a position by no more; the position of a lamp counts too."""
    hull = SceneHull(Scene("test", (shape("box", [2 * extent, extent, extent]),), (), ()))
    light = Light(kind, kind, (0.0, -1.0, 0.0), (0.0, -place, place / 2), 1.0)
    assert hull.position_step(light) == np.spacing(np.float32(farthest)) / 2
