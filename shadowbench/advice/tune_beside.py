"""What searches found, set beside the default and others on scenes that the search of each had not seen."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import pandas as pd

from shadowbench.advice.tune_folds import Fold
from shadowbench.advice.tune_scores import geometric_mean, log_cost, log_error, mean_of, ratio
from shadowbench.studies.tables import Interval
from shadowbench.techniques.spec import Spec

Scores = Mapping[Spec, pd.DataFrame]


@dataclass(frozen=True, eq=False)
class Found:
    """What the search of a fold chose, and the `scene_scores` of each spec on its scenes.

    `front`: the best at each cost, from the cheapest; `tuned`: the best of those that cost no more than the default, or
    the default, where that is not surely better on the tuning scenes; `others`: what it is set beside, the default
    first. `tuning` has all of them that hold on the tuning scenes, `held_out` those of them that hold on the other
    scenes too: at least the tuned and the default.
    """

    fold: Fold
    tuned: Spec
    front: Sequence[Spec]
    others: Mapping[str, Spec]
    tuning: Scores
    held_out: Scores


@dataclass(frozen=True)
class Entry:
    """A spec and what was measured of it; `spec` is None for the tuned of folds that chose several.

    cost: `work_cost` over the default's; tuning and held_out: √((1 − IoU) · (1 − SSIM)), geometric means over scenes;
    iou_ratio and ssim_ratio: by how much its 1 − IoU and 1 − SSIM are those of the tuned, medians over the scenes held
    out; acne, leak and contact: their means over those that have any.
    """

    name: str
    spec: Spec | None
    cost: float
    tuning: float
    held_out: Interval
    iou_ratio: Interval | None
    ssim_ratio: Interval | None
    acne: float | None
    leak: float | None
    contact: float | None


@dataclass(frozen=True)
class Best:
    """The best at each cost of a fold, from the cheapest, and the tuned at the end where it is none of them."""

    fold: Fold
    tuned: Entry
    front: tuple[Entry, ...]


@dataclass(frozen=True)
class Tuning:
    """What the search of each fold found, and over the scenes that they held out the tuned and what it is set beside.

    The tuned is in each scene what the fold chose that held it out. The default is the first of `others`.
    """

    folds: tuple[Best, ...]
    tuned: Entry
    others: tuple[Entry, ...]


def beside(found: Sequence[Found]) -> Tuning:
    """The folds alone and together; of the others those that hold on all scenes."""
    chosen = {one.tuned for one in found}
    tuned = _Scored.of([(one, one.tuned) for one in found])
    entries = [
        _Scored.of([(one, spec) for one in found]).entry(name, spec, tuned)
        for name, spec in found[0].others.items()
        if all(spec in one.held_out for one in found)
    ]
    return Tuning(
        folds=tuple(_best(one) for one in found),
        tuned=tuned.entry("tuned", chosen.pop() if len(chosen) == 1 else None, tuned),
        others=tuple(entries),
    )


def _best(found: Found) -> Best:
    shown = dict.fromkeys([*found.front, found.tuned])
    scored = {spec: _Scored.of([(found, spec)]) for spec in shown if spec in found.held_out}
    tuned = scored[found.tuned]
    entries = {spec: one.entry("tuned" if spec == found.tuned else "", spec, tuned) for spec, one in scored.items()}
    return Best(found.fold, entries[found.tuned], tuple(entries.values()))


@dataclass(frozen=True, eq=False)
class _Scored:
    """`scene_scores` of what stands for one setting, and of the default, over the scenes of one fold or several."""

    tuning: pd.DataFrame
    default: pd.DataFrame  # on the tuning scenes
    held_out: pd.DataFrame

    @classmethod
    def of(cls, chosen: Sequence[tuple[Found, Spec]]) -> "_Scored":
        return cls(
            tuning=_together([found.tuning[spec] for found, spec in chosen]),
            default=_together([found.tuning[found.others["default"]] for found, _ in chosen]),
            held_out=_together([found.held_out[spec] for found, spec in chosen]),
        )

    def entry(self, name: str, spec: Spec | None, tuned: "_Scored") -> Entry:
        return Entry(
            name=name,
            spec=spec,
            cost=math.exp(log_cost(self.tuning, self.default)),
            tuning=math.exp(log_error(self.tuning).mean()),
            held_out=geometric_mean(log_error(self.held_out)),
            iou_ratio=ratio("iou", self.held_out, tuned.held_out),
            ssim_ratio=ratio("ssim", self.held_out, tuned.held_out),
            acne=mean_of("acne", self.held_out),
            leak=mean_of("leak", self.held_out),
            contact=mean_of("contact", self.held_out),
        )


def _together(scores: Sequence[pd.DataFrame]) -> pd.DataFrame:
    """A line a scene: a scene that several folds tuned on counts once."""
    return pd.concat(scores).groupby("scene").mean()
