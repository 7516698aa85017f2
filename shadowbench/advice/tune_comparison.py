"""Comparison of the specs found by a search with the default and others, on held-out scenes."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import pandas as pd

from shadowbench.advice.tune_scores import error_ratio, geometric_mean, log_cost, log_error, mean_of
from shadowbench.advice.tune_split import SceneSplit
from shadowbench.studies.tables import Interval
from shadowbench.techniques.spec import Spec

Scores = Mapping[Spec, pd.DataFrame]


@dataclass(frozen=True, eq=False)
class SearchResult:
    """Specs found by a search, and their `scene_scores`.

    tuned: the best spec that costs no more than the default, or the default if that spec is not significantly better on
    the tuning scenes; front: Pareto-optimal specs by increasing cost; others: specs to compare with, the default first;
    tuning: scores of all these on the tuning scenes; held_out: scores on the held-out scenes, of at least the tuned
    spec and the default.
    """

    split: SceneSplit
    tuned: Spec
    front: Sequence[Spec]
    others: Mapping[str, Spec]
    tuning: Scores
    held_out: Scores


@dataclass(frozen=True)
class Entry:
    """A spec and its scores.

    cost: `work_cost` relative to the default's; tuning, held_out: √((1 − IoU) · (1 − SSIM)), or of soft shadows √(RMSE
    · (1 − SSIM)), geometric mean over the scenes; iou_ratio, rmse_ratio, ssim_ratio: 1 − IoU, RMSE and 1 − SSIM
    relative to the tuned spec's, medians over held-out scenes of hard shadows, of soft ones, and of both; acne, leak,
    contact: means over held-out scenes.
    """

    name: str
    spec: Spec
    cost: float
    tuning: float
    held_out: Interval
    iou_ratio: Interval | None
    rmse_ratio: Interval | None
    ssim_ratio: Interval | None
    acne: float | None
    leak: float | None
    contact: float | None


@dataclass(frozen=True)
class TuningComparison:
    """Comparison of specs on held-out scenes.

    front: Pareto-optimal specs by increasing cost, then the tuned spec if it is not one of them; tuned: the tuned spec;
    others: the specs compared with, the default first.
    """

    split: SceneSplit
    front: tuple[Entry, ...]
    tuned: Entry
    others: tuple[Entry, ...]


def compare(found: SearchResult) -> TuningComparison:
    """Entries of all specs that succeeded on every scene."""

    def entry(name: str, spec: Spec) -> Entry:
        tuning, held_out, tuned = found.tuning[spec], found.held_out[spec], found.held_out[found.tuned]
        return Entry(
            name=name,
            spec=spec,
            cost=math.exp(log_cost(tuning, found.tuning[found.others["default"]])),
            tuning=math.exp(log_error(tuning).mean()),
            held_out=geometric_mean(log_error(held_out)),
            iou_ratio=error_ratio("iou", held_out, tuned),
            rmse_ratio=error_ratio("rmse", held_out, tuned),
            ssim_ratio=error_ratio("ssim", held_out, tuned),
            acne=mean_of("acne", held_out),
            leak=mean_of("leak", held_out),
            contact=mean_of("contact", held_out),
        )

    shown = [spec for spec in dict.fromkeys([*found.front, found.tuned]) if spec in found.held_out]
    front = {spec: entry("tuned" if spec == found.tuned else "", spec) for spec in shown}
    others = tuple(entry(name, spec) for name, spec in found.others.items() if spec in found.held_out)
    return TuningComparison(found.split, tuple(front.values()), front[found.tuned], others)
