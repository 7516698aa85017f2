"""Needed map sizes that follow from the image size alone."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from shadowbench.maps.biases import Texel
from shadowbench.scenes.model import Light, Mesh, View
from shadowbench.scenes.opening import chosen_view
from shadowbench.survey import sampling
from shadowbench.survey.depth import BIAS_STEPS
from shadowbench.survey.explanations import explanations_of, verdict_of
from shadowbench.survey.maps import ANGLES, DISPLACEMENTS, PADDING, REFERENCE_SIZE, FittedMap, fitted_map
from shadowbench.survey.sampling import sample_view
from shadowbench.survey.survey import needs
from shadowbench.survey.texels import (
    GRAZING_SLOPE,
    LIMIT,
    STEP,
    WRONG,
    CascadeSizes,
    Texels,
    cascades_of,
    texels_for,
    texels_of,
)
from shadowbench.techniques.shadow_map import ShadowMap
from tests.survey.conftest import SUN, box, from_above, looking, plate, tilted


def of(view: View) -> tuple[FittedMap, Texels]:
    fitted = fitted_map(sample_view(view))
    return fitted, texels_of(fitted)


@pytest.mark.parametrize("elevation", [90.0, 60.0, 20.0])
def test_a_plane_from_above_needs_as_many_texels_as_pixels_whatever_the_sun(elevation: float) -> None:
    fitted, texels = of(from_above([plate(50.0)], tilted(elevation)))
    # 64 pixel centres lie 63 pixels apart; the fit pads them by 2 texels on each side.
    assert fitted.padding == 2.0
    assert texels.size.value == pytest.approx(63 + 4, rel=1e-6)
    assert texels.p95.value == pytest.approx(63 / (1024 - 4), rel=1e-6)
    assert texels.largest.value == pytest.approx(63 / (1024 - 4), rel=1e-6)


def test_twice_the_pixels_need_twice_the_texels() -> None:
    meshes = [plate(50.0), plate(0.5, (0.0, 1.0, 0.0))]
    sun = Light("sun", "directional", (0.3, -1.0, 0.2))
    few, many = (of(looking(meshes, sun, size=size))[1] for size in (128, 256))
    assert many.size.value / few.size.value == pytest.approx(2.0, rel=0.05)
    assert many.edge_size is not None and few.edge_size is not None
    assert many.edge_size.value / few.edge_size.value == pytest.approx(2.0, rel=0.15)


def test_the_needed_size_for_an_edge_on_a_plane_follows_from_its_mean_displacement() -> None:
    sun = Light("sun", "directional", (0.5, -1.0, 0.0))
    _, texels = of(from_above([plate(50.0), plate(0.4, (-0.25, 0.5, 0.0))], sun, size=128))
    # Texels as long as pixels, an edge of any direction: its displacement along a row or column, averaged, is the
    # integral of DISPLACEMENTS / max(|sin|, |cos|); so many texels a pixel bring it to WRONG.
    angles = (np.arange(3600) + 0.5) * np.pi / 7200
    off = np.interp(np.minimum(angles, np.pi / 2 - angles), ANGLES, DISPLACEMENTS)
    mean = float((off / np.maximum(np.sin(angles), np.cos(angles))).mean())
    assert texels.edge_size is not None
    assert (texels.edge_size.value - 4) / 127 == pytest.approx(mean / WRONG, rel=0.01)


def test_a_shadow_at_its_caster_s_foot_needs_texels_until_the_bias_does_not_light_it() -> None:
    """A wall in low light: its shadow is a strip, lit as far from the wall as the bias of a slope of 10 reaches."""
    height, slope = 0.05, 10.0
    corners = np.array([[0.0, 0.0, -25.0], [0.0, 0.0, 25.0], [0.0, height, 25.0], [0.0, height, -25.0]])
    wall = Mesh("wall", corners, np.array([[0, 1, 2], [0, 2, 3]], dtype=np.int32), receives=False)
    sun = Light("sun", "directional", (slope, -1.0, 0.0))
    fitted, texels = of(from_above([plate(50.0), wall], sun, size=128))
    samples = fitted.samples
    inner = np.setdiff1d(np.flatnonzero(samples.shadowed), samples.edges)
    foot = np.abs(samples.point[0, inner] - samples.view.scene.meshes[1].vertices[0, 0]).min()
    # The bias is tan θ · the diagonal of a texel along the ray, which meets the wall after foot · √(1 + 1/slope²).
    needed = slope * np.hypot(*fitted.extent) / (foot * np.hypot(1.0, 1.0 / slope))
    assert texels.edge_size is not None
    assert texels.edge_size.value - 2 * PADDING == pytest.approx(needed, rel=STEP - 1)


@given(arrays(float, st.integers(1, 50), elements=st.floats(0.01, 1e4)))
def test_the_predicted_map_size_leaves_the_stated_share_of_edge_pixels_wrong(moved: np.ndarray) -> None:
    texels = texels_for(moved)
    assert np.minimum(moved / texels, 1.0).mean() == pytest.approx(WRONG, rel=1e-9)


def test_without_a_shadow_there_is_no_edge_distance() -> None:
    assert of(from_above([plate(50.0)]))[1].edge_size is None


def test_the_standard_error_of_a_sample_covers_the_value_of_all_pixels(monkeypatch: pytest.MonkeyPatch) -> None:
    view = looking([plate(50.0), box(1.0, (0.0, 0.5, 0.0)), box(0.5, (1.0, 0.25, 0.5))],
                   Light("sun", "directional", (0.5, -1.0, -0.3)), size=512)  # fmt: skip
    whole = of(view)[1]
    monkeypatch.setattr(sampling, "LATTICE", 128)
    part = of(view)[1]
    assert whole.size.error == 0.0 and whole.edge_size is not None and whole.edge_size.error == 0.0
    assert part.size.error and part.edge_size is not None and part.edge_size.error
    # The box of what is seen is a little smaller where fewer pixels are looked at: 4 of 512.
    assert part.size.value == pytest.approx(whole.size.value, abs=4 * part.size.error + 0.01 * whole.size.value)
    assert part.edge_size.value == pytest.approx(
        whole.edge_size.value, abs=4 * part.edge_size.error + 0.01 * whole.edge_size.value
    )


def cascades(view: View) -> CascadeSizes | None:
    return cascades_of(*of(view))


def test_cascades_pay_along_a_street_and_not_over_a_plane_from_above() -> None:
    street = cascades(chosen_view("deep-street", 256))
    assert street is not None and street.worthwhile and street.saving > 10 and street.depth_ratio > 100
    sizes = list(street.edge_size.values())
    assert sizes == sorted(sizes, reverse=True)
    flat = cascades(from_above([plate(50.0), plate(0.5, (0.0, 1.0, 0.0))], SUN, size=128))
    assert flat is not None and not flat.worthwhile and not flat.worthwhile_elsewhere and flat.depth_ratio < 1.2


def test_a_gain_for_the_whole_view_is_told_where_all_edges_are_at_one_distance() -> None:
    """By the receivers' texels, two maps or more of a size need fewer than one, though not by the edges."""
    view = chosen_view("statue", 192)
    found = cascades(view)
    assert found is not None and not found.worthwhile and found.worthwhile_elsewhere
    texels = found.best_by_size * found.size[found.best_by_size] ** 2
    one = of(view)[1].size.value
    assert texels < one**2 and found.saving_by_size == pytest.approx(one**2 / texels)
    needed = needs(view, penumbrae=False)
    reasons = {row.need: row.reason for row in explanations_of(needed)}
    assert reasons["cascades save"].startswith("no gain for the edges in view, but for texels of a pixel on 95%")
    assert "no cascades" not in verdict_of(needed) and "cascades for shadows elsewhere" in verdict_of(needed)


def test_a_lamp_has_no_cascades() -> None:
    lamp = Light("lamp", "point", position=(1.5, 3.0, -1.0))
    assert cascades(looking([plate(30.0)], lamp)) is None


def test_needs_are_those_of_the_default_shadow_map() -> None:
    params = ShadowMap.Params()
    assert params.filter.radius(params.size) + 1 == PADDING and params.size == REFERENCE_SIZE
    assert params.bias == Texel(ulps=BIAS_STEPS, limit=LIMIT, grazing=GRAZING_SLOPE)
