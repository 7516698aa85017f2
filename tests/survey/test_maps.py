"""The map that fits a view: its Jacobians by differences, and the sizes, formats and biases of closed forms."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from shadowbench.maps.biases import Texel
from shadowbench.maps.fits import VisibleFit
from shadowbench.scenes.model import Light, Mesh, View
from shadowbench.scenes.opening import chosen_view
from shadowbench.survey.maps import (
    ANGLES,
    BIAS_STEPS,
    DISPLACEMENTS,
    GRAZING_SLOPE,
    LIMIT,
    PADDING,
    REFERENCE_SIZE,
    STEP,
    WRONG,
    CascadeSizes,
    FittedMap,
    bias_of,
    bits_of,
    cascades_of,
    fitted_map,
    texels_for,
    texels_of,
)
from shadowbench.survey.samples import longest, sample_view
from shadowbench.techniques.cascades import Cascades
from shadowbench.techniques.shadow_map import ShadowMap
from tests.survey.conftest import SUN, from_above, looking, plate, tilted


def fitted_to(view: View) -> FittedMap:
    return fitted_map(sample_view(view))


def test_jacobian_and_slope_are_the_differences_between_neighbours(light: Light) -> None:
    fitted = fitted_to(looking([plate(30.0)], light, size=128))
    grid = np.full((128, 128), -1)
    grid[np.divmod(fitted.samples.pixel, 128)] = np.arange(len(fitted.samples.pixel))
    here = grid[1:-1, 1:-1]
    for axis, (before, after) in enumerate(((grid[1:-1, :-2], grid[1:-1, 2:]), (grid[:-2, 1:-1], grid[2:, 1:-1]))):
        inside = (here >= 0) & (before >= 0) & (after >= 0)
        inside &= (fitted.face[before] == fitted.face[here]) & (fitted.face[after] == fitted.face[here])
        a, b, c = before[inside], here[inside], after[inside]
        assert len(b) > 1000
        moved = (fitted.coords[:, c] - fitted.coords[:, a]) / 2
        scale = np.linalg.norm(moved[:2], axis=0)
        np.testing.assert_allclose(fitted.jacobian[:, axis, b], moved[:2], atol=1e-3 * scale.max())
        along = (fitted.slope[:, b] * fitted.jacobian[:, axis, b]).sum(axis=0)
        np.testing.assert_allclose(along, moved[2], atol=2e-3 * np.abs(moved[2]).max() + 1e-9)


def test_the_longest_reach_is_the_reciprocal_of_the_least_singular_value() -> None:
    matrices = np.random.default_rng(1).normal(size=(2, 2, 100))
    least = np.linalg.svd(matrices.transpose(2, 0, 1))[1][:, 1]
    np.testing.assert_allclose(longest(matrices), 1 / least, rtol=1e-9)


# Sizes


def test_predicted_edge_displacement_matches_random_edges_on_a_grid() -> None:
    """Points beside a straight edge that a 2×2 linear comparison of texel centres puts on its other side."""
    chance = np.random.default_rng(0)
    for angle, off in zip(ANGLES, DISPLACEMENTS, strict=True):
        normal = np.array([np.cos(angle), np.sin(angle)])
        away = (chance.random(400_000) - 0.5) * 3
        point = away[:, None] * normal + chance.random((400_000, 1)) * 1000 * np.array([-normal[1], normal[0]])
        shift = chance.random((400_000, 2))  # of the grid
        corner, part = np.divmod(point + shift - 0.5, 1.0)
        lit = [[((corner + [i, j] + 0.5 - shift) @ normal > 0) * 1.0 for j in (0, 1)] for i in (0, 1)]
        x, y = part.T
        mixed = (lit[0][0] * (1 - x) + lit[1][0] * x) * (1 - y) + (lit[0][1] * (1 - x) + lit[1][1] * x) * y
        assert 3 * np.mean((mixed > 0.5) != (away > 0)) == pytest.approx(off, abs=0.003)


@pytest.mark.parametrize("elevation", [90.0, 20.0])
def test_a_plane_from_above_needs_as_many_texels_as_pixels_whatever_the_sun(elevation: float) -> None:
    texels = texels_of(fitted_to(from_above([plate(50.0)], tilted(elevation))))
    # 64 pixel centres lie 63 pixels apart; the fit pads them by 2 texels on each side.
    assert texels.size == pytest.approx(63 + 4, rel=1e-6)
    assert (texels.p95, texels.largest) == pytest.approx((63 / (1024 - 4),) * 2, rel=1e-6)
    assert texels.edge_size is None, "without a shadow"


def test_the_needed_size_for_an_edge_on_a_plane_follows_from_its_mean_displacement() -> None:
    sun = Light("sun", "directional", (0.5, -1.0, 0.0))
    texels = texels_of(fitted_to(from_above([plate(50.0), plate(0.4, (-0.25, 0.5, 0.0))], sun, size=128)))
    # Texels as long as pixels, an edge of any direction: its displacement along a row or column, averaged, is the
    # integral of DISPLACEMENTS / max(|sin|, |cos|); so many texels a pixel bring it to WRONG.
    angles = (np.arange(3600) + 0.5) * np.pi / 7200
    off = np.interp(np.minimum(angles, np.pi / 2 - angles), ANGLES, DISPLACEMENTS)
    mean = float((off / np.maximum(np.sin(angles), np.cos(angles))).mean())
    assert texels.edge_size is not None
    assert (texels.edge_size - 4) / 127 == pytest.approx(mean / WRONG, rel=0.01)


def test_a_shadow_at_its_caster_s_foot_needs_texels_until_the_bias_does_not_light_it() -> None:
    """A wall in low light: its shadow is a strip, lit as far from the wall as the bias of a slope of 10 reaches."""
    height, slope = 0.05, 10.0
    corners = np.array([[0.0, 0.0, -25.0], [0.0, 0.0, 25.0], [0.0, height, 25.0], [0.0, height, -25.0]])
    wall = Mesh("wall", corners, np.array([[0, 1, 2], [0, 2, 3]], dtype=np.int32))
    sun = Light("sun", "directional", (slope, -1.0, 0.0))
    fitted = fitted_to(looking([plate(50.0), wall], sun, 128, (-3.0, 10.0, 0.0), fov=11.4))
    samples, edge_size = fitted.samples, texels_of(fitted).edge_size
    inner = np.setdiff1d(np.flatnonzero(samples.shadowed), samples.edges)
    foot = np.abs(samples.point[0, inner] - samples.view.scene.meshes[1].vertices[0, 0]).min()
    # The bias is tan θ · the diagonal of a texel along the ray, which meets the wall after foot · √(1 + 1/slope²).
    needed = slope * np.hypot(*fitted.extent) / (foot * np.hypot(1.0, 1.0 / slope))
    assert edge_size is not None
    assert edge_size - 2 * PADDING == pytest.approx(needed, rel=STEP - 1)


@given(arrays(float, st.integers(1, 50), elements=st.floats(0.01, 1e4)))
def test_the_predicted_map_size_leaves_the_stated_share_of_edge_pixels_wrong(moved: np.ndarray) -> None:
    texels = texels_for(moved)
    assert np.minimum(moved / texels, 1.0).mean() == pytest.approx(WRONG, rel=1e-9)


def test_cascades_pay_along_a_street_and_not_over_a_plane_from_above() -> None:
    def cascades(view: View) -> CascadeSizes:
        fitted = fitted_to(view)
        sizes = cascades_of(fitted, texels_of(fitted))
        assert sizes is not None
        return sizes

    street = cascades(chosen_view("deep-street", 256))
    assert street.worthwhile and street.saving > 10 and street.depth_ratio > 100
    sizes = list(street.edge_size.values())
    assert sizes == sorted(sizes, reverse=True)
    flat = cascades(from_above([plate(50.0), plate(0.5, (0.0, 1.0, 0.0))], SUN, size=128))
    assert not flat.worthwhile and flat.depth_ratio < 1.2


def test_needs_of_an_oriented_map_are_of_the_window_that_is_drawn(studio, build, builtin) -> None:
    for name in ("street", "terrain", "spot-lamp"):
        shot = studio.shot(builtin(name, 128))
        one = build("shadow-map", shot)
        one.draw(shot)
        extent = fitted_map(sample_view(shot.view)).extent
        window = np.array(one.technique.light_view.texel) * (REFERENCE_SIZE - 2 * PADDING)
        assert np.prod(extent) == pytest.approx(np.prod(window), rel=0.05), name


def test_needs_of_oriented_maps_do_not_depend_on_the_scene_s_angle_about_the_light_s_axis() -> None:
    """A lifted plate over a wide ground, with its camera, turned below a sun overhead."""

    def sizes(degrees: int, oriented: bool) -> list[float]:
        """Needed sizes of one map, and of cascades, which are oriented."""
        cosine, sine = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
        turn = np.array([[cosine, 0, sine], [0, 1, 0], [-sine, 0, cosine]])
        meshes = [plate(80.0), plate(0.7, (0.0, 0.4, 0.0)), plate(0.7, (0.0, 0.4, -6.0))]
        meshes = [replace(mesh, vertices=mesh.vertices @ turn.T) for mesh in meshes]
        view = looking(meshes, Light("sun", "directional", (0.0, -1.0, 0.0)), 128, tuple(turn @ (0.0, 1.5, 4.0)))
        view = replace(view, camera=replace(view.camera, near=0.5, far=16.0))
        fitted = replace(fitted_map(sample_view(view), oriented), oriented=True)
        one = texels_of(fitted)
        cascades = cascades_of(fitted, one)
        assert one.edge_size is not None and cascades is not None
        return [one.edge_size, *cascades.edge_size.values()]

    expected, rotated, level = sizes(0, True), sizes(30, True), sizes(30, False)
    assert rotated == pytest.approx(expected, rel=0.02)
    assert level[0] != pytest.approx(expected[0], rel=0.02)
    assert level[1:] == pytest.approx(rotated[1:], rel=1e-3), "whatever the angle of the one map"


def test_needs_are_those_of_the_default_shadow_map() -> None:
    params = ShadowMap.Params()
    assert isinstance(params.fit, VisibleFit) and params.fit.oriented and Cascades.Params().oriented
    assert params.filter.radius(params.size) + 1 == PADDING and params.size == REFERENCE_SIZE
    assert params.bias == Texel(ulps=BIAS_STEPS, limit=LIMIT, grazing=GRAZING_SLOPE)


# Depths and biases


@pytest.mark.parametrize("scale", [1e-3, 1e4])
def test_the_gap_under_a_plate_is_its_height_along_the_ray(scale: float) -> None:
    meshes = [plate(50.0 * scale), plate(0.5 * scale, (-0.5 * scale, 0.3 * scale, 0.0))]
    fitted = fitted_to(from_above(meshes, tilted(30.0), width=2.0 * scale, size=128))
    bits, bias = bits_of(fitted.samples, fitted.depths), bias_of(fitted)
    assert bits is not None and bias is not None
    assert (bits.closest, bias.thinnest) == pytest.approx((0.6 * scale,) * 2, rel=1e-4)


@pytest.mark.parametrize(("steps_of_16", "bits"), [(8.0, 16), (2.0, 24), (2.0 / 256, None)])
def test_the_depth_format_follows_from_the_gap_in_depth_steps(steps_of_16: float, bits: int | None) -> None:
    """The ground seen is 2 m wide under a sun at 45°: depths range over √2 m, and a little more for the fit."""
    fitted = fitted_to(from_above([plate(50.0), plate(0.5, (-0.5, 0.3, 0.0))], tilted(45.0), size=128))
    depths = fitted.depths
    assert depths.far - depths.near == pytest.approx(math.sqrt(2) * fitted.samples.placement.scale, rel=0.03)
    gap = np.where(fitted.samples.shadowed, steps_of_16 * 2.0**-16 * (depths.far - depths.near), np.inf)
    needed = bits_of(fitted.samples, replace(depths, gap=gap))
    assert needed is not None and needed.bits == bits
    assert needed.lost[16] == (0.0 if bits == 16 else 1.0)


@pytest.mark.parametrize("elevation", [90.0, 30.0])
def test_the_bias_of_a_plane_is_half_a_texel_on_its_slope(elevation: float) -> None:
    fitted = fitted_to(from_above([plate(50.0)], tilted(elevation), size=256))
    bias = bias_of(fitted)
    assert bias is not None
    # A picture 2 m wide: its depth range along the light is 2 cos 30°, over REFERENCE_SIZE texels less the padding;
    # half of one is the most, and one place in a thousand of lit ones is within a thousandth of it.
    a_texel = 2 * (255 / 256) * math.cos(math.radians(elevation)) / fitted.texels
    assert bias.worst == pytest.approx(a_texel / 2, rel=1e-3, abs=1e-6)
    assert bias.needed == pytest.approx(0.499 * a_texel, rel=2e-3, abs=1e-6)
    assert bias.thinnest is None and bias.bridged is None


def test_every_kind_of_light_has_its_depths(light: Light) -> None:
    fitted = fitted_to(looking([plate(8.0), plate(0.7, (0.0, 0.8, 0.0))], light, size=128))
    depths, bits, bias = fitted.depths, bits_of(fitted.samples, fitted.depths), bias_of(fitted)
    assert (depths.stored >= 0).all() and (depths.stored <= 1).all()
    assert bits is not None and bits.bits == 16
    assert bias is not None and bias.bridged == 0.0
    assert 0 < bias.needed <= bias.worst
    # The derivative of what is stored, by differences.
    z = fitted.stored(fitted.coords)
    order = np.argsort(z)[:: max(1, len(z) // 50)]
    slope = np.diff(depths.stored[order]) / np.diff(z[order])
    middle = (depths.per_length[order][1:] + depths.per_length[order][:-1]) / 2
    np.testing.assert_allclose(slope, middle, rtol=0.05)
