"""The table of metrics, and all of them at once.

A metric is a function of a Comparison that returns a number, or None if its denominator is 0.
"""

import math
from collections.abc import Mapping, Sequence
from typing import Any

from numpy.typing import ArrayLike

from shadowbench.errors import MetricError, message, quoted
from shadowbench.scores import mask_metrics as masks
from shadowbench.scores import soft_metrics as soft
from shadowbench.scores.comparison import Comparison
from shadowbench.scores.metric import Metric
from shadowbench.scores.prepared import PreparedTruth


def score(visibility: ArrayLike, prepared: PreparedTruth) -> dict[str, float | None]:
    """Values of all metrics by name, in the order of the table.

    visibility: (H, W) in [0, 1], 1 lit and 0 in shadow, quantised before scoring; values at invalid pixels are ignored,
    but must be finite. Raises ValueError for NaN, infinity, values out of range, or another shape.
    """
    return values_of(Comparison(visibility, prepared))


def values_of(comparison: Comparison) -> dict[str, float | None]:
    """Values of all metrics by name, in the order of the table."""
    return {metric.name: _value(metric, comparison) for metric in METRICS.values()}


def _value(metric: Metric, comparison: Comparison) -> float | None:
    """Value of a metric. Raises MetricError, as the function of a plug-in may raise, or return, anything."""
    try:
        value = metric.function(comparison)
        if value is None or math.isfinite(value):
            return None if value is None else float(value)
    except Exception as error:
        raise MetricError(f"metric {metric.name}: {type(error).__name__}: {quoted(message(error))}") from error
    raise MetricError(f"metric {metric.name}: found {value}; allowed: a finite number, or None")


def plug_in(added: Sequence[Metric]) -> None:
    """Add metrics to the table, in place of those added before. Raises ValueError for a name that is taken."""
    for name in METRICS.keys() - _OWN:
        del METRICS[name]
    for metric in added:
        if metric.name in METRICS:
            raise ValueError(f"two metrics are called {metric.name!r}")
        METRICS[metric.name] = metric


def plugged_in() -> list[Metric]:
    """The metrics that were added."""
    return [metric for name, metric in METRICS.items() if name not in _OWN]


