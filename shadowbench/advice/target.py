"""Target of a recommendation."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from decimal import ROUND_CEILING, ROUND_FLOOR, Context
from typing import Any, Literal

from shadowbench.scores.metrics import METRICS

Measure = Literal["iou", "edge_px", "rmse"]


@dataclass(frozen=True)
class Target:
    """Target of a recommendation: minimum of `iou`, maximum of `edge_px` or `rmse`; optionally a budget in ms."""

    metric: Measure
    value: float
    budget_ms: float | None = None

    @property
    def limit(self) -> float:
        """Largest error that meets the target."""
        return 1 - self.value if self.metric == "iou" else self.value

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
        return 1 - value if self.metric == "iou" else value

    def text(self, error: float, row: Mapping[str, Any], as_target: bool = False) -> str:
        """Text of an error by the metric: `IoU 0.9712`, `edges 0.21 px off`, `RMSE 0.013`; in words if infinite.

        row: the score row, which has the error of its truth; as_target: rounded to a target that the error meets.
        """
        digits = self.reached if as_target else self.digits
        if math.isinf(error):
            return "no edges to compare, and other shadows"
        if self.metric == "iou":
            return f"IoU {digits(1 - error)}"
        value = METRICS[self.metric].text(error, digits, row)
        return f"RMSE {value}" if self.metric == "rmse" else f"edges {value} px off"

    def digits(self, value: float) -> str:
        """A value of the metric, rounded, but neither across the target nor to an IoU of 1 unless it is that."""
        form = "{:.4g}" if self.metric == "iou" else "{:.3g}"
        return METRICS[self.metric].digits_beside(self.value, form.format)(value)

    def reached(self, value: float) -> str:
        """A value of the metric as another target, which it meets: an IoU rounded down, others up."""
        places, rounding = (4, ROUND_FLOOR) if self.metric == "iou" else (3, ROUND_CEILING)
        texts = (f"{Context(one, rounding).create_decimal(value):.{one}g}" for one in range(places, 17))
        beyond = (
            text for text in texts if float(text) != self.value and (float(text) > self.value) == (value > self.value)
        )
        return f"{float(next(beyond, value)):.16g}"

    def __str__(self) -> str:
        whats = {
            "iou": f"IoU ≥ {self.value:g}",
            "edge_px": f"edges at most {self.value:g} px off",
            "rmse": f"RMSE ≤ {self.value:g}",
        }
        what = whats[self.metric]
        return what if self.budget_ms is None else f"{what} within {self.budget_ms:g} ms"
