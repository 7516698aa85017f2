"""The map size that a view needs, from the extent of texels in pixels."""

from dataclasses import dataclass

import numpy as np

from shadowbench.scenes.model import Floats
from shadowbench.survey.footprint import Footprint
from shadowbench.survey.maps import REFERENCE_SIZE, FittedMap
from shadowbench.survey.rays import Indices
from shadowbench.survey.sampling import Estimate

WRONG = 0.05  # tolerated share of wrong edge pixels; above it `edge_p95` is at least a pixel


@dataclass(frozen=True)
class Texels:
    """Extents of texels, and needed sizes, of a fitted map or of a cube's face.

    largest, p95: maximum and 95th percentile, over the visible receivers, of a texel's extent in pixels, for a map of
    REFERENCE_SIZE; size: map size at which the 95th percentile is one pixel; edge_size: map size at which 95% of the
    shadows' edge pixels are right, so that `edge_p95` is below 1, None without edges; faces: 6 for a cube, else 1.
    """

    largest: Estimate
    p95: Estimate
    size: Estimate
    edge_size: Estimate | None
    faces: int


def texels_of(fitted: FittedMap) -> Texels:
    """The needed size of one map, or of a cube's faces."""
    samples, everything = fitted.samples, fitted.all_samples
    p95 = samples.estimate(lambda chosen: float(np.percentile(fitted.single_texel_extent[chosen], 95)), everything)
    # A maximum has no standard error: a pixel that was not sampled may exceed it.
    largest = Estimate(float(fitted.single_texel_extent.max()), None if samples.step > 1 else 0.0)
    return Texels(
        largest=largest.times(1 / fitted.texels(REFERENCE_SIZE)),
        p95=p95.times(1 / fitted.texels(REFERENCE_SIZE)),
        size=p95.plus(2 * fitted.padding),
        edge_size=edge_size(fitted, fitted.unit),
        faces=6 if fitted.space is None else 1,
    )


def edge_size(fitted: FittedMap, unit: Footprint) -> Estimate | None:
    """The map size at which at most a share WRONG of the edge pixels is wrong; None without edges.

    unit: the samples' footprint, with the map (or each sample's cascade) as the unit.
    """
    samples = fitted.samples
    if not len(samples.edges):
        return None
    displacement = unit.select(samples.edges).displacement
    row = np.zeros(len(samples.pixel), dtype=np.intp)
    row[samples.edges] = np.arange(len(samples.edges))

    def needed(chosen: Indices) -> float:
        return texels_for(displacement[row[chosen]])

    return samples.estimate(needed, samples.edges).plus(2 * fitted.padding)


def texels_for(displacement: Floats) -> float:
    """The texels along a map's side at which the share of wrong pixels, mean(min(displacement / texels, 1)), is WRONG.

    displacement: of edges in pixels for a map of one texel, of any shape, above 0. Exact: if the k smallest of n are
    below `texels` and the others saturate, the share is (sum of the k / texels + n − k) / n.
    """
    ordered = np.sort(displacement.ravel())
    count = len(ordered)
    before = np.concatenate([[0.0], np.cumsum(ordered)[:-1]])
    share = (before / ordered + np.arange(count, 0, -1)) / count  # with as many texels as each value
    k = int(np.flatnonzero(share > WRONG)[-1]) + 1  # exists, as at the smallest value all are wrong
    return float(ordered[:k].sum()) / (WRONG * count - (count - k))
