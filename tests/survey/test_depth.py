"""Depth gaps, formats and biases for which closed forms exist."""

import math
from dataclasses import replace

import numpy as np
import pytest

from shadowbench.scenes.model import Light, View
from shadowbench.survey.depth import BiasNeed, DepthBits, bias_of, bits_of, depths_of
from shadowbench.survey.maps import REFERENCE_SIZE, FittedMap, fitted_map
from shadowbench.survey.sampling import sample_view
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
    assert bits.closest.value == pytest.approx(0.6 * scale, rel=1e-4)
    assert bias.thinnest.value == pytest.approx(0.6 * scale, rel=1e-4)


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
    assert bias.needed.value == pytest.approx(0.499 * a_texel, rel=2e-3)
    assert bias.thinnest is None and bias.bridged is None


def test_a_plane_that_faces_the_sun_needs_no_bias() -> None:
    _, _, bias = of(from_above([plate(50.0)]))
    assert bias is not None and bias.needed.value == pytest.approx(0.0, abs=1e-6)


def test_a_lower_sun_needs_more_bias() -> None:
    biases = [of(from_above([plate(50.0)], tilted(elevation)))[2] for elevation in (70.0, 40.0, 10.0)]
    needed = [bias.needed.value for bias in biases if bias is not None]
    assert len(needed) == 3 and needed == sorted(needed)


def test_every_kind_of_light_has_its_depths(light: Light) -> None:
    fitted, bits, bias = of(looking([plate(8.0), plate(0.7, (0.0, 0.8, 0.0))], light, size=128))
    depths = depths_of(fitted)
    assert (depths.stored >= 0).all() and (depths.stored <= 1).all()
    assert bits is not None and bits.bits == 16
    assert bias is not None and bias.bridged is not None and bias.bridged.value == 0.0
    assert 0 < bias.needed.value <= bias.worst
    # The derivative of what is stored, by differences.
    z = fitted.footprint.coords[2]
    order = np.argsort(z)[:: max(1, len(z) // 50)]
    slope = np.diff(depths.stored[order]) / np.diff(z[order])
    middle = (depths.per_length[order][1:] + depths.per_length[order][:-1]) / 2
    np.testing.assert_allclose(slope, middle, rtol=0.05)
