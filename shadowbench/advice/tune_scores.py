"""Errors and costs of a spec over a set of scenes, and ratios of two specs' errors.

A scene is one observation: its views, phases and map sizes are averaged first, and intervals are over scenes.
"""

import math
from collections.abc import Iterable

import numpy as np
import pandas as pd
from scipy.stats import bootstrap

from shadowbench.measure.rows import Record
from shadowbench.scores.metrics import is_soft, ranking
from shadowbench.studies.tables import Interval, interval

MIN_ERROR = 1e-4
"""Lower clamp of the errors, whose logarithms are averaged."""

ERRORS = ("iou", "rmse", "ssim")
_BOOTSTRAPS = 2000
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
            **{name: row["metrics"][name] for name in ("acne", "leak", "contact")},
        }
        for row in rows
        if row["status"] == "ok" and (errors := _log_errors(row)) is not None
    ]
    return pd.DataFrame(found).astype({"acne": float, "leak": float, "contact": float}).groupby("scene").mean()


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


def geometric_mean(logs: pd.Series) -> Interval:
    """Geometric mean over scenes, given logarithms, with a 95% bootstrap confidence interval (fixed seed)."""
    values = logs.to_numpy(dtype=float)
    middle = float(np.exp(values.mean()))
    if len(values) < 2:
        return Interval(middle)
    resampled = bootstrap((values,), np.mean, n_resamples=_BOOTSTRAPS, method="percentile", rng=0)
    low, high = np.exp(resampled.confidence_interval)
    return Interval(middle, float(low), float(high))


def error_ratio(metric: str, scores: pd.DataFrame, reference: pd.DataFrame) -> Interval | None:
    """Median per-scene error ratio of `scores` to `over`, with its 95% confidence interval."""
    return interval(np.exp(scores[metric] - reference[metric]).tolist())


def significantly_less(scores: pd.DataFrame, reference: pd.DataFrame) -> bool:
    """Whether the error is significantly smaller: the interval of the ratio is below 1; for one scene, the ratio."""
    change = geometric_mean(log_error(scores) - log_error(reference))
    return (change.median if change.high is None else change.high) < 1


def mean_of(metric: str, scores: pd.DataFrame) -> float | None:
    """Mean of a metric over scenes; None if no scene has it."""
    mean = float(scores[metric].mean())
    return None if math.isnan(mean) else mean
