"""What a search found, set beside the default and others on scenes that it had not seen."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import pandas as pd

from shadowbench.advice.tune_scores import geometric_mean, log_cost, log_error, mean_of, ratio
from shadowbench.advice.tune_split import Split
from shadowbench.studies.tables import Interval
from shadowbench.techniques.spec import Spec

Scores = Mapping[Spec, pd.DataFrame]


@dataclass(frozen=True, eq=False)
class Found:
    """What a search chose, and the `scene_scores` of each spec on its scenes.

    `front`: the best at each cost, from the cheapest; `tuned`: the best of those that cost no more than the default, or
    the default, where that is not surely better on the tuning scenes; `others`: what it is set beside, the default
    first. `tuning` has all of them that hold on the tuning scenes, `held_out` those of them that hold on the other
    scenes too: at least the tuned and the default.
    """

    split: Split
    tuned: Spec
    front: Sequence[Spec]
    others: Mapping[str, Spec]
    tuning: Scores
    held_out: Scores


@dataclass(frozen=True)
class Entry:
    """A spec and what was measured of it.

    cost: `work_cost` over the default's; tuning and held_out: √((1 − IoU) · (1 − SSIM)), geometric means over scenes;
    iou_ratio and ssim_ratio: by how much its 1 − IoU and 1 − SSIM are those of the tuned, medians over the scenes held
    out; acne, leak and contact: their means over those that have any.
    """

    name: str
    spec: Spec
    cost: float
    tuning: float
    held_out: Interval
    iou_ratio: Interval | None
    ssim_ratio: Interval | None
    acne: float | None
    leak: float | None
    contact: float | None


@dataclass(frozen=True)
class Tuning:
    """The best at each cost, from the cheapest, with the tuned at the end where it is none of them; and the others.

    The default is the first of `others`.
    """

    split: Split
    front: tuple[Entry, ...]
    tuned: Entry
    others: tuple[Entry, ...]


def beside(found: Found) -> Tuning:
    """All that holds on every scene."""

    def entry(name: str, spec: Spec) -> Entry:
        tuning, held_out, tuned = found.tuning[spec], found.held_out[spec], found.held_out[found.tuned]
        return Entry(
            name=name,
            spec=spec,
            cost=math.exp(log_cost(tuning, found.tuning[found.others["default"]])),
            tuning=math.exp(log_error(tuning).mean()),
            held_out=geometric_mean(log_error(held_out)),
            iou_ratio=ratio("iou", held_out, tuned),
            ssim_ratio=ratio("ssim", held_out, tuned),
            acne=mean_of("acne", held_out),
            leak=mean_of("leak", held_out),
            contact=mean_of("contact", held_out),
        )

    shown = [spec for spec in dict.fromkeys([*found.front, found.tuned]) if spec in found.held_out]
    front = {spec: entry("tuned" if spec == found.tuned else "", spec) for spec in shown}
    others = tuple(entry(name, spec) for name, spec in found.others.items() if spec in found.held_out)
    return Tuning(found.split, tuple(front.values()), front[found.tuned], others)
