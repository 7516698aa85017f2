"""Penumbra widths, compared with similar triangles."""

import math
from dataclasses import replace

import numpy as np
import pytest

from shadowbench.scenes.model import Light
from shadowbench.survey.penumbra import BULB, SUN, penumbra_of
from shadowbench.survey.sampling import sample_view
from tests.survey.conftest import from_above, plate

ALONG = Light("sun", "directional", (0.5, -1.0, 0.0))
HEIGHT = 0.5
MESHES = [plate(50.0), plate(0.4, (-0.25, HEIGHT, 0.0))]
PIXEL = 2.0 / 256


def test_under_a_plate_it_is_as_wide_as_the_sun_makes_it_and_longer_the_way_the_sun_leans() -> None:
    radius = math.radians(1.0)
    found = penumbra_of(sample_view(from_above(MESHES, replace(ALONG, radius=radius), size=256)))
    assert found is not None and not found.assumed and found.radius == radius
    way, sine = HEIGHT * math.hypot(0.5, 1.0), 1 / math.hypot(0.5, 1.0)
    across = 2 * math.tan(radius) * way
    assert found.median.value == pytest.approx(across / sine / PIXEL, rel=0.01)
    assert found.p95.value == pytest.approx(across / sine / PIXEL, rel=0.01)
    assert not found.hard_is_enough


def test_a_sun_without_a_size_is_taken_as_the_real_one() -> None:
    hard, real = (
        penumbra_of(sample_view(from_above(MESHES, light, size=256))) for light in (ALONG, replace(ALONG, radius=SUN))
    )
    assert hard is not None and real is not None
    assert hard.assumed and not real.assumed and hard.p95 == real.p95
    assert math.degrees(2 * hard.radius) == pytest.approx(0.533)


def test_a_thin_plate_close_to_the_ground_needs_no_soft_shadow() -> None:
    found = penumbra_of(sample_view(from_above([plate(50.0), plate(0.4, (0.0, 0.05, 0.0))], ALONG, size=256)))
    assert found is not None and found.hard_is_enough


@pytest.mark.parametrize("scale", [1.0, 100.0])
def test_the_penumbra_of_a_lamp_follows_from_similar_triangles(scale: float) -> None:
    lamp = Light("lamp", "point", position=(-1.0 * scale, 3.0 * scale, 0.0), radius=0.02 * scale)
    meshes = [plate(50.0 * scale), plate(0.1 * scale, (-0.5 * scale, 1.5 * scale, 0.0))]
    samples = sample_view(from_above(meshes, lamp, size=256, width=2.0 * scale))
    found = penumbra_of(samples)
    assert found is not None and found.radius == pytest.approx(0.02 * scale)
    # Halfway between lamp and ground, so that the shadow is as soft as the lamp is wide, along the ground by 1/sine.
    sine = 3.0 / math.hypot(3.0, 1.0)
    assert found.median.value == pytest.approx(0.04 / sine / PIXEL, rel=0.05)


def test_a_lamp_without_a_size_is_taken_as_a_bulb() -> None:
    lamp = Light("lamp", "point", position=(-1.0, 3.0, 0.0))
    found = penumbra_of(sample_view(from_above([plate(50.0), plate(0.1, (-0.5, 1.5, 0.0))], lamp, size=256)))
    assert found is not None and found.assumed and found.radius == pytest.approx(BULB)


def test_without_a_shadow_there_is_no_penumbra() -> None:
    assert penumbra_of(sample_view(from_above([plate(50.0)]))) is None
    assert np.isfinite(SUN)
