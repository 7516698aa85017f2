"""Search for a technique's best parameters at each cost, on the tuning scenes; evaluation on the held-out ones."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import pandas as pd

from shadowbench.advice.tune_scores import Setting, log_cost, log_error, scene_scores
from shadowbench.advice.tune_space import SceneSplit, SearchSpace, family_of
from shadowbench.errors import InputError
from shadowbench.measure.campaign import Campaign, Reporter
from shadowbench.measure.cells import Block, Cell
from shadowbench.measure.drawer import CellFailed
from shadowbench.measure.rows import Record, Result
from shadowbench.plugin.spec import Spec
from shadowbench.results.times import pareto_front
from shadowbench.scenes.model import view_of
from shadowbench.studies.run import readable_blocks
from shadowbench.studies.study import Study

if TYPE_CHECKING:
    from optuna import Study as OptunaStudy
    from optuna import Trial


class TuningCells:
    """Measures specs on blocks on request; the study gives map sizes, phases and views."""

    def __init__(self, study: Study, campaign: Campaign) -> None:
        self.study, self.campaign = study, campaign
        self.results: dict[str, Result] = {}

    @property
    def reporter(self) -> Reporter:
        """Receiver of progress messages."""
        return self.campaign.reporter

    def eligible_blocks(self, spec: Spec) -> list[Block]:
        """Blocks for every camera and light of the study's scenes that show a shadow and that `spec` supports.

        Traces their truths; the other views are reported.
        """
        going = self.campaign.keep_going
        readable = readable_blocks(self.study, self.campaign.failures) if going else self.study.blocks()
        blocks = [
            self.study.block(view_of(block.view.scene, camera, block.view.light, block.view.size))
            for block in readable
            for camera in block.view.scene.cameras
        ]
        kept = []
        for block, shadows in zip(blocks, self.campaign.trace(blocks), strict=True):
            if shadows is None:  # it failed
                continue
            reason = "nothing is in shadow" if shadows == "lit" else None
            reason = reason or self.campaign.drawer.unsupported(block, Cell(spec))
            if reason is None:
                kept.append(block)
            else:
                self.reporter.note(f"{block.view.name} takes no part: {reason}")
        return kept

    def unsupported_components(
        self, spec: Spec, names: Sequence[str], blocks: Sequence[Block]
    ) -> dict[str, frozenset[str]]:
        """By parameter, the components with which a spec does not support some kind of light in the blocks."""
        views = list({block.view.light.kind: block for block in blocks}.values())
        fields = type(spec.params).model_fields
        return {
            name: frozenset(
                one.name
                for one in family_of(fields[name])
                if any(
                    self.campaign.drawer.unsupported(block, Cell(spec.with_(**{name: one()}))) is not None
                    for block in views
                )
            )
            for name in names
        }

    def cells_per_block(self, spec: Spec) -> int:
        """Number of cells of a spec in one block."""
        return len(self._cells(spec))

    def measure(self, specs: Sequence[Spec], blocks: Sequence[Block]) -> dict[Spec, list[Record]]:
        """Score rows of each spec, measured block by block, so that each scene is loaded once."""
        cells = {spec: self._cells(spec) for spec in specs}
        rows: dict[Spec, list[Record]] = {spec: [] for spec in cells}
        together = tuple(cell for own in cells.values() for cell in own)
        for found in self.campaign.measure(replace(block, cells=together) for block in blocks):
            by_cell = dict(zip(together, found, strict=True))
            for spec, own in cells.items():
                rows[spec] += [by_cell[cell].score for cell in own]
            self.results |= {result.score["key"]: result for result in found}
        return rows

    def _cells(self, spec: Spec) -> tuple[Cell, ...]:
        return self.study.with_specs([spec]).cells()


BATCH = 8
"""Trials suggested together before any result is reported to Optuna, so that each scene is loaded once for all."""

_RANDOM = 0.4  # share of random trials at the start of a search
_SEED = 0


@dataclass(frozen=True)
class Tuning:
    """What a search found: the Pareto-optimal settings by increasing cost, and the default's scores."""

    split: SceneSplit
    front: tuple[Setting, ...]
    default: Setting


