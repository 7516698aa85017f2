"""Search for a technique's best parameters at each cost, on the tuning scenes; evaluation on the held-out ones.

A scene is one observation: its views, phases and map sizes are averaged first.
"""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np
import optuna
import pandas as pd

from shadowbench.advice.tune_space import SceneSplit, SearchSpace, family_of
from shadowbench.errors import InputError
from shadowbench.measure.campaign import Campaign
from shadowbench.measure.cells import Block, Cell
from shadowbench.measure.drawer import CellFailed
from shadowbench.measure.rows import Record, Result
from shadowbench.plugin.params import Component
from shadowbench.plugin.spec import Spec
from shadowbench.results.times import pareto_front
from shadowbench.scenes.model import view_of
from shadowbench.scores.metrics import is_soft, ranking
from shadowbench.studies.run import readable_blocks
from shadowbench.studies.study import Study

MIN_ERROR = 1e-4
"""Lower clamp of the errors, whose logarithms are averaged."""

BATCH = 8
"""Trials suggested together before any result is reported to Optuna, so that each scene is loaded once for all."""

ERRORS = ("iou", "rmse", "ssim")
FAULTS = ("acne", "leak", "contact")
_COST_DIGITS = 2
_RANDOM = 0.4  # share of random trials at the start of a search
_SEED = 0


def scene_scores(rows: Iterable[Record]) -> pd.DataFrame:
    """One line per scene: means over cells of log(1 − IoU), log(1 − SSIM), log(work_cost), acne, leak and contact.

    The cost of another engine is 1. Soft shadows have log(RMSE) in place of log(1 − IoU), clamped to the truth's own
    error. Failed cells and cells without one of the errors are left out.
    """
    found = []
    for row in rows:
        errors = _log_errors(row) if row["status"] == "ok" else {}
        if errors:
            faults = {name: row["metrics"][name] for name in FAULTS}
            found.append({"scene": row["scene"], **errors, "cost": np.log(row["work"].get("cost", 1)), **faults})
    return pd.DataFrame(found).astype(dict.fromkeys(FAULTS, float)).groupby("scene").mean()


def _log_errors(row: Record) -> dict[str, float]:
    """Logarithms of the errors of a row, NaN for that of the other kind of shadows; empty if one has no value."""
    metrics = row["metrics"]
    ranked_by = ranking(is_soft(metrics))
    if metrics[ranked_by.name] is None or metrics["ssim"] is None:
        return {}
    error = max(ranked_by.error(metrics[ranked_by.name]), MIN_ERROR, row.get("truth_error", 0.0))
    structural = max(1 - metrics["ssim"], MIN_ERROR)
    return dict.fromkeys(ERRORS, math.nan) | {ranked_by.name: np.log(error), "ssim": np.log(structural)}


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
        faults = (None if math.isnan(mean) else mean for mean in means)
        return cls(spec, math.exp(log_cost(tuning, default)), *errors, *faults)


class TuningCells:
    """Measures specs on blocks on request; the study gives map sizes, phases and views."""

    def __init__(self, study: Study, campaign: Campaign) -> None:
        self.study, self.campaign = study, campaign
        self.results: dict[str, Result] = {}

    def eligible_blocks(self, spec: Spec) -> list[Block]:
        """Blocks for every camera and light of the study's scenes that show a shadow and that `spec` supports.

        Traces their truths; the other views are reported.
        """
        campaign, study = self.campaign, self.study
        readable = readable_blocks(study, campaign.failures) if campaign.keep_going else study.blocks()
        blocks = [
            study.block(view_of(block.view.scene, camera, block.view.light, block.view.size))
            for block in readable
            for camera in block.view.scene.cameras
        ]
        kept = []
        for block, shadows in zip(blocks, campaign.trace(blocks), strict=True):
            if shadows is None:  # it failed
                continue
            reason = "nothing is in shadow" if shadows == "lit" else campaign.drawer.unsupported(block, Cell(spec))
            if reason is None:
                kept.append(block)
            else:
                campaign.reporter.note(f"{block.view.name} takes no part: {reason}")
        return kept

    def unsupported_components(
        self, spec: Spec, names: Sequence[str], blocks: Sequence[Block]
    ) -> dict[str, frozenset[str]]:
        """By parameter, the components with which a spec does not support some kind of light in the blocks."""
        kinds = {block.view.light.kind: block for block in blocks}

        def refused(name: str, component: type[Component]) -> bool:
            cell, drawer = Cell(spec.with_(**{name: component()})), self.campaign.drawer
            return any(drawer.unsupported(block, cell) is not None for block in kinds.values())

        families = {name: family_of(type(spec.params).model_fields[name]) for name in names}
        return {name: frozenset(one.name for one in family if refused(name, one)) for name, family in families.items()}

    def cells_of(self, spec: Spec) -> tuple[Cell, ...]:
        """The cells of a spec in one block."""
        return self.study.with_specs([spec]).cells()

    def measure(self, specs: Sequence[Spec], blocks: Sequence[Block]) -> dict[Spec, list[Record]]:
        """Score rows of each spec, measured block by block, so that each scene is loaded once."""
        cells = {spec: self.cells_of(spec) for spec in specs}
        rows: dict[Spec, list[Record]] = {spec: [] for spec in cells}
        together = tuple(cell for own in cells.values() for cell in own)
        for found in self.campaign.measure(replace(block, cells=together) for block in blocks):
            by_cell = dict(zip(together, found, strict=True))
            for spec, own in cells.items():
                rows[spec] += [by_cell[cell].score for cell in own]
            self.results |= {result.score["key"]: result for result in found}
        return rows


