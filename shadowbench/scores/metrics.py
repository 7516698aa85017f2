"""The metrics: functions of a Comparison, and a table that describes them.

A metric returns a number, or None if its denominator is 0.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from shadowbench.scores.comparison import Comparison
from shadowbench.scores.prepared import PreparedTruth
from shadowbench.scores.ssim import INSIDE


@dataclass(frozen=True)
class Metric:
    """A row of the table of metrics.

    kind: the shadows it suits, hard-edged, soft or both; tolerance: change against a baseline that is not reported.
    """

    name: str
    function: Callable[[Comparison], float | None]
    better: Literal["higher", "lower"]
    kind: Literal["hard", "soft", "both"]
    help: str
    tolerance: float = 0.001


def score(visibility: ArrayLike, prepared: PreparedTruth) -> dict[str, float | None]:
    """Values of all metrics by name, in the order of the table.

    visibility: (H, W) in [0, 1], 1 lit and 0 in shadow, quantised before scoring; values at invalid pixels are ignored,
    but must be finite. Raises ValueError for NaN, infinity, values out of range, or another shape.
    """
    comparison = Comparison(visibility, prepared)
    return {metric.name: metric.function(comparison) for metric in METRICS.values()}


def iou(comparison: Comparison) -> float | None:
    """Intersection over union of the shadows (visibility < ½); Jaccard 1901."""
    return _overlap(comparison.shadow, comparison.truth.shadow)


def iou_soft(comparison: Comparison) -> float | None:
    """Sum of the smaller over the sum of the larger darkness (1 − visibility) of each pixel; Ruzicka 1958."""
    mask, truth = comparison.visibility, comparison.truth.visibility
    greater = _sum(1 - np.minimum(mask, truth), comparison.truth.valid)
    lesser = _sum(1 - np.maximum(mask, truth), comparison.truth.valid)
    return _ratio(lesser, greater)


def boundary_iou(comparison: Comparison) -> float | None:
    """IoU of the strips along the inside of the two shadows' edges; Cheng et al. 2021, "Boundary IoU".

    The strip's width is Euclidean, where their code erodes with a square; both agree on edges along rows and columns.
    """
    prepared = comparison.truth
    boundary = comparison.shadow & (comparison.squared_edge_distance < prepared.boundary_width**2)
    return _overlap(boundary, prepared.boundary)


def ssim(comparison: Comparison) -> float | None:
    """Mean SSIM over valid pixels whose window is inside the image; Wang et al. 2004."""
    return _mean(comparison.ssim_map, comparison.truth.valid[INSIDE])


def ssim_edge(comparison: Comparison) -> float | None:
    """Mean SSIM over valid pixels that lie within 8 px of an edge of the truth and whose window is inside the image."""
    return _mean(comparison.ssim_map, comparison.truth.edge_zone[INSIDE])


def mae(comparison: Comparison) -> float | None:
    """Mean absolute error against the truth at pixel centres."""
    return _ratio(_sum(comparison.error, comparison.truth.valid), comparison.truth.pixels)


def mae_area(comparison: Comparison) -> float | None:
    """Mean absolute error against the truth averaged over each pixel."""
    prepared = comparison.truth
    return _ratio(_sum(np.abs(comparison.visibility - prepared.area), prepared.valid), prepared.pixels)


def mae_lit(comparison: Comparison) -> float | None:
    """Mean absolute error weighted by N·L."""
    prepared = comparison.truth
    return _ratio(_sum(comparison.error * prepared.cosine, prepared.valid), prepared.cosine_sum)


def acne(comparison: Comparison) -> float | None:
    """Share of the lit interior that is in shadow."""
    return _share(comparison.shadow, comparison.truth.lit_interior)


def acne_soft(comparison: Comparison) -> float | None:
    """Mean darkness (1 − visibility) of the lit interior."""
    interior = comparison.truth.lit_interior
    return _mean(1 - comparison.visibility, interior)


def leak(comparison: Comparison) -> float | None:
    """Share of the shadow's interior that is lit."""
    return _share(comparison.lit, comparison.truth.shadow_interior)


def contact(comparison: Comparison) -> float | None:
    """Share of the shadow close to its occluder that is lit."""
    return _share(comparison.lit, comparison.truth.contact)


