"""Errors and costs of a spec over a set of scenes.

A scene is one observation: its views, phases and map sizes are averaged first.
"""

import math
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
import pandas as pd

from shadowbench.measure.rows import Record
from shadowbench.plugin.spec import Spec
from shadowbench.scores.metrics import is_soft, ranking

MIN_ERROR = 1e-4
"""Lower clamp of the errors, whose logarithms are averaged."""

ERRORS = ("iou", "rmse", "ssim")
FAULTS = ("acne", "leak", "contact")
_COST_DIGITS = 2


def scene_scores(rows: Iterable[Record]) -> pd.DataFrame:
    """One line per scene: means over cells of log(1 − IoU), log(1 − SSIM), log(work_cost), acne, leak and contact.

    Soft shadows have log(RMSE) in place of log(1 − IoU), clamped to the truth's own error. Failed cells and cells
    without one of the errors are left out.
    """
    found = [
        {
            "scene": row["scene"],
            **errors,
            "cost": np.log(row["work"]["cost"]),
            **{name: row["metrics"][name] for name in FAULTS},
        }
        for row in rows
        if row["status"] == "ok" and (errors := _log_errors(row)) is not None
    ]
    return pd.DataFrame(found).astype(dict.fromkeys(FAULTS, float)).groupby("scene").mean()


def _log_errors(row: Record) -> dict[str, float] | None:
    """Logarithms of the errors of a row, NaN for that of the other kind of shadows; None if one has no value."""
    metrics = row["metrics"]
    ranked_by = ranking(is_soft(metrics))
    if any(metrics[name] is None for name in (ranked_by.name, "ssim")):
        return None
    least = max(MIN_ERROR, row.get("truth_error", 0.0))
    errors = dict.fromkeys(ERRORS, math.nan)
    errors[ranked_by.name] = np.log(max(ranked_by.error(metrics[ranked_by.name]), least))
    return errors | {"ssim": np.log(max(1 - metrics["ssim"], MIN_ERROR))}


def log_error(scores: pd.DataFrame) -> pd.Series:
    """Objective by scene: the mean of log(1 − IoU), of soft shadows log(RMSE), and log(1 − SSIM)."""
    return scores[list(ERRORS)].mean(axis=1)


def log_cost(scores: pd.DataFrame, default: pd.DataFrame) -> float:
    """Mean over scenes of log(cost / default's cost), rounded so that costs within 1% count as equal."""
    return round(float((scores["cost"] - default["cost"]).mean()), _COST_DIGITS)


@dataclass(frozen=True)
class Setting:
    """A spec and its scores.

    cost: `work_cost` relative to the default's; tuning, held_out: √((1 − IoU) · (1 − SSIM)), or of soft shadows √(RMSE
    · (1 − SSIM)), geometric means over the scenes of the search and over those held out; acne, leak, contact: means
    over the latter, None without a value.
    """

    spec: Spec
    cost: float
    tuning: float
    held_out: float
    acne: float | None
    leak: float | None
    contact: float | None

    @classmethod
    def of(cls, spec: Spec, tuning: pd.DataFrame, held_out: pd.DataFrame, default: pd.DataFrame) -> "Setting":
        """From the spec's `scene_scores` on both sets of scenes, and those of the default on the scenes tuned on."""
        errors = (math.exp(log_error(scores).mean()) for scores in (tuning, held_out))
        means = (float(held_out[name].mean()) for name in FAULTS)
        return cls(
            spec, math.exp(log_cost(tuning, default)), *errors, *(None if math.isnan(mean) else mean for mean in means)
        )
