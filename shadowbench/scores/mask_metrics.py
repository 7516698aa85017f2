"""Metrics of masks, hard or soft: functions of a Comparison, listed in `metrics`."""

import numpy as np

from shadowbench.scores.comparison import Comparison
from shadowbench.scores.ssim import INSIDE
from shadowbench.scores.sums import mean, overlap, ratio, share, total


def iou(comparison: Comparison) -> float | None:
    """Intersection over union of the shadows (visibility < ½); Jaccard 1901."""
    return overlap(comparison.shadow, comparison.truth.shadow)


def iou_soft(comparison: Comparison) -> float | None:
    """Sum of the smaller over the sum of the larger darkness (1 − visibility) of each pixel; Ruzicka 1958."""
    mask, truth = comparison.visibility, comparison.truth.visibility
    greater = total(1 - np.minimum(mask, truth), comparison.truth.valid)
    lesser = total(1 - np.maximum(mask, truth), comparison.truth.valid)
    return ratio(lesser, greater)


def boundary_iou(comparison: Comparison) -> float | None:
    """IoU of the strips along the inside of the two shadows' edges; Cheng et al. 2021, "Boundary IoU".

    The strip's width is Euclidean, where their code erodes with a square; both agree on edges along rows and columns.
    """
    prepared = comparison.truth
    boundary = comparison.shadow & (comparison.squared_edge_distance < prepared.boundary_width**2)
    return overlap(boundary, prepared.boundary)


def ssim(comparison: Comparison) -> float | None:
    """Mean SSIM over valid pixels whose window is inside the image; Wang et al. 2004."""
    return mean(comparison.ssim_map, comparison.truth.valid[INSIDE])


def ssim_edge(comparison: Comparison) -> float | None:
    """Mean SSIM over valid pixels that lie within 8 px of an edge of the truth and whose window is inside the image."""
    return mean(comparison.ssim_map, comparison.truth.edge_zone[INSIDE])


def mae(comparison: Comparison) -> float | None:
    """Mean absolute error against the truth at pixel centres."""
    return ratio(total(comparison.error, comparison.truth.valid), comparison.truth.pixels)


def mae_area(comparison: Comparison) -> float | None:
    """Mean absolute error against the truth averaged over each pixel."""
    prepared = comparison.truth
    return ratio(total(np.abs(comparison.visibility - prepared.area), prepared.valid), prepared.pixels)


def mae_lit(comparison: Comparison) -> float | None:
    """Mean absolute error weighted by N·L."""
    prepared = comparison.truth
    return ratio(total(comparison.error * prepared.cosine, prepared.valid), prepared.cosine_sum)


def acne(comparison: Comparison) -> float | None:
    """Share of the lit interior that is in shadow."""
    return share(comparison.shadow, comparison.truth.lit_interior)


def acne_soft(comparison: Comparison) -> float | None:
    """Mean of how much darker the lit interior is than it should be."""
    truth = comparison.truth
    return mean(np.maximum(truth.visibility - comparison.visibility, 0), truth.lit_interior)


def leak(comparison: Comparison) -> float | None:
    """Share of the shadow's interior that is lit."""
    return share(comparison.lit, comparison.truth.shadow_interior)


def contact(comparison: Comparison) -> float | None:
    """Share of the shadow close to its occluder that is lit."""
    return share(comparison.lit, comparison.truth.contact)


def edge_px(comparison: Comparison) -> float | None:
    """Mean distance in pixels between the two masks' edges, pooled over both directions."""
    distances = comparison.edge_distances
    return None if distances is None else float(distances.mean())


def edge_p95(comparison: Comparison) -> float | None:
    """95th percentile of the distances in pixels between the two masks' edges, pooled over both directions."""
    distances = comparison.edge_distances
    return None if distances is None else float(np.percentile(distances, 95))
