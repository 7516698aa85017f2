"""Whether the standard errors of soft truths mean what they say, and what else holds of them on real scenes."""

import math
from dataclasses import replace

import numpy as np
import pytest

from shadowbench.scenes.model import Light, View
from shadowbench.scenes.opening import chosen_view
from shadowbench.scenes.vectors import Floats
from shadowbench.truths.light_samples import MOST_SAMPLES, _tables, scrambles_of
from shadowbench.truths.rays import Receivers, ViewRays
from shadowbench.truths.soft import REPLICATIONS, Estimator, Sums, estimate, find_penumbra
from shadowbench.truths.trace import OFFSET, STANDARD_ERROR
from tests.samples import todays

STUDENT, SHARE = 4.44, 0.997  # of Student's t with 7 degrees of freedom, 99.7% lies within it
SCRAMBLES = 64
PIXELS = 160  # of each view, about: whole rows, so that most have a neighbour


def softened(name: str, size: int, radius: float) -> View:
    """A built-in scene under its own light, with a radius in metres, of a sun in radians."""
    view = chosen_view(name, size)
    return replace(view, light=replace(view.light, radius=radius))


def panelled(name: str, size: int) -> View:
    """A built-in scene under a rectangle in place of its lamp, which shines down."""
    view = chosen_view(name, size)
    panel = Light("panel", "rectangle", (0.1, -1.0, 0.05), view.light.position, size=(0.6, 0.3), up=(1.0, 0.0, 0.0))
    return replace(view, light=panel)


def receivers_of(view: View) -> tuple[ViewRays, Receivers]:
    placed, _ = view.placed()
    rays = ViewRays(placed)
    lines = rays.camera_rays(slice(0, view.size.height))
    return rays, rays.receivers(lines, rays.nearest(lines))


def neighbours(errors: Floats, pixels: np.ndarray, width: int) -> float:
    """Correlation of the errors of horizontal neighbours; errors: (scrambles, pixels)."""
    image = np.full((len(errors), width * width), np.nan)
    image[:, pixels] = errors
    image = image.reshape(len(errors), width, width)
    return float(np.nanmean(image[:, :, 1:] * image[:, :, :-1]) / np.nanmean(image**2))


def deviations(view: View) -> Floats:
    """(SCRAMBLES, pixels) z-scores in a view's penumbra against a reference of 65,536 points."""
    light = view.placed()[0].light
    rays, receivers = receivers_of(view)
    pilot, _ = find_penumbra(Estimator(rays, light, OFFSET), receivers, view.size)
    soft = np.flatnonzero((pilot > 0.02) & (pilot < 0.98))
    rows = receivers.rays[soft] // view.size.width
    receivers = receivers.select(soft[rows % math.ceil(len(soft) / PIXELS) == 0])
    reference = [
        Estimator(rays, light, OFFSET, SCRAMBLES + part).sums(receivers, MOST_SAMPLES, REPLICATIONS, 0)
        for part in range(2)
    ]
    best = np.mean([sums.visibility for sums in reference], axis=0)
    best_error = np.sqrt(sum(sums.spread**2 for sums in reference)) / 2
    soft = (best > 0.02) & (best < 0.98)
    receivers, best, best_error = receivers.select(soft), best[soft], best_error[soft]
    found = [estimate(Estimator(rays, light, OFFSET, seed), receivers, STANDARD_ERROR) for seed in range(SCRAMBLES)]
    values, errors = (np.array([each[part] for each in found]) for part in range(2))
    assert len(best) > 50
    assert abs(neighbours(values - best, receivers.rays, view.size.width)) < 0.05
    assert (errors < STANDARD_ERROR).mean() >= 0.95
    z: Floats = (values - best) / np.hypot(errors, best_error)
    return z


