"""`tune`: a technique's parameters at their best for each cost, searched on some scenes and compared on others."""

import hashlib
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import pandas as pd

from shadowbench.errors import InputError
from shadowbench.studies.study import Block
from shadowbench.studies.tables import Interval
from shadowbench.studies.tune_cells import Cells
from shadowbench.studies.tune_scores import front, geometric_mean, log_error, mean_of, ratio, scene_scores
from shadowbench.studies.tune_space import Space
from shadowbench.studies.worker import CellFailed
from shadowbench.techniques.spec import Spec, format_spec

if TYPE_CHECKING:
    from optuna import Study, Trial

BATCH = 8
"""Trials that are drawn before any of them is told, so that a scene is loaded once for all of them."""

_RANDOM = 0.4  # of the trials of a search are random, before it learns
_SEED = 0
_DIGITS = 2  # of the logarithm of a cost: what differs by less than 1% costs the same


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
    """What a search found: the best at each cost, from the cheapest, and what they are set beside.

    The tuned is the best of those that cost no more than the default; the default is the first of `others`.
    """

    tuned: Entry
    front: tuple[Entry, ...]
    others: tuple[Entry, ...]


def split(scenes: Sequence[str], held_out: Sequence[str]) -> tuple[list[str], list[str]]:
    """The scenes to tune on, and those held out: the ones named, or every third in the order of their names' hashes.

    Raises InputError unless there is one of each.
    """
    for name in held_out:
        if name not in scenes:
            raise InputError(f"--held-out: found {name!r:.60}; allowed are scenes that take part: {', '.join(scenes)}")
    if not held_out:
        held_out = sorted(scenes, key=lambda name: hashlib.sha256(name.encode()).hexdigest())[1::3]
    tuning = [name for name in scenes if name not in held_out]
    if not tuning or not held_out:
        raise InputError(
            f"--scenes: {len(tuning)} to tune on, {len(held_out)} held out ({', '.join(scenes) or 'none takes part'}); "
            "allowed: at least one of each"
        )
    return tuning, [name for name in scenes if name in held_out]