@dataclass(frozen=True)
class Tuning:
    """What a search found: the Pareto-optimal settings by increasing cost, and the default; all cells it measured."""

    split: SceneSplit
    front: tuple[Setting, ...]
    default: Setting
    results: tuple[Result, ...]


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
        self.default, self.reporter = space.base, cells.campaign.reporter
        self._scores_of: dict[Spec, pd.DataFrame] = {}  # scores on the tuning scenes
        self._failed: set[Spec] = set()  # specs with a failed cell

    def run(self, trials: int, presets: Sequence[Spec]) -> Tuning:
        """Search, then measure the best specs and the default on the held-out scenes.

        Raises CellFailed if the default fails.
        """
        tuning, held_out = map(", ".join, (self.split.tuning, self.split.held_out))
        self.reporter.note(f"tuning on {tuning}; held out: {held_out}")
        self._stage("tuning", trials + (self.space.point(self.default) is None), self.tuning)
        self._try([self.default])
        self._explore(self.space, trials - trials // 2, 2, [self.default, *presets])
        best = [spec for spec in self._front() if self._cost(spec) <= 0][-1]  # that costs no more than the default
        near = self.space.around(best)
        if near.point(best):  # the space has numeric parameters
            self._explore(near, trials // 2, 1, list(self._scores_of))
        return self._result()

    def _explore(self, space: SearchSpace, trials: int, goals: int, first: Sequence[Spec]) -> None:
        """Try Optuna's suggestions, beginning with the specs of `first` in the space; known ones are not counted."""
        optuna.logging.set_verbosity(optuna.logging.WARNING)
        sampler = optuna.samplers.TPESampler(n_startup_trials=max(1, round(_RANDOM * trials)), seed=_SEED)
        study = optuna.create_study(directions=["minimize"] * goals, sampler=sampler)
        left = trials
        for spec in first:
            point = space.point(spec)
            if point is not None:
                study.enqueue_trial(point)
                left += spec in self._scores_of
        while left > 0:
            batch = [study.ask() for _ in range(min(BATCH, left))]
            left -= len(batch)
            specs = [self._suggest(space, trial) for trial in batch]
            self._try([spec for spec in specs if spec is not None])
            for trial, suggested in zip(batch, specs, strict=True):
                if suggested is not None and suggested in self._scores_of:
                    study.tell(trial, (self._error(suggested), self._cost(suggested))[:goals])
                else:
                    study.tell(trial, state=optuna.trial.TrialState.FAIL)

    def _suggest(self, space: SearchSpace, trial: optuna.Trial) -> Spec | None:
        try:
            return space.spec(trial)
        except InputError as error:  # an invalid combination
            self.reporter.note(f"{error}; it is left out")
            return None

    def _try(self, specs: Sequence[Spec]) -> None:
        """Measure specs on the tuning scenes unless measured before."""
        fresh = [spec for spec in dict.fromkeys(specs) if spec not in self._scores_of and spec not in self._failed]
        self._scores_of |= self._measure_scores(fresh, self.tuning)
        self._failed |= set(fresh) - self._scores_of.keys()

    def _measure_scores(self, specs: Sequence[Spec], blocks: Sequence[Block]) -> dict[Spec, pd.DataFrame]:
        """`scene_scores` of each spec whose cells all succeeded; the others are reported and left out.

        Raises CellFailed if the default is among those.
        """
        found: dict[Spec, pd.DataFrame] = {}
        for spec, rows in self.cells.measure(specs, blocks).items():
            failed = next((row for row in rows if row["status"] != "ok"), None)
            if failed is None:
                found[spec] = scene_scores(rows)
                continue
            self.reporter.note(f"{spec.text}: {failed['scene']}: {failed['status']}; it is left out")
            if spec == self.default:
                raise CellFailed(f"{spec.text} fails on some scene, so that nothing can be compared with it")
        return found

    def _front(self) -> list[Spec]:
        """Pareto-optimal specs by increasing cost, of equal ones the first."""
        found: dict[tuple[float, float], Spec] = {}
        for spec in self._scores_of:
            found.setdefault((self._cost(spec), self._error(spec)), spec)
        points = list(found)
        return [found[points[i]] for i in pareto_front(points)]

    def _result(self) -> Tuning:
        """Measure the best specs and the default on the held-out scenes."""
        best = self._front()
        chosen = list(dict.fromkeys([*best, self.default]))
        self._stage("held out", len(chosen), self.held_out)
        scores = self._measure_scores(chosen, self.held_out)
        default = self._scores_of[self.default]
        settings = {spec: Setting.of(spec, self._scores_of[spec], found, default) for spec, found in scores.items()}
        front = tuple(settings[spec] for spec in best if spec in settings)
        return Tuning(self.split, front, settings[self.default], tuple(self.cells.results.values()))

    def _stage(self, name: str, specs: int, blocks: Sequence[Block]) -> None:
        self.reporter.stage(name, specs * len(self.cells.cells_of(self.default)) * len(blocks))

    def _error(self, spec: Spec) -> float:
        """Mean log error over the tuning scenes."""
        return float(log_error(self._scores_of[spec]).mean())

    def _cost(self, spec: Spec) -> float:
        return log_cost(self._scores_of[spec], self._scores_of[self.default])
