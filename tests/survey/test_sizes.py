"""Footprints of texels, compared with differences and random edges, and the map sizes that follow from them."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from shadowbench.maps.biases import Texel
from shadowbench.scenes.model import Light, Mesh, View
from shadowbench.scenes.opening import chosen_view
from shadowbench.survey.maps import (
    BIAS_STEPS,
    GRAZING_SLOPE,
    LIMIT,
    STEP,
    WRONG,
    CascadeSizes,
    Texels,
    cascades_of,
    depths_of,
    texels_for,
    texels_of,
)
from shadowbench.survey.samples import (
    ANGLES,
    DISPLACEMENTS,
    PADDING,
    REFERENCE_SIZE,
    FittedMap,
    fitted_map,
    longest,
    sample_view,
)
from shadowbench.techniques.shadow_map import ShadowMap
from tests.survey.conftest import SUN, from_above, looking, plate, tilted


def of(view: View) -> tuple[FittedMap, Texels]:
    fitted = fitted_map(sample_view(view))
    return fitted, texels_of(fitted, depths_of(fitted))


def test_jacobian_and_slope_are_the_differences_between_neighbours(light: Light) -> None:
    fitted = fitted_map(sample_view(looking([plate(30.0)], light, size=128)))
    at = fitted.footprint
    grid = np.full((128, 128), -1)
    grid[np.divmod(fitted.samples.pixel, 128)] = np.arange(len(fitted.samples.pixel))
    here = grid[1:-1, 1:-1]
    for axis, (before, after) in enumerate(((grid[1:-1, :-2], grid[1:-1, 2:]), (grid[:-2, 1:-1], grid[2:, 1:-1]))):
        inside = (here >= 0) & (before >= 0) & (after >= 0)
        inside &= (fitted.face[before] == fitted.face[here]) & (fitted.face[after] == fitted.face[here])
        a, b, c = before[inside], here[inside], after[inside]
        assert len(b) > 1000
        moved = (at.coords[:, c] - at.coords[:, a]) / 2
        scale = np.linalg.norm(moved[:2], axis=0)
        np.testing.assert_allclose(at.jacobian[:, axis, b], moved[:2], atol=1e-3 * scale.max())
        along = (at.slope[:, b] * at.jacobian[:, axis, b]).sum(axis=0)
        np.testing.assert_allclose(along, moved[2], atol=2e-3 * np.abs(moved[2]).max() + 1e-9)


def test_the_longest_reach_is_the_reciprocal_of_the_least_singular_value() -> None:
    matrices = np.random.default_rng(1).normal(size=(2, 2, 100))
    least = np.linalg.svd(matrices.transpose(2, 0, 1))[1][:, 1]
    np.testing.assert_allclose(longest(*np.moveaxis(matrices, 1, 0)), 1 / least, rtol=1e-9)


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


@pytest.mark.parametrize("elevation", [90.0, 60.0, 20.0])
def test_a_plane_from_above_needs_as_many_texels_as_pixels_whatever_the_sun(elevation: float) -> None:
    fitted, texels = of(from_above([plate(50.0)], tilted(elevation)))
    # 64 pixel centres lie 63 pixels apart; the fit pads them by 2 texels on each side.
    assert fitted.padding == 2.0
    assert texels.size == pytest.approx(63 + 4, rel=1e-6)
    assert texels.p95 == pytest.approx(63 / (1024 - 4), rel=1e-6)
    assert texels.largest == pytest.approx(63 / (1024 - 4), rel=1e-6)


def test_twice_the_pixels_need_twice_the_texels() -> None:
    meshes = [plate(50.0), plate(0.5, (0.0, 1.0, 0.0))]
    sun = Light("sun", "directional", (0.3, -1.0, 0.2))
    few, many = (of(looking(meshes, sun, size=size))[1] for size in (128, 256))
    assert many.size / few.size == pytest.approx(2.0, rel=0.05)
    assert many.edge_size is not None and few.edge_size is not None
    assert many.edge_size / few.edge_size == pytest.approx(2.0, rel=0.15)


def test_the_needed_size_for_an_edge_on_a_plane_follows_from_its_mean_displacement() -> None:
    sun = Light("sun", "directional", (0.5, -1.0, 0.0))
    _, texels = of(from_above([plate(50.0), plate(0.4, (-0.25, 0.5, 0.0))], sun, size=128))
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
    fitted, texels = of(looking([plate(50.0), wall], sun, 128, (-3.0, 10.0, 0.0), fov=11.4))
    samples = fitted.samples
    inner = np.setdiff1d(np.flatnonzero(samples.shadowed), samples.edges)
    foot = np.abs(samples.point[0, inner] - samples.view.scene.meshes[1].vertices[0, 0]).min()
    # The bias is tan θ · the diagonal of a texel along the ray, which meets the wall after foot · √(1 + 1/slope²).
    needed = slope * np.hypot(*fitted.extent) / (foot * np.hypot(1.0, 1.0 / slope))
    assert texels.edge_size is not None
    assert texels.edge_size - 2 * PADDING == pytest.approx(needed, rel=STEP - 1)


@given(arrays(float, st.integers(1, 50), elements=st.floats(0.01, 1e4)))
def test_the_predicted_map_size_leaves_the_stated_share_of_edge_pixels_wrong(moved: np.ndarray) -> None:
    texels = texels_for(moved)
    assert np.minimum(moved / texels, 1.0).mean() == pytest.approx(WRONG, rel=1e-9)


def test_without_a_shadow_there_is_no_edge_distance() -> None:
    assert of(from_above([plate(50.0)]))[1].edge_size is None


def cascades(view: View) -> CascadeSizes | None:
    fitted, texels = of(view)
    return cascades_of(fitted, depths_of(fitted), texels)


def test_cascades_pay_along_a_street_and_not_over_a_plane_from_above() -> None:
    street = cascades(chosen_view("deep-street", 256))
    assert street is not None and street.worthwhile and street.saving > 10 and street.depth_ratio > 100
    sizes = list(street.edge_size.values())
    assert sizes == sorted(sizes, reverse=True)
    flat = cascades(from_above([plate(50.0), plate(0.5, (0.0, 1.0, 0.0))], SUN, size=128))
    assert flat is not None and not flat.worthwhile and not flat.worthwhile_elsewhere and flat.depth_ratio < 1.2


def test_a_lamp_has_no_cascades() -> None:
    lamp = Light("lamp", "point", position=(1.5, 3.0, -1.0))
    assert cascades(looking([plate(30.0)], lamp)) is None


def test_needs_are_those_of_the_default_shadow_map() -> None:
    params = ShadowMap.Params()
    assert params.filter.radius(params.size) + 1 == PADDING and params.size == REFERENCE_SIZE
    assert params.bias == Texel(ulps=BIAS_STEPS, limit=LIMIT, grazing=GRAZING_SLOPE)