class Search:
    """Optuna's tree-structured Parzen estimator, for two objectives, error and cost (Ozaki et al. 2022), then for one.

    Half of the trials search the whole space; the other half the numbers of what is then the best that costs no more
    than the default. The same space, scenes and number of trials give the same trials, so that a call that finds rows
    goes on from them. The default and what it is set beside are trials too, where the space holds them: the tuned is
    never behind them on the tuning scenes, whatever it is on the others.
    """

    def __init__(self, space: Space, cells: Cells, tuning: Sequence[Block], held_out: Sequence[Block]) -> None:
        self.space, self.cells, self.tuning, self.held_out = space, cells, tuning, held_out
        self.default = space.home
        self._tried: dict[Spec, pd.DataFrame] = {}  # what held on the tuning scenes, with its scores
        self._lost: set[Spec] = set()  # what did not

    def run(self, trials: int, others: Mapping[str, Spec]) -> Tuning:
        """Search, then set the best beside the default and `others`, by name; CellFailed where the default fails."""
        named = {"default": self.default, **others}
        outside = sum(self.space.point(spec) is None for spec in named.values())
        self._stage("tuning", trials + outside, self.tuning)
        self._try([self.default])
        _check(self.default, self._tried)
        self._explore(self.space, trials - trials // 2, 2, list(named.values()))
        _, best = self._best()
        near = self.space.around(best)
        if near.point(best):  # it has numbers
            self._explore(near, trials // 2, 1, list(self._tried))
        self._try(list(named.values()))
        return self._beside(named)

    def _explore(self, space: Space, trials: int, goals: int, first: Sequence[Spec]) -> None:
        """Try what Optuna suggests, after those of `first` that the space holds; those tried before are no trials."""
        held = [spec for spec in first if space.point(spec) is not None]
        study = _study(goals, round(_RANDOM * trials))
        for spec in held:
            study.enqueue_trial(space.point(spec) or {})
        left = trials + sum(spec in self._tried for spec in held)
        while left > 0:
            batch = [study.ask() for _ in range(min(BATCH, left))]
            left -= len(batch)
            specs = [self._suggested(space, trial) for trial in batch]
            self._try([spec for spec in specs if spec is not None])
            for trial, one in zip(batch, specs, strict=True):
                if one is not None and one in self._tried:
                    study.tell(trial, (self._error(one), self._cost(one))[:goals])
                else:
                    _fail(study, trial)

    def _suggested(self, space: Space, trial: "Trial") -> Spec | None:
        try:
            return space.spec(trial)
        except InputError as error:  # values that do not go together
            self.cells.reporter.note(f"{error}; it is left out")
            return None

    def _try(self, specs: Sequence[Spec]) -> None:
        """Measure those of the specs that were not, on the tuning scenes."""
        fresh = [spec for spec in dict.fromkeys(specs) if spec not in self._tried and spec not in self._lost]
        held = self._scores(fresh, self.tuning)
        self._tried |= held
        self._lost |= set(fresh) - set(held)

    def _scores(self, specs: Sequence[Spec], blocks: Sequence[Block]) -> dict[Spec, pd.DataFrame]:
        """By spec, what `scene_scores` gives, of those that held in every cell; the others are noted."""
        found: dict[Spec, pd.DataFrame] = {}
        for spec, rows in self.cells.measured(specs, blocks).items():
            lost = next((row for row in rows if row["status"] != "ok"), None)
            if lost is None:
                found[spec] = scene_scores(rows)
            else:
                self.cells.reporter.note(f"{format_spec(spec)}: {lost['scene']}: {lost['status']}; it is left out")
        return found

    def _best(self) -> tuple[list[Spec], Spec]:
        """The best at each cost, from the cheapest, and the best of them that costs no more than the default."""
        found = list(self._tried)
        kept = front([self._cost(spec) for spec in found], [self._error(spec) for spec in found])
        best = [found[i] for i in kept]
        return best, [spec for spec in best if self._cost(spec) <= 0][-1]

    def _beside(self, named: Mapping[str, Spec]) -> Tuning:
        """The best and the others on the scenes held out, those that hold on all scenes."""
        best, tuned = self._best()
        chosen = [spec for spec in dict.fromkeys([*best, *named.values()]) if spec in self._tried]
        self._stage("held out", len(chosen), self.held_out)
        scores = self._scores(chosen, self.held_out)
        _check(tuned, scores)
        _check(self.default, scores)

        def entry(name: str, spec: Spec) -> Entry:
            own = scores[spec]
            return Entry(
                name=name,
                spec=spec,
                cost=math.exp(self._cost(spec)),
                tuning=math.exp(self._error(spec)),
                held_out=geometric_mean(log_error(own)),
                iou_ratio=ratio("iou", own, scores[tuned]),
                ssim_ratio=ratio("ssim", own, scores[tuned]),
                acne=mean_of("acne", own),
                leak=mean_of("leak", own),
                contact=mean_of("contact", own),
            )

        return Tuning(
            tuned=entry("tuned", tuned),
            front=tuple(entry("tuned" if spec == tuned else "", spec) for spec in best if spec in scores),
            others=tuple(entry(name, spec) for name, spec in named.items() if spec in scores),
        )

    def _stage(self, name: str, specs: int, blocks: Sequence[Block]) -> None:
        self.cells.reporter.stage(name, specs * self.cells.each(self.default) * len(blocks))

    def _error(self, spec: Spec) -> float:
        """Mean over the tuning scenes of the logarithm of the error."""
        return float(log_error(self._tried[spec]).mean())

    def _cost(self, spec: Spec) -> float:
        """Mean over the tuning scenes of the logarithm of the cost over the default's."""
        return round(float((self._tried[spec]["cost"] - self._tried[self.default]["cost"]).mean()), _DIGITS)


def _check(spec: Spec, scores: Mapping[Spec, pd.DataFrame]) -> None:
    if spec not in scores:
        raise CellFailed(f"{format_spec(spec)} does not hold on every scene, so that nothing can be set beside it")


def _study(goals: int, random: int) -> "Study":
    import optuna

    optuna.logging.set_verbosity(optuna.logging.WARNING)
    sampler = optuna.samplers.TPESampler(n_startup_trials=max(1, random), seed=_SEED)
    return optuna.create_study(directions=["minimize"] * goals, sampler=sampler)


def _fail(study: "Study", trial: "Trial") -> None:
    from optuna.trial import TrialState

    study.tell(trial, state=TrialState.FAIL)