class ParameterSearch:
    """Search by Optuna's tree-structured Parzen estimator: for error and cost (Ozaki et al. 2022), then error alone.

    The first half of the trials searches the whole space, the second half the numeric parameters of the best spec that
    costs no more than the default. Trials are deterministic for the same space, scenes and number of trials, so that an
    interrupted search resumes from its rows. The default is a trial too, and so are the presets in the space.
    """

    def __init__(self, space: SearchSpace, cells: TuningCells, blocks: Sequence[Block], split: SceneSplit) -> None:
        self.space, self.cells, self.split = space, cells, split
        self.tuning = [block for block in blocks if block.view.scene.name in split.tuning]
        self.held_out = [block for block in blocks if block.view.scene.name in split.held_out]
        self.default = space.base
        self._scores_of: dict[Spec, pd.DataFrame] = {}  # scores on the tuning scenes
        self._failed: set[Spec] = set()  # specs with a failed cell

    def run(self, trials: int, presets: Sequence[Spec]) -> Tuning:
        """Search, then measure the best specs and the default on the held-out scenes.

        Raises CellFailed if the default fails.
        """
        tuning, held_out = map(", ".join, (self.split.tuning, self.split.held_out))
        self.cells.reporter.note(f"tuning on {tuning}; held out: {held_out}")
        self._stage("tuning", trials + (self.space.point(self.default) is None), self.tuning)
        self._try([self.default])
        _check(self.default, self._scores_of)
        self._explore(self.space, trials - trials // 2, 2, [self.default, *presets])
        _, best = self._best()
        near = self.space.around(best)
        if near.point(best):  # the space has numeric parameters
            self._explore(near, trials // 2, 1, list(self._scores_of))
        return self._result()

    def _explore(self, space: SearchSpace, trials: int, goals: int, first: Sequence[Spec]) -> None:
        """Try Optuna's suggestions, beginning with the specs of `first` in the space; known ones are not counted."""
        inside = [spec for spec in first if space.point(spec) is not None]
        study = _study(goals, round(_RANDOM * trials))
        for spec in inside:
            study.enqueue_trial(space.point(spec) or {})
        left = trials + sum(spec in self._scores_of for spec in inside)
        while left > 0:
            batch = [study.ask() for _ in range(min(BATCH, left))]
            left -= len(batch)
            specs = [self._suggest(space, trial) for trial in batch]
            self._try([spec for spec in specs if spec is not None])
            for trial, suggested in zip(batch, specs, strict=True):
                if suggested is not None and suggested in self._scores_of:
                    study.tell(trial, (self._error(suggested), self._cost(suggested))[:goals])
                else:
                    _tell_failed(study, trial)

    def _suggest(self, space: SearchSpace, trial: "Trial") -> Spec | None:
        try:
            return space.spec(trial)
        except InputError as error:  # an invalid combination
            self.cells.reporter.note(f"{error}; it is left out")
            return None

    def _try(self, specs: Sequence[Spec]) -> None:
        """Measure specs on the tuning scenes unless measured before."""
        fresh = [spec for spec in dict.fromkeys(specs) if spec not in self._scores_of and spec not in self._failed]
        succeeded = self._measure_scores(fresh, self.tuning)
        self._scores_of |= succeeded
        self._failed |= set(fresh) - set(succeeded)

    def _measure_scores(self, specs: Sequence[Spec], blocks: Sequence[Block]) -> dict[Spec, pd.DataFrame]:
        """`scene_scores` of each spec whose cells all succeeded; the others are reported and left out."""
        found: dict[Spec, pd.DataFrame] = {}
        for spec, rows in self.cells.measure(specs, blocks).items():
            failed = next((row for row in rows if row["status"] != "ok"), None)
            if failed is None:
                found[spec] = scene_scores(rows)
            else:
                self.cells.reporter.note(f"{spec.text}: {failed['scene']}: {failed['status']}; it is left out")
        return found

    def _best(self) -> tuple[list[Spec], Spec]:
        """Pareto-optimal specs by increasing cost, and the most accurate one that costs no more than the default."""
        found: dict[tuple[float, float], Spec] = {}
        for spec in self._scores_of:  # the first of equal ones
            found.setdefault((self._cost(spec), self._error(spec)), spec)
        points = list(found)
        best = [found[points[i]] for i in pareto_front(points)]
        return best, [spec for spec in best if self._cost(spec) <= 0][-1]

    def _result(self) -> Tuning:
        """Measure the best specs and the default on the held-out scenes."""
        best, _ = self._best()
        chosen = list(dict.fromkeys([*best, self.default]))
        self._stage("held out", len(chosen), self.held_out)
        scores = self._measure_scores(chosen, self.held_out)
        _check(self.default, scores)
        default = self._scores_of[self.default]
        settings = {spec: Setting.of(spec, self._scores_of[spec], found, default) for spec, found in scores.items()}
        return Tuning(self.split, tuple(settings[spec] for spec in best if spec in settings), settings[self.default])

    def _stage(self, name: str, specs: int, blocks: Sequence[Block]) -> None:
        self.cells.reporter.stage(name, specs * self.cells.cells_per_block(self.default) * len(blocks))

    def _error(self, spec: Spec) -> float:
        """Mean log error over the tuning scenes."""
        return float(log_error(self._scores_of[spec]).mean())

    def _cost(self, spec: Spec) -> float:
        return log_cost(self._scores_of[spec], self._scores_of[self.default])


def _check(spec: Spec, scores: Mapping[Spec, pd.DataFrame]) -> None:
    if spec not in scores:
        raise CellFailed(f"{spec.text} fails on some scene, so that nothing can be compared with it")


def _study(goals: int, random: int) -> "OptunaStudy":
    import optuna

    optuna.logging.set_verbosity(optuna.logging.WARNING)
    sampler = optuna.samplers.TPESampler(n_startup_trials=max(1, random), seed=_SEED)
    return optuna.create_study(directions=["minimize"] * goals, sampler=sampler)


def _tell_failed(study: "OptunaStudy", trial: "Trial") -> None:
    from optuna.trial import TrialState

    study.tell(trial, state=TrialState.FAIL)
