"""Metrics of masks, hard or soft: functions of a Comparison, listed in `metrics`."""

import numpy as np

from shadowbench.scores.comparison import Comparison
from shadowbench.scores.sums import Single, mean_of, overlap, ratio, share, total_of


def iou(comparison: Comparison) -> float | None:
    """Intersection over union of the shadows (visibility < ½); Jaccard 1901."""
    return overlap(comparison.shadow, comparison.truth.shadow)


def iou_soft(comparison: Comparison) -> float | None:
    """Sum of the smaller over the sum of the larger darkness (1 − visibility) of each pixel; Ruzicka 1958."""
    images = comparison.truth.valid, comparison.visibility, comparison.truth.visibility
    greater = total_of(lambda mask, truth: 1 - np.minimum(mask, truth), *images)
    lesser = total_of(lambda mask, truth: 1 - np.maximum(mask, truth), *images)
    return ratio(lesser, greater)


def boundary_iou(comparison: Comparison) -> float | None:
    """IoU of the strips along the inside of the two shadows' edges; Cheng et al. 2021, "Boundary IoU".

    The strip's width is Euclidean, where their code erodes with a square; both agree on edges along rows and columns.
    """
    return overlap(comparison.boundary, comparison.truth.boundary)


def ssim(comparison: Comparison) -> float | None:
    """Mean SSIM over valid pixels whose window is inside the image; Wang et al. 2004."""
    return comparison.mean_ssim[0]


def ssim_edge(comparison: Comparison) -> float | None:
    """Mean SSIM over valid pixels that lie within 8 px of an edge of the truth and whose window is inside the image."""
    return comparison.mean_ssim[1]


def mae(comparison: Comparison) -> float | None:
    """Mean absolute error against the truth at pixel centres."""
    return mean_of(_error, comparison.truth.valid, comparison.visibility, comparison.truth.visibility)


def mae_area(comparison: Comparison) -> float | None:
    """Mean absolute error against the truth averaged over each pixel."""
    return mean_of(_error, comparison.truth.valid, comparison.visibility, comparison.truth.area)


def mae_lit(comparison: Comparison) -> float | None:
    """Mean absolute error weighted by N·L."""
    prepared = comparison.truth
    images = comparison.visibility, prepared.visibility, prepared.cosine
    weighted = total_of(lambda mask, truth, cosine: _error(mask, truth) * cosine, prepared.valid, *images)
    return ratio(weighted, prepared.cosine_sum)


def acne(comparison: Comparison) -> float | None:
    """Share of the lit interior that is in shadow."""
    return share(comparison.shadow, comparison.truth.lit_interior)


def acne_soft(comparison: Comparison) -> float | None:
    """Mean of how much darker the lit interior is than it should be."""
    images = comparison.truth.visibility, comparison.visibility
    return mean_of(lambda truth, mask: np.maximum(truth - mask, 0), comparison.truth.lit_interior, *images)


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


def _error(mask: Single, truth: Single) -> Single:
    error: Single = np.abs(mask - truth)
    return error
