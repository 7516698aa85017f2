"""Depth gaps, formats, biases and penumbrae for which closed forms exist."""

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from shadowbench.measure.scoring import prepare_truth
from shadowbench.scenes.assumed import sunlit
from shadowbench.scenes.model import SUN_RADIUS, Light, LightShape, View
from shadowbench.scores.metrics import ranking, score
from shadowbench.survey.maps import (
    BULB,
    HARD_RMSE,
    BiasNeed,
    DepthBits,
    Penumbra,
    bias_of,
    bits_of,
    depths_of,
    penumbra_of,
)
from shadowbench.survey.samples import REFERENCE_SIZE, FittedMap, fitted_map, sample_view
from shadowbench.truths.trace import trace
from tests.survey.conftest import from_above, looking, plate, tilted


def of(view: View) -> tuple[FittedMap, DepthBits | None, BiasNeed | None]:
    fitted = fitted_map(sample_view(view))
    depths = depths_of(fitted)
    return fitted, bits_of(fitted, depths), bias_of(fitted, depths)


@pytest.mark.parametrize("scale", [1e-3, 1.0, 1e4])
def test_the_gap_under_a_plate_is_its_height_along_the_ray(scale: float) -> None:
    meshes = [plate(50.0 * scale), plate(0.5 * scale, (-0.5 * scale, 0.3 * scale, 0.0))]
    _, bits, bias = of(from_above(meshes, tilted(30.0), width=2.0 * scale, size=128))
    assert bits is not None and bias is not None and bias.thinnest is not None
    assert bits.closest == pytest.approx(0.6 * scale, rel=1e-4)
    assert bias.thinnest == pytest.approx(0.6 * scale, rel=1e-4)


@pytest.mark.parametrize(("steps_of_16", "bits"), [(8.0, 16), (2.0, 24), (2.0 / 256, None)])
def test_the_depth_format_follows_from_the_gap_in_depth_steps(steps_of_16: float, bits: int | None) -> None:
    """The ground seen is 2 m wide under a sun at 45°: depths range over √2 m, and a little more for the fit."""
    fitted = fitted_map(sample_view(from_above([plate(50.0), plate(0.5, (-0.5, 0.3, 0.0))], tilted(45.0), size=128)))
    depths = depths_of(fitted)
    assert depths.far - depths.near == pytest.approx(math.sqrt(2) * fitted.samples.placement.scale, rel=0.03)
    gap = np.where(fitted.samples.shadowed, steps_of_16 * 2.0**-16 * (depths.far - depths.near), np.inf)
    found = bits_of(fitted, replace(depths, gap=gap))
    assert found is not None and found.bits == bits
    assert found.lost[16] == (0.0 if bits == 16 else 1.0)


def test_the_bias_of_a_plane_is_half_a_texel_on_its_slope() -> None:
    fitted, _, bias = of(from_above([plate(50.0)], tilted(30.0), size=256))
    assert bias is not None
    # A picture 2 m wide: its depth range along the light is 2 cos 30°, over REFERENCE_SIZE texels less the padding;
    # half of one is the most, and one place in a thousand of lit ones is within a thousandth of it.
    a_texel = 2 * (255 / 256) * math.cos(math.radians(30)) / fitted.texels(REFERENCE_SIZE)
    assert bias.worst == pytest.approx(a_texel / 2, rel=1e-3)
    assert bias.needed == pytest.approx(0.499 * a_texel, rel=2e-3)
    assert bias.thinnest is None and bias.bridged is None


def test_a_plane_that_faces_the_sun_needs_no_bias_and_a_lower_sun_more() -> None:
    biases = [of(from_above([plate(50.0)], tilted(elevation)))[2] for elevation in (90.0, 70.0, 40.0, 10.0)]
    needed = [bias.needed for bias in biases if bias is not None]
    assert len(needed) == 4 and needed == sorted(needed) and needed[0] == pytest.approx(0.0, abs=1e-6)