METRICS: dict[str, Metric] = {
    metric.name: metric
    for metric in (
        Metric(
            "iou",
            masks.iou,
            "higher",
            "hard",
            "Intersection over union of the shadows (visibility < 0.5). Errors are given as 1 − IoU.",
            label="IoU",
            targets=(0.95, 0.99, 0.999),
        ),
        Metric(
            "iou_soft",
            masks.iou_soft,
            "higher",
            "soft",
            "Intersection over union of the shadows, with pixels weighted by their darkness (1 − visibility).",
        ),
        Metric(
            "boundary_iou",
            masks.boundary_iou,
            "higher",
            "hard",
            "Intersection over union of the strips inside the shadows' edges, 2% of the image's diagonal wide. "
            "Comparable across shadow sizes.",
        ),
        Metric(
            "ssim",
            masks.ssim,
            "higher",
            "both",
            "Structural similarity (σ = 1.5 px) over scored pixels. Large lit areas raise it, and it prefers a "
            "displaced edge to a blurred one: read it beside ssim_edge and edge_px.",
        ),
        Metric(
            "ssim_edge",
            masks.ssim_edge,
            "higher",
            "both",
            "Structural similarity within 8 px of a true edge: independent of the size of lit areas.",
        ),
        Metric(
            "mae", masks.mae, "lower", "both", "Mean absolute error of visibility, against the truth at pixel centres."
        ),
        Metric(
            "mae_area",
            masks.mae_area,
            "lower",
            "both",
            "Mean absolute error of visibility, against the truth averaged over each pixel: correct antialiasing is "
            "not an error.",
        ),
        Metric(
            "mae_lit",
            masks.mae_lit,
            "lower",
            "both",
            "Mean absolute error of visibility, weighted by N·L, as in diffuse shading.",
        ),
        Metric(
            "acne",
            masks.acne,
            "lower",
            "hard",
            "Of the lit interior (at least 4 px from shadow and undecided pixels), the share that is in shadow.",
        ),
        Metric(
            "acne_soft",
            masks.acne_soft,
            "lower",
            "both",
            "Mean of how much darker the lit interior is than it should be: includes acne that a filter lightens "
            "beyond half.",
        ),
        Metric(
            "leak",
            masks.leak,
            "lower",
            "hard",
            "Of the shadow's interior (at least 4 px from light and undecided pixels), the share that is lit.",
        ),
        Metric(
            "contact",
            masks.contact,
            "lower",
            "hard",
            "Of the shadow within 2% of the scene's diagonal of its occluder, the share that is lit (peter-panning).",
        ),
        Metric(
            "edge_px",
            masks.edge_px,
            "lower",
            "hard",
            "Mean distance in pixels between the edges of mask and truth, averaged over both directions; the image's "
            "diagonal if only one of them has edges.",
            tolerance=0.05,
            label="edge",
            targets=(1.0, 0.5, 0.25),
        ),
        Metric(
            "edge_p95",
            masks.edge_p95,
            "lower",
            "hard",
            "95th percentile of the distances in pixels between the edges of mask and truth: the worst parts.",
            tolerance=0.5,
        ),
        Metric(
            "rmse",
            soft.rmse,
            "lower",
            "both",
            "Root mean square error of visibility, the truth's own error taken off. Ranks soft shadows.",
            resolution="truth_error",
            label="RMSE",
            targets=(0.05, 0.02, 0.01),
        ),
        Metric(
            "rmse_pen",
            soft.rmse_pen,
            "lower",
            "soft",
            "Root mean square error of visibility in the penumbra, the truth's own error taken off. The penumbra is "
            "where the true visibility is between 0.02 and 0.98, and 2 px around it.",
            resolution="truth_error_pen",
        ),
        Metric(
            "bias_pen",
            soft.bias_pen,
            "near 0",
            "soft",
            "Mean error of visibility in the penumbra, above 0 where the mask is too light.",
        ),
        Metric(
            "bleed",
            soft.bleed,
            "lower",
            "both",
            "Mean visibility of the umbra (true visibility below 0.01, at least 8 px from lighter and undecided "
            "pixels): light bleeding. A blur that reaches farther counts too.",
        ),
        Metric(
            "false_dark",
            soft.false_dark,
            "lower",
            "both",
            "Mean darkness (1 − visibility) of full light (true visibility above 0.99, at least 8 px from darker and "
            "undecided pixels): acne of wide kernels.",
        ),
        Metric(
            "noise",
            soft.noise,
            "lower",
            "soft",
            "Standard deviation of the error of visibility along 7 px of the truth's isolines in the penumbra, where "
            "they are straight, the truth's own error taken off: dither, too few samples.",
            resolution="truth_error_pen",
        ),
        Metric(
            "banding",
            soft.banding,
            "lower",
            "soft",
            "Share of the penumbra in which the mask is grey and its gradient below a tenth of the truth's and of its "
            "own within 8 px: flat steps, few levels.",
        ),
        Metric(
            "width",
            soft.width,
            "lower",
            "soft",
            "Median of |log₂| of the drawn over the true width of penumbrae: 1 for half or twice the width. From "
            "visibility 0.1 to 0.9 in metres, where the true one is at least 3 px wide and lies on one plane.",
            tolerance=0.02,
        ),
        Metric(
            "hardening",
            soft.hardening,
            "near 1",
            "soft",
            "Slope of the drawn over the true width of penumbrae: 1 if shadows harden towards contact as they should, "
            "0 for a blur of fixed width. Over true widths above 4 px; none if they vary by less than a factor of 3.",
            tolerance=0.02,
        ),
        Metric(
            "hardening_intercept",
            soft.hardening_intercept,
            "near 0",
            "soft",
            "Drawn width where the true one is 0, on the line of `hardening`, as a share of the median true width.",
            tolerance=0.02,
        ),
    )
}
"""All metrics by name, in the order of the columns."""


_OWN = frozenset(METRICS)


def is_soft(metrics: Mapping[str, Any]) -> bool:
    """Whether values of metrics are of soft shadows: whether the truth has a penumbra."""
    return metrics.get("rmse_pen") is not None


def ranking(soft: bool) -> Metric:
    """The metric that ranks hard shadows, or soft ones."""
    return METRICS["rmse" if soft else "iou"]
