"""How large a map must be: its texels against the picture's pixels."""

from dataclasses import dataclass

import numpy as np

from shadowbench.scenes.model import Floats
from shadowbench.survey.footprint import Footprint
from shadowbench.survey.maps import REFERENCE_SIZE, FittedMap
from shadowbench.survey.rays import Indices
from shadowbench.survey.sampling import Estimate

WRONG = 0.05  # share of a shadow's edge pixels that may be off: beyond it `edge_p95` is a pixel and more


@dataclass(frozen=True)
class Texels:
    """How pixels and texels compare, of a fitted map or of a cube's face.

    largest, p95: pixels that a texel of a map of REFERENCE_SIZE reaches over what is seen, and over 95% of it; size: of
    a map whose texel is at most a pixel over 95%; edge_size: of one that is right at 95% of the shadows' edge pixels,
    so that `edge_p95` is below 1, None without an edge; faces: 6 for a cube.
    """

    largest: Estimate
    p95: Estimate
    size: Estimate
    edge_size: Estimate | None
    faces: int


def texels_of(fitted: FittedMap) -> Texels:
    """How large one map, or a cube, must be."""
    samples, everything = fitted.samples, fitted.all_samples
    p95 = samples.estimate(lambda chosen: float(np.percentile(fitted.reach[chosen], 95)), everything)
    # A largest value has no standard error: what was not looked at may exceed it.
    largest = Estimate(float(fitted.reach.max()), None if samples.step > 1 else 0.0)
    return Texels(
        largest=largest.times(1 / fitted.texels(REFERENCE_SIZE)),
        p95=p95.times(1 / fitted.texels(REFERENCE_SIZE)),
        size=p95.plus(2 * fitted.padding),
        edge_size=edge_size(fitted, fitted.unit),
        faces=6 if fitted.space is None else 1,
    )


def edge_size(fitted: FittedMap, unit: Footprint) -> Estimate | None:
    """The size at which no more than WRONG of the shadows' edge pixels are off; None where no shadow ends.

    unit: the samples' footprint where a unit is the window that answers for each.
    """
    samples = fitted.samples
    if not len(samples.edges):
        return None
    moved = unit.select(samples.edges).displacement
    row = np.zeros(len(samples.pixel), dtype=np.intp)
    row[samples.edges] = np.arange(len(samples.edges))

    def needed(chosen: Indices) -> float:
        return texels_for(moved[row[chosen]])

    return samples.estimate(needed, samples.edges).plus(2 * fitted.padding)


def texels_for(moved: Floats) -> float:
    """The texels across a window that bring the mean of min(moved / texels, 1), the share of wrong pixels, to WRONG.

    moved: pixels that edges are off when the window is one texel, of any shape, above 0. Exact: with the k least of
    them below `texels` and the rest saturated, the share of n is (their sum / texels + n − k) / n.
    """
    ordered = np.sort(moved.ravel())
    count = len(ordered)
    before = np.concatenate([[0.0], np.cumsum(ordered)[:-1]])
    share = (before / ordered + np.arange(count, 0, -1)) / count  # were there as many texels as each value
    k = int(np.flatnonzero(share > WRONG)[-1]) + 1  # at the least value all are wrong
    return float(ordered[:k].sum()) / (WRONG * count - (count - k))
