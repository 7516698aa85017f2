"""`tune`: a technique's parameters at their best for each cost, searched on some scenes and compared on others."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import pandas as pd

from shadowbench.advice.tune_beside import Found, Tuning, beside
from shadowbench.advice.tune_cells import Cells
from shadowbench.advice.tune_scores import log_cost, log_error, scene_scores, surely_less
from shadowbench.advice.tune_space import Space
from shadowbench.advice.tune_split import Split
from shadowbench.errors import InputError
from shadowbench.measure.cells import Block
from shadowbench.measure.executor import CellFailed
from shadowbench.studies.times import pareto_front
from shadowbench.techniques.spec import Spec

if TYPE_CHECKING:
    from optuna import Study, Trial

BATCH = 8
"""Trials that are drawn before any of them is told, so that a scene is loaded once for all of them."""

_RANDOM = 0.4  # of the trials of a search are random, before it learns
_SEED = 0


def tune(
    space: Space, cells: Cells, blocks: Sequence[Block], split: Split, trials: int, others: Mapping[str, Spec]
) -> Tuning:
    """Search so many trials on the scenes to tune on, and set what was found beside `others`, by name, on the rest.

    Nothing is measured twice. Raises CellFailed as `Search.run` does.
    """
    cells.reporter.note(f"tuning on {', '.join(split.tuning)}; held out: {', '.join(split.held_out)}")
    return beside(Search(space, cells, blocks, split).run(trials, others))


class Search:
    """Optuna's tree-structured Parzen estimator, for two objectives, error and cost (Ozaki et al. 2022), then for one.

    Half of the trials search the whole space; the other half the numbers of what is then the best that costs no more
    than the default. The same space, scenes and number of trials give the same trials, so that a call that finds rows
    goes on from them. The default and what it is set beside are trials too, where the space holds them.

    The best of a hundred settings on a dozen scenes may be the best on these alone. It is taken where it is surely
    better than the default on them, by an interval over scenes; else the default stands, as the simplest model does
    that is within the scatter of the best (Breiman et al. 1984).
    """

    def __init__(self, space: Space, cells: Cells, blocks: Sequence[Block], split: Split) -> None:
        self.space, self.cells, self.split = space, cells, split
        self.tuning = [block for block in blocks if block.scene.name in split.tuning]
        self.held_out = [block for block in blocks if block.scene.name in split.held_out]
        self.default = space.home
        self._tried: dict[Spec, pd.DataFrame] = {}  # what held on the tuning scenes, with its scores
        self._lost: set[Spec] = set()  # what did not

    def run(self, trials: int, others: Mapping[str, Spec]) -> Found:
        """Search, then measure the best, the default and `others`, by name, on the scenes held out.

        Raises CellFailed where the default fails, or what was found fails on those.
        """
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
        return self._found(named)

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
        for spec, rows in self.cells.measure(specs, blocks).items():
            lost = next((row for row in rows if row["status"] != "ok"), None)
            if lost is None:
                found[spec] = scene_scores(rows)
            else:
                self.cells.reporter.note(f"{spec.text}: {lost['scene']}: {lost['status']}; it is left out")
        return found

    def _best(self) -> tuple[list[Spec], Spec]:
        """The best at each cost, from the cheapest, and the best of them that costs no more than the default."""
        found: dict[tuple[float, float], Spec] = {}
        for spec in self._tried:  # of equal ones the first
            found.setdefault((self._cost(spec), self._error(spec)), spec)
        points = list(found)
        best = [found[points[i]] for i in pareto_front(points)]
        return best, [spec for spec in best if self._cost(spec) <= 0][-1]

    def _found(self, named: Mapping[str, Spec]) -> Found:
        """The best and the others on the scenes held out."""
        best, least = self._best()
        better = surely_less(self._tried[least], self._tried[self.default])
        tuned = least if better else self.default
        chosen = [spec for spec in dict.fromkeys([*best, *named.values()]) if spec in self._tried]
        self._stage("held out", len(chosen), self.held_out)
        scores = self._scores(chosen, self.held_out)
        _check(tuned, scores)
        _check(self.default, scores)
        tried = {spec: self._tried[spec] for spec in chosen}
        return Found(self.split, tuned, best, named, tried, scores)

    def _stage(self, name: str, specs: int, blocks: Sequence[Block]) -> None:
        self.cells.reporter.stage(name, specs * self.cells.each(self.default) * len(blocks))

    def _error(self, spec: Spec) -> float:
        """Mean over the tuning scenes of the logarithm of the error."""
        return float(log_error(self._tried[spec]).mean())

    def _cost(self, spec: Spec) -> float:
        return log_cost(self._tried[spec], self._tried[self.default])


def _check(spec: Spec, scores: Mapping[Spec, pd.DataFrame]) -> None:
    if spec not in scores:
        raise CellFailed(f"{spec.text} does not hold on every scene, so that nothing can be set beside it")


def _study(goals: int, random: int) -> "Study":
    import optuna

    optuna.logging.set_verbosity(optuna.logging.WARNING)
    sampler = optuna.samplers.TPESampler(n_startup_trials=max(1, random), seed=_SEED)
    return optuna.create_study(directions=["minimize"] * goals, sampler=sampler)


def _fail(study: "Study", trial: "Trial") -> None:
    from optuna.trial import TrialState

    study.tell(trial, state=TrialState.FAIL)
