"""What rows say of a spec on a set of scenes: its error and cost, and the ratio of one spec's error to another's.

A scene is one observation: its views, phases and sizes are averaged first, and intervals are over scenes.
"""

import math
from collections.abc import Iterable

import numpy as np
import pandas as pd
from scipy.stats import bootstrap

from shadowbench.measure.rows import Record
from shadowbench.studies.tables import Interval, interval

LEAST = 1e-4
"""The error that none is taken to be below, as its logarithm would be −∞: 1 − IoU, 1 − SSIM."""

ERRORS = ("iou", "ssim")
_BOOTSTRAPS = 2000
_COST_DIGITS = 2


def scene_scores(rows: Iterable[Record]) -> pd.DataFrame:
    """A line a scene: logarithms of 1 − IoU, 1 − SSIM and `work_cost`, and acne, leak and contact, as means over cells.

    Only cells that held and have scores count.
    """
    found = [
        {
            "scene": row["scene"],
            **{name: np.log(max(1 - row["metrics"][name], LEAST)) for name in ERRORS},
            "cost": np.log(row["work"]["cost"]),
            **{name: row["metrics"][name] for name in ("acne", "leak", "contact")},
        }
        for row in rows
        if row["status"] == "ok" and all(row["metrics"][name] is not None for name in ERRORS)
    ]
    return pd.DataFrame(found).astype({"acne": float, "leak": float, "contact": float}).groupby("scene").mean()


def log_error(scores: pd.DataFrame) -> pd.Series:
    """By scene, the mean of log(1 − IoU) and log(1 − SSIM): what is minimised."""
    return scores[list(ERRORS)].mean(axis=1)


def log_cost(scores: pd.DataFrame, default: pd.DataFrame) -> float:
    """The mean over scenes of the logarithm of the cost over the default's, rounded: within 1% costs are the same."""
    return round(float((scores["cost"] - default["cost"]).mean()), _COST_DIGITS)


def geometric_mean(logs: pd.Series) -> Interval:
    """Of the scenes' values, given their logarithms, with a 95% bootstrap interval over scenes (fixed seed)."""
    values = logs.to_numpy(dtype=float)
    middle = float(np.exp(values.mean()))
    if len(values) < 2:
        return Interval(middle)
    resampled = bootstrap((values,), np.mean, n_resamples=_BOOTSTRAPS, method="percentile", rng=0)
    low, high = np.exp(resampled.confidence_interval)
    return Interval(middle, float(low), float(high))


def ratio(metric: str, scores: pd.DataFrame, over: pd.DataFrame) -> Interval | None:
    """By how much the error of `scores` is that of `over`: the median over scenes, with its interval."""
    return interval(np.exp(scores[metric] - over[metric]).tolist())


def surely_less(scores: pd.DataFrame, than: pd.DataFrame) -> bool:
    """Whether the error is less over scenes, its interval included; of one scene there is none, and less is less."""
    change = geometric_mean(log_error(scores) - log_error(than))
    return (change.median if change.high is None else change.high) < 1


def mean_of(metric: str, scores: pd.DataFrame) -> float | None:
    """The mean over scenes of a metric as it is; None where no scene has it."""
    mean = float(scores[metric].mean())
    return None if math.isnan(mean) else mean