class Blind(Estimator):
    """Traces no ray: from `enough` points of the light on half of it is seen everywhere, with fewer all of it.

    Notes each set of points that it would draw for a receiver.
    """

    def __init__(self, enough: int) -> None:
        self.enough, self.drawn = enough, []

    def sums(
        self, receivers: Receivers, samples: int, replications: int, purpose: int, along_normal: bool = False
    ) -> Sums:
        drawn = scrambles_of(receivers.rays, replications, purpose)
        self.drawn.append({tuple(each) for each in drawn.reshape(3, -1).T.tolist()})
        weight = np.ones((len(receivers.rays), replications))
        seen = np.linspace(0, 1, replications) if replications > 1 else 0.5
        return Sums(weight, weight * (seen if samples >= self.enough else 1.0), weight, weight)


@pytest.mark.parametrize(("enough", "warnings"), [(256, 0), (257, 1)])
def test_a_penumbra_that_the_audit_finds_and_256_points_do_not_is_said_once(enough, warnings, caplog) -> None:
    """Nor is one that the audit, of 1024 points and four replications, does not find."""
    view = chosen_view("cube-on-plane", 64)
    _, receivers = receivers_of(view)
    find_penumbra(Blind(enough), receivers, view.size)
    assert [record.levelname for record in caplog.records] == ["WARNING"] * warnings
    assert all("that 256 points of the light do not show" in record.message for record in caplog.records)


def test_no_point_of_the_estimate_is_one_of_the_pilots() -> None:
    """Else the pilot, which decides on their number, would stop where they happen to agree: errors look too small."""
    view = chosen_view("cube-on-plane", 16)
    _, receivers = receivers_of(view)
    blind = Blind(1)
    find_penumbra(blind, receivers, view.size)
    estimate(blind, receivers, STANDARD_ERROR)
    *pilots, fresh = blind.drawn
    assert len(pilots) >= 2 and fresh
    assert not any(fresh & pilot for pilot in pilots)


def test_errors_are_independent_between_neighbours_and_as_large_as_told() -> None:
    view = softened("cube-on-plane", 48, math.radians(2.0))
    rays, receivers = receivers_of(view)
    light = view.placed()[0].light

    def sums(chosen: Receivers, samples: int, replications: int, seed: int) -> Sums:
        return Estimator(rays, light, OFFSET, seed).sums(chosen, samples, replications, 0)

    pilot = sums(receivers, 64, 1, 98).visibility
    chosen = receivers.select((pilot > 0.05) & (pilot < 0.95))
    best = sums(chosen, 4096, 8, 99).visibility
    found = [sums(chosen, 64, REPLICATIONS, seed) for seed in range(16)]
    wrong = np.array([each.visibility - best for each in found])
    z = wrong / np.maximum([each.spread for each in found], 1 / 512)
    assert len(best) > 50
    assert 1.0 < z.var() < 1.7
    assert abs(neighbours(wrong, chosen.rays, view.size.width)) < 0.1


@pytest.mark.slow
def test_errors_are_as_their_replications_say() -> None:
    suns = [softened(name, 64, math.radians(degrees)) for name, degrees in (("colonnade", 2.0), ("stairs", 10.0))]
    lamps = [softened(name, 64, metres) for name, metres in (("spot-lamp", 0.2), ("lamp-by-wall", 0.03))]
    views = [*suns, *lamps, panelled("room-with-lamp", 64)]
    all_scores = [deviations(view) for view in todays(views, 2)]
    assert all(1.2 <= scores.var() <= 1.6 for scores in all_scores)
    pooled = np.concatenate([scores.ravel() for scores in all_scores])
    assert (np.abs(pooled) < STUDENT).mean() >= SHARE


def test_the_first_points_of_each_table_fall_once_into_each_box_of_their_number() -> None:
    """Boxes of 2⁻ᵃ × 2⁻ᵇ with 2ᵃ⁺ᵇ points, as those of Sobol (1967) do, however they are scrambled."""
    for x, y in _tables().astype(np.uint64):
        for a, b in np.ndindex(6, 6):
            boxes = (x[: 2 ** (a + b)] >> (32 - a)) << b | y[: 2 ** (a + b)] >> (32 - b)
            assert len(np.unique(boxes)) == 2 ** (a + b)
