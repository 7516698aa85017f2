"""The cheapest spec that meets a target in one view: target, search and result."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from shadowbench.advice.search import Search, Trial, Untried
from shadowbench.advice.space import (
    Exclusion,
    chosen_techniques,
    full_space,
    prune,
    start_size,
    unavailable,
    untried_filters,
)
from shadowbench.advice.target import Measure, Target
from shadowbench.measure.rows import Result
from shadowbench.plugin.base import Technique
from shadowbench.plugin.spec import Spec
from shadowbench.results.tables import cells_frame
from shadowbench.results.times import ReferenceTime, normalise_times
from shadowbench.scenes.model import View
from shadowbench.scores.masks import ThresholdedMask
from shadowbench.survey.survey import Needs, needs
from shadowbench.techniques.unshadowed import Unshadowed
from shadowbench.truths.trace import Truth

Unit = Literal["work", "ms"]
# By how much an error may be smaller than predicted, for the same filter and for another; from rows of all built-in
# scenes. edge_px, a mean of distances, is sensitive to single pixels, so that it falls less evenly with the map size.
# rmse of a hard shadow is the root of the share of wrong pixels, so that IoU's margins are generous.
MARGINS = {"iou": (1.8, 2.0), "edge_px": (3.5, 3.5), "rmse": (1.8, 2.0)}
# rmse of a soft shadow need not fall as the map grows, since large texels blur: nothing is left out by a prediction.
UNPREDICTABLE = (math.inf, math.inf)
Standing = Literal["choice", "closest", "next", "too slow", "misses", "so far"]
SAVED = 0.9  # cost relative to the choice's below which an alternative is worth relaxing the target for


@dataclass(frozen=True, eq=False)
class Recommendation:
    """Result of `recommend`.

    choice: the cheapest trial that meets the target, None if none does; closest: in that case, the trial closest to the
    target; runners_up: the best trial of each technique but the choice's; trials: all successful ones, by cost;
    unsuccessful: status by spec of the others; excluded: specs that were not tried, by the survey or on principle;
    untried: those not tried by what is predicted of them, by technique; space_size: number of specs in the full space;
    cheaper, better: the next trials on either side of the choice, None at the ends; needs: survey of the view, without
    penumbrae; reference: reference time of costs in milliseconds, None if costs are work; among: the techniques that
    were asked for, empty for all.
    """

    view: View
    target: Target
    unit: Unit
    choice: Trial | None
    closest: Trial | None
    runners_up: tuple[Trial, ...]
    trials: tuple[Trial, ...]
    unsuccessful: Mapping[str, str]
    excluded: tuple[Exclusion, ...]
    untried: Mapping[str, Untried]
    space_size: int
    cheaper: Trial | None
    better: Trial | None
    needs: Needs
    reference: ReferenceTime | None
    among: tuple[str, ...] = ()

    def __repr__(self) -> str:
        """One line: scene, target and choice."""
        choice = "nothing meets it" if self.choice is None else self.choice.spec.text
        measured = f"{self.measured} of {self.space_size} specs measured"
        return f"<Recommendation for {self.view.scene.name}, {self.target}: {choice}; {measured}>"

    @property
    def measured(self) -> int:
        """Number of specs that were tried: measured, or found to be unsupported or to fail."""
        return len(self.trials) + len(self.unsuccessful)

    def standing(self, trial: Trial) -> Standing:
        """What a trial is: its line in the table of `recommend`."""
        if trial is self.choice:
            return "choice"
        if trial is self.closest:
            return "closest"
        if trial.error <= self.target.limit:
            return "next" if self.target.affords(trial.cost) else "too slow"
        return "so far" if trial.spec.technique.name in self.untried else "misses"


def find_cheapest(
    view: View,
    truth: Truth,
    target: Target,
    unit: Unit,
    known: Mapping[str, type[Technique]],
    largest: int,
    measure: Callable[[Spec], Result],
    among: Sequence[str] = (),
) -> Recommendation:
    """Search the specs of `known` techniques, or of those named, with maps up to `largest`.

    Raises InputError as `needs` does, and if none of those named supports the light.
    """
    known = chosen_techniques(known, among, view.light.hard_kind, view.light.soft)
    found = needs(view, penumbrae=False)  # those rule out no spec
    space = full_space(known, view.light.hard_kind, largest, view.light.soft)
    left, out = _to_search(view, truth, target, unit, known, space, found)
    unsuccessful: dict[str, str] = {}

    def try_spec(spec: Spec) -> Trial | None:
        result = measure(spec)
        status = result.status
        if status == "ok" and unit == "ms" and _ratio(result) is None:
            status = f"failed: no ratio to the reference: {result.time and result.time['no_ratio']}"
        if status != "ok":
            unsuccessful[spec.text] = status
            return None
        return trial_of(spec, result, target, unit)

    search = Search(
        space=left,
        limit=target.limit,
        pixels=view.size**2,
        start=lambda spec: start_size(spec, found),
        measure=try_spec,
        margins=UNPREDICTABLE if target.metric == "rmse" and view.light.soft else MARGINS[target.metric],
        price=1.0 if unit == "work" else 0.0,
        least=least_error(truth, target.metric),
    )
    best, trials, reference = _searched(search, unit)
    best = best if best is None or target.affords(best.cost) else None
    return Recommendation(
        view=view,
        target=target,
        unit=unit,
        choice=best,
        closest=None if best else closest(trials, target),
        runners_up=runners_up(trials, best, target),
        trials=tuple(sorted(trials, key=lambda trial: (trial.cost, trial.bytes, trial.error))),
        unsuccessful=unsuccessful,
        excluded=tuple(out),
        untried=search.untried(),
        space_size=len({*space, *left}),
        cheaper=_cheaper(trials, best),
        better=_better(trials, best),
        needs=found,
        reference=reference,
        among=tuple(among),
    )


def _searched(search: Search, unit: Unit) -> tuple[Trial | None, list[Trial], ReferenceTime | None]:
    """The cheapest trial that meets the target, all trials, and the reference time of costs in milliseconds."""
    best = search.run()
    if unit == "work" or not search.trials:
        return best, search.trials, None
    trials, reference = to_milliseconds(search.trials)
    return trials[search.trials.index(best)] if best else None, trials, reference


def _to_search(
    view: View,
    truth: Truth,
    target: Target,
    unit: Unit,
    known: Mapping[str, type[Technique]],
    space: Sequence[Spec],
    found: Needs,
) -> tuple[list[Spec], list[Exclusion]]:
    """The specs of a space that are searched, `unshadowed` alone where nothing is dark, and what is excluded."""
    if not (truth.receivers & (truth.visibility < (1.0 if target.metric == "rmse" else 0.5))).any():
        dark = "in shadow" if target.metric == "rmse" or not view.light.soft else "more than half in shadow"
        left_out = Exclusion(f"all but {Unshadowed.name}", f"nothing that is seen is {dark}", len(space))
        return [Spec(Unshadowed, Unshadowed.Params())], [left_out]
    left, excluded = prune(space, found, target.value if target.metric == "iou" else None, unit == "work")
    declined = unavailable(known, view.light.hard_kind, view.light.soft)
    return left, [*declined, *untried_filters(space, view.light.soft), *excluded]


def least_error(truth: Truth, metric: Measure) -> float:
    """Approximate error of a single wrong pixel, of the shadow or of its edge: the smallest error above 0."""
    mask = ThresholdedMask(truth.visibility, truth.receivers & ~truth.undecided)
    if metric == "rmse":
        return 1 / math.sqrt(max(int(np.count_nonzero(mask.valid)), 1))
    return 1 / max(int(np.count_nonzero(mask.shadow if metric == "iou" else mask.edge)), 1)


def trial_of(spec: Spec, result: Result, target: Target, unit: Unit) -> Trial:
    """Trial of a measured spec; its cost is its work, or, if `unit` is ms, its ratio to the reference.

    In the latter case, the fixed cost is the ratio times the vertices' share of the work.
    """
    row = result.score
    work = row["work"]
    vertices = float(work.get("vertices", 0) + work.get("geometry", 0))
    if unit == "work":
        cost, fixed = float(work["cost"]), vertices
    else:
        ratio = _ratio(result)
        assert ratio is not None
        cost = ratio
        fixed = cost * vertices / work["cost"] if "cost" in work else 0.0
    return Trial(spec, cost, fixed, int(row["gpu_bytes"]), target.error(row["metrics"]), result)


def to_milliseconds(trials: Sequence[Trial]) -> tuple[list[Trial], ReferenceTime]:
    """Trials with costs in milliseconds in place of ratios, by one time of their reference, which is returned too."""
    _, reference = normalise_times(cells_frame([trial.result for trial in trials if trial.result is not None]))
    assert reference is not None
    return [
        replace(trial, cost=trial.cost * reference.ms, fixed=trial.fixed * reference.ms) for trial in trials
    ], reference


def _ratio(result: Result) -> float | None:
    ratio = None if result.time is None else result.time["ratio"]
    return None if ratio is None else float(ratio)


def closest(trials: Sequence[Trial], target: Target) -> Trial | None:
    """The most accurate trial within the budget; of all trials if none is."""
    within = [trial for trial in trials if target.affords(trial.cost)]
    return min(within or trials, key=lambda trial: (trial.error, trial.cost, trial.bytes), default=None)


def runners_up(trials: Sequence[Trial], best: Trial | None, target: Target) -> tuple[Trial, ...]:
    """For each technique but the best one's, its cheapest trial that meets the target, else its most accurate one."""
    found = []
    names = dict.fromkeys(trial.spec.technique.name for trial in trials)
    for name in [name for name in names if best is None or name != best.spec.technique.name]:
        mine = [trial for trial in trials if trial.spec.technique.name == name]
        met = [trial for trial in mine if trial.error <= target.limit]
        if met:
            found.append(min(met, key=lambda trial: (trial.cost, trial.bytes, trial.error)))
        else:
            found.append(min(mine, key=lambda trial: (trial.error, trial.cost)))
    return tuple(sorted(found, key=lambda trial: (trial.error > target.limit, trial.cost)))


def _cheaper(trials: Sequence[Trial], best: Trial | None) -> Trial | None:
    """The most accurate trial that saves a tenth of the choice's cost or more."""
    cheaper = [trial for trial in trials if best is not None and trial.cost <= SAVED * best.cost]
    less = [trial for trial in cheaper if math.isfinite(trial.error)]  # a target cannot be relaxed to an infinite error
    return min(less, key=lambda trial: (trial.error, trial.cost), default=None)


def _better(trials: Sequence[Trial], best: Trial | None) -> Trial | None:
    """The cheapest trial with less than half of the choice's error."""
    more = [trial for trial in trials if best is not None and trial.error < best.error / 2]
    return min(more, key=lambda trial: (trial.cost, trial.error), default=None)