def edge_px(comparison: Comparison) -> float | None:
    """Mean distance in pixels between the two masks' edges, pooled over both directions."""
    distances = comparison.edge_distances
    return None if distances is None else float(distances.mean())


def edge_p95(comparison: Comparison) -> float | None:
    """95th percentile of the distances in pixels between the two masks' edges, pooled over both directions."""
    distances = comparison.edge_distances
    return None if distances is None else float(np.percentile(distances, 95))


METRICS: dict[str, Metric] = {
    metric.name: metric
    for metric in (
        Metric(
            "iou",
            iou,
            "higher",
            "hard",
            "Intersection over union of the shadows (visibility < 0.5). Errors are given as 1 − IoU.",
        ),
        Metric(
            "iou_soft",
            iou_soft,
            "higher",
            "soft",
            "Intersection over union of the shadows, with pixels weighted by their darkness (1 − visibility).",
        ),
        Metric(
            "boundary_iou",
            boundary_iou,
            "higher",
            "hard",
            "Intersection over union of the strips inside the shadows' edges, 2% of the image's diagonal wide. "
            "Comparable across shadow sizes.",
        ),
        Metric(
            "ssim",
            ssim,
            "higher",
            "both",
            "Structural similarity (σ = 1.5 px) over scored pixels. Large lit areas raise it, and it prefers a "
            "displaced edge to a blurred one: read it beside ssim_edge and edge_px.",
        ),
        Metric(
            "ssim_edge",
            ssim_edge,
            "higher",
            "both",
            "Structural similarity within 8 px of a true edge: independent of the size of lit areas.",
        ),
        Metric("mae", mae, "lower", "both", "Mean absolute error of visibility, against the truth at pixel centres."),
        Metric(
            "mae_area",
            mae_area,
            "lower",
            "both",
            "Mean absolute error of visibility, against the truth averaged over each pixel: correct antialiasing is "
            "not an error.",
        ),
        Metric(
            "mae_lit",
            mae_lit,
            "lower",
            "both",
            "Mean absolute error of visibility, weighted by N·L, as in diffuse shading.",
        ),
        Metric(
            "acne",
            acne,
            "lower",
            "hard",
            "Of the lit interior (at least 4 px from shadow and undecided pixels), the share that is in shadow.",
        ),
        Metric(
            "acne_soft",
            acne_soft,
            "lower",
            "both",
            "Mean darkness (1 − visibility) of the lit interior: includes acne that a filter lightens beyond half.",
        ),
        Metric(
            "leak",
            leak,
            "lower",
            "hard",
            "Of the shadow's interior (at least 4 px from light and undecided pixels), the share that is lit.",
        ),
        Metric(
            "contact",
            contact,
            "lower",
            "hard",
            "Of the shadow within 2% of the scene's diagonal of its occluder, the share that is lit (peter-panning).",
        ),
        Metric(
            "edge_px",
            edge_px,
            "lower",
            "hard",
            "Mean distance in pixels between the edges of mask and truth, averaged over both directions; the image's "
            "diagonal if only one of them has edges.",
            tolerance=0.05,
        ),
        Metric(
            "edge_p95",
            edge_p95,
            "lower",
            "hard",
            "95th percentile of the distances in pixels between the edges of mask and truth: the worst parts.",
            tolerance=0.5,
        ),
    )
}
"""All metrics by name, in the order of the columns."""


def _overlap(mask: NDArray[np.bool_], truth: NDArray[np.bool_]) -> float | None:
    return _ratio(int(np.count_nonzero(mask & truth)), int(np.count_nonzero(mask | truth)))


def _share(wrong: NDArray[np.bool_], region: NDArray[np.bool_]) -> float | None:
    return _ratio(int(np.count_nonzero(wrong & region)), int(np.count_nonzero(region)))


def _mean(values: NDArray[np.float32], where: NDArray[np.bool_]) -> float | None:
    return _ratio(_sum(values, where), int(np.count_nonzero(where)))


def _sum(values: NDArray[np.float32], where: NDArray[np.bool_]) -> float:
    # In float64: the last digits of a float32 sum depend on its order, and so on the processor.
    return float(values.sum(where=where, dtype=np.float64))


def _ratio(part: float, whole: float) -> float | None:
    return float(part / whole) if whole > 0 else None