def test_every_kind_of_light_has_its_depths(light: Light) -> None:
    fitted, bits, bias = of(looking([plate(8.0), plate(0.7, (0.0, 0.8, 0.0))], light, size=128))
    depths = depths_of(fitted)
    assert (depths.stored >= 0).all() and (depths.stored <= 1).all()
    assert bits is not None and bits.bits == 16
    assert bias is not None and bias.bridged is not None and bias.bridged == 0.0
    assert 0 < bias.needed <= bias.worst
    # The derivative of what is stored, by differences.
    z = fitted.stored(fitted.footprint.coords)
    order = np.argsort(z)[:: max(1, len(z) // 50)]
    slope = np.diff(depths.stored[order]) / np.diff(z[order])
    middle = (depths.per_length[order][1:] + depths.per_length[order][:-1]) / 2
    np.testing.assert_allclose(slope, middle, rtol=0.05)


ALONG = Light("sun", "directional", (0.5, -1.0, 0.0))
HEIGHT, PIXEL = 0.5, 2.0 / 256
MESHES = [plate(50.0), plate(0.4, (-0.25, HEIGHT, 0.0))]


def penumbra(view: View) -> Penumbra:
    needed = penumbra_of(view, sample_view(view))
    assert needed is not None
    return needed


def test_under_a_plate_it_is_as_wide_as_the_sun_makes_it_and_longer_the_way_the_sun_leans() -> None:
    needed = penumbra(from_above(MESHES, replace(ALONG, radius=math.radians(1.0)), size=256))
    assert not needed.assumed and needed.radius == math.radians(1.0)
    distance, sine = HEIGHT * math.hypot(0.5, 1.0), 1 / math.hypot(0.5, 1.0)
    across = 2 * math.tan(math.radians(1.0)) * distance
    assert (needed.median, needed.p95) == pytest.approx((across / sine / PIXEL,) * 2, rel=0.01)


@pytest.mark.parametrize("scale", [1.0, 100.0])
def test_the_penumbra_of_a_lamp_follows_from_similar_triangles(scale: float) -> None:
    lamp = Light("lamp", "point", position=(-1.0 * scale, 3.0 * scale, 0.0), radius=0.02 * scale)
    meshes = [plate(50.0 * scale), plate(0.1 * scale, (-0.5 * scale, 1.5 * scale, 0.0))]
    needed = penumbra(from_above(meshes, lamp, size=256, width=2.0 * scale))
    # Halfway between lamp and ground, so that the shadow is as soft as the lamp is wide, along the ground by 1/sine.
    sine = 3.0 / math.hypot(3.0, 1.0)
    assert needed.median == pytest.approx(0.04 / sine / PIXEL, rel=0.05)


@pytest.mark.parametrize("kind", ["directional", "point", "rectangle"])
def test_a_light_without_a_size_is_taken_as_the_sun_or_a_bulb(kind: LightShape) -> None:
    light = Light("lamp", kind, (0.1, -1.0, 0.0), (-0.4, 3.0, 0.0), math.radians(60.0))
    needed = penumbra(from_above([plate(50.0), plate(0.1, (-0.2, 1.5, 0.0))], light, size=128))
    assert needed.assumed and needed.radius == pytest.approx(SUN_RADIUS if kind == "directional" else BULB)


@pytest.mark.parametrize("name", ["post", "cube-on-plane"])
def test_the_error_of_hard_shadows_is_the_rmse_of_the_truth_s_own_arrays(
    name: str, builtin: Callable[..., View]
) -> None:
    """Of the scene's own light, or under the sun that is assumed; the centre's visibility is the best that is hard."""
    view = builtin(name, 128)
    needed, sized = penumbra(view), sunlit(view.light)
    soft, hard = (trace(replace(view, light=one)) for one in (sized, replace(sized, radius=0.0, size=(0.0, 0.0))))
    assert needed.hard_rmse == score(hard.visibility, prepare_truth(soft))["rmse"]
    scored = soft.receivers & ~soft.undecided
    partly = scored & (soft.visibility > 0) & (soft.visibility < 1)
    assert needed.share == pytest.approx(partly.sum() / (scored & (soft.visibility < 1)).sum())
    assert ranking(soft=True).targets[1] == HARD_RMSE and needed.hard_is_enough == (needed.hard_rmse <= HARD_RMSE)


def test_without_a_shadow_there_is_no_penumbra() -> None:
    view = from_above([plate(50.0)])
    assert penumbra_of(view, sample_view(view)) is None
