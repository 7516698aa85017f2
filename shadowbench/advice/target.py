"""Target of a recommendation, from options and in words."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from decimal import ROUND_CEILING, ROUND_FLOOR, Context
from typing import Any, Literal

import numpy as np

from shadowbench.errors import InputError
from shadowbench.scores.masks import ThresholdedMask
from shadowbench.scores.metrics import METRICS, ranking
from shadowbench.truths.trace import Truth

Measure = Literal["iou", "edge_px", "rmse"]

_METRICS: dict[str, Measure] = {"--min-iou": "iou", "--max-edge-px": "edge_px", "--max-rmse": "rmse"}
_ALLOWED: dict[str, tuple[Callable[[float], bool], str]] = {
    "--min-iou": (lambda value: 0 < value <= 1, "above 0, up to 1"),
    "--max-edge-px": (lambda value: 0 <= value < math.inf, "0 and more"),
    "--max-rmse": (lambda value: 0 <= value <= 1, "0 to 1"),
    "--budget-ms": (lambda value: 0 < value < math.inf, "above 0"),
}
_TEXTS: dict[Measure, str] = {"iou": "IoU ≥ {:g}", "edge_px": "edges at most {:g} px off", "rmse": "RMSE ≤ {:g}"}
_REACHED: dict[Measure, str] = {"iou": "IoU {}", "edge_px": "edges {} px off", "rmse": "RMSE {}"}


@dataclass(frozen=True)
class Target:
    """Target of a recommendation: minimum of `iou`, maximum of `edge_px` or `rmse`; optionally a budget in ms."""

    metric: Measure
    value: float
    budget_ms: float | None = None

    @property
    def limit(self) -> float:
        """Largest error that meets the target."""
        return METRICS[self.metric].error(self.value)

    def affords(self, cost: float) -> bool:
        """Whether a cost is within the budget."""
        return self.budget_ms is None or cost <= self.budget_ms

    def error(self, metrics: Mapping[str, float | None]) -> float:
        """Error of a row's metrics: 1 − IoU, the edge distance in pixels, or the RMSE.

        IoU is None if neither the truth nor the mask has a shadow; the error is then 0. An edge distance is None if
        neither has an edge; the error is then 0 if their shadows are equal, else infinite.
        """
        value = metrics[self.metric]
        if value is None:
            return 0.0 if metrics["iou"] in (None, 1.0) else math.inf
        return METRICS[self.metric].error(value)

    def meets(self, metrics: Mapping[str, float | None]) -> bool:
        """Whether a row's metrics meet the target, whatever they cost."""
        return self.error(metrics) <= self.limit

    def text(self, error: float, row: Mapping[str, Any], as_target: bool = False) -> str:
        """Text of an error by the metric: `IoU 0.9712`, `edges 0.21 px off`, `RMSE 0.013`; in words if infinite.

        row: the score row, which has the error of its truth; as_target: rounded to a target that the error meets.
        """
        if math.isinf(error):
            return "no edges to compare, and other shadows"
        metric = METRICS[self.metric]
        value = metric.error(error)  # which is its own inverse
        return _REACHED[self.metric].format(metric.text(value, self.reached if as_target else self.digits, row))

    def digits(self, value: float) -> str:
        """A value of the metric, rounded, but neither across the target nor to an IoU of 1 unless it is that."""
        form = "{:.4g}" if self.metric == "iou" else "{:.3g}"
        return METRICS[self.metric].digits_beside(self.value, form.format)(value)

    def reached(self, value: float) -> str:
        """A value of the metric as another target, which it meets: an IoU rounded down, others up."""
        least, rounding = (4, ROUND_FLOOR) if self.metric == "iou" else (3, ROUND_CEILING)
        for digits in range(least, 17):
            rounded = float(Context(digits, rounding).create_decimal(value))
            if rounded != self.value and (rounded > self.value) == (value > self.value):
                return f"{rounded:.{digits}g}"
        return f"{value:.16g}"

    def __str__(self) -> str:
        text = _TEXTS[self.metric].format(self.value)
        return text if self.budget_ms is None else f"{text} within {self.budget_ms:g} ms"


def target_of(
    min_iou: float | None = None,
    max_edge_px: float | None = None,
    budget_ms: float | None = None,
    max_rmse: float | None = None,
    *,
    soft: bool = False,
) -> Target:
    """Target given by options, by default an IoU of 0.99, or for soft shadows an RMSE of 0.02.

    soft: whether the view has penumbrae. Raises InputError for invalid or conflicting options.
    """
    options = {"--min-iou": min_iou, "--max-edge-px": max_edge_px, "--max-rmse": max_rmse}
    given = {name: value for name, value in options.items() if value is not None}
    if len(given) > 1:
        found = "both" if len(given) == 2 else "all"
        raise InputError(f"{' and '.join(given)}: found {found}; allowed: one of them")
    for name, value in {**given, **({} if budget_ms is None else {"--budget-ms": budget_ms})}.items():
        is_allowed, told = _ALLOWED[name]
        if not is_allowed(value):
            raise InputError(f"{name}: found {value:g}; allowed: {told}")
    if given:
        ((name, value),) = given.items()
        return Target(_METRICS[name], value, budget_ms)
    return Target("rmse" if soft else "iou", ranking(soft).targets[1], budget_ms)


def least_error(truth: Truth, metric: Measure) -> float:
    """Approximate error of a single wrong pixel, of the shadow or of its edge: the smallest error above 0."""
    mask = ThresholdedMask(truth.visibility, truth.receivers & ~truth.undecided)
    if metric == "rmse":
        return 1 / math.sqrt(max(int(np.count_nonzero(mask.valid)), 1))
    return 1 / max(int(np.count_nonzero(mask.shadow if metric == "iou" else mask.edge)), 1)
