"""Penumbra widths, compared with similar triangles."""

import math
from dataclasses import replace

import numpy as np
import pytest

from shadowbench.measure.scoring import prepare_truth
from shadowbench.scenes.assumed import sunlit
from shadowbench.scenes.model import SUN_RADIUS, Light, Mesh, View
from shadowbench.scores.metrics import ranking, score
from shadowbench.survey.penumbra import BULB, HARD_RMSE, Penumbra, penumbra_of
from shadowbench.survey.sampling import sample_view
from shadowbench.truths.trace import trace
from tests.survey.conftest import from_above, plate

ALONG = Light("sun", "directional", (0.5, -1.0, 0.0))
HEIGHT = 0.5
MESHES = [plate(50.0), plate(0.4, (-0.25, HEIGHT, 0.0))]
PIXEL = 2.0 / 256


def found_in(view: View) -> Penumbra | None:
    return penumbra_of(view, sample_view(view))


def test_under_a_plate_it_is_as_wide_as_the_sun_makes_it_and_longer_the_way_the_sun_leans() -> None:
    radius = math.radians(1.0)
    found = found_in(from_above(MESHES, replace(ALONG, radius=radius), size=256))
    assert found is not None and not found.assumed and found.radius == radius
    way, sine = HEIGHT * math.hypot(0.5, 1.0), 1 / math.hypot(0.5, 1.0)
    across = 2 * math.tan(radius) * way
    assert found.median.value == pytest.approx(across / sine / PIXEL, rel=0.01)
    assert found.p95.value == pytest.approx(across / sine / PIXEL, rel=0.01)


def test_a_sun_without_a_size_is_taken_as_the_real_one() -> None:
    hard, real = (found_in(from_above(MESHES, light, size=256)) for light in (ALONG, replace(ALONG, radius=SUN_RADIUS)))
    assert hard is not None and real is not None
    assert hard.assumed and not real.assumed and hard.p95 == real.p95
    assert math.degrees(2 * hard.radius) == pytest.approx(0.533)


def test_a_thin_plate_close_to_the_ground_needs_no_soft_shadow() -> None:
    found = found_in(from_above([plate(50.0), plate(0.4, (0.0, 0.05, 0.0))], ALONG, size=256))
    assert found is not None and found.hard_is_enough


def slat(x: float) -> Mesh:
    flat = plate(1.0)
    return Mesh("slat", flat.vertices * (0.02, 1.0, 2.0) + (x, HEIGHT, 0.0), flat.faces)


@pytest.mark.parametrize(
    ("casters", "size", "narrow", "enough"),
    [
        ([slat(x) for x in np.linspace(-0.9, 0.9, 10)], 64, True, False),
        ([plate(0.1, (0, HEIGHT, 0))], 256, False, True),
    ],
    ids=["slats", "plate"],
)
def test_whether_hard_shadows_suffice_follows_from_their_error(
    casters: list[Mesh], size: int, narrow: bool, enough: bool
) -> None:
    """Penumbrae narrower than a pixel of many slats are a large error, wider ones of a small plate a small error."""
    sun = replace(ALONG, radius=math.radians(0.5))
    found = found_in(from_above([plate(50.0), *casters], sun, size=size))
    assert found is not None and ranking(soft=True).targets[1] == HARD_RMSE
    assert ((found.p95.value < 1), (found.hard_rmse.value <= HARD_RMSE)) == (narrow, enough)
    assert found.hard_is_enough == enough


@pytest.mark.parametrize("scale", [1.0, 100.0])
def test_the_penumbra_of_a_lamp_follows_from_similar_triangles(scale: float) -> None:
    lamp = Light("lamp", "point", position=(-1.0 * scale, 3.0 * scale, 0.0), radius=0.02 * scale)
    meshes = [plate(50.0 * scale), plate(0.1 * scale, (-0.5 * scale, 1.5 * scale, 0.0))]
    found = found_in(from_above(meshes, lamp, size=256, width=2.0 * scale))
    assert found is not None and found.radius == pytest.approx(0.02 * scale)
    # Halfway between lamp and ground, so that the shadow is as soft as the lamp is wide, along the ground by 1/sine.
    sine = 3.0 / math.hypot(3.0, 1.0)
    assert found.median.value == pytest.approx(0.04 / sine / PIXEL, rel=0.05)


@pytest.mark.parametrize("kind", ["point", "disc", "rectangle", "spot"])
def test_a_lamp_without_a_size_is_taken_as_a_bulb(kind: str) -> None:
    light = Light("lamp", kind, (0.0, -1.0, 0.0), (-0.4, 3.0, 0.0), math.radians(60.0))
    found = found_in(from_above([plate(50.0), plate(0.1, (-0.2, 1.5, 0.0))], light, size=128))
    assert found is not None and found.assumed and found.radius == pytest.approx(BULB)


SLOW = pytest.mark.slow


@pytest.mark.parametrize(
    "name", ["post", pytest.param("shade", marks=SLOW), pytest.param("window", marks=SLOW), "cube-on-plane", "fence"]
)
def test_the_error_of_hard_shadows_is_the_rmse_of_the_truth_s_own_arrays(name: str, builtin) -> None:
    """Of the scene's own light, or under the sun that is assumed; the centre's visibility is the best that is hard."""
    view = builtin(name, 128)
    found = found_in(view)
    assert found is not None and found.assumed == (not view.light.soft)
    light = sunlit(view.light)
    soft, hard = (trace(replace(view, light=one)) for one in (light, replace(light, radius=0.0, size=(0.0, 0.0))))
    scored = soft.receivers & ~soft.undecided
    assert found.hard_rmse.value == score(hard.visibility, prepare_truth(soft))["rmse"] and found.hard_rmse.error == 0
    penumbra = scored & (soft.visibility > 0) & (soft.visibility < 1)
    squared = (((soft.visibility - hard.visibility) ** 2)[scored]).sum() - (soft.standard_error[penumbra] ** 2).sum()
    assert found.hard_rmse.value == pytest.approx(math.sqrt(squared / scored.sum()), rel=1e-4)
    assert found.share.value == pytest.approx(penumbra.sum() / (scored & (soft.visibility < 1)).sum())


@pytest.mark.slow
def test_of_a_large_view_some_pixels_say_how_wrong_hard_shadows_are(builtin) -> None:
    large, small = (found_in(builtin("post", size)) for size in (700, 250))
    assert large is not None and small is not None
    assert large.hard_rmse.error > 2 * small.hard_rmse.error, "a part of the pixels stands for all"
    assert large.hard_rmse.value == pytest.approx(small.hard_rmse.value, abs=4 * large.hard_rmse.error)


def test_without_a_shadow_there_is_no_penumbra() -> None:
    assert found_in(from_above([plate(50.0)])) is None
