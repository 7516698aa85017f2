"""The cheapest spec that meets a target in a view: measured by a search, and what was found."""

import math
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Literal

from shadowbench.advice.costs import By, Cost, Unit, cost_of
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
from shadowbench.advice.target import Target, least_error
from shadowbench.measure.campaign import Campaign
from shadowbench.measure.cells import DEFAULT_REFERENCE, Cell
from shadowbench.measure.drawer import DeviceInfo
from shadowbench.measure.rows import Result
from shadowbench.measure.scoring import prepare_truth
from shadowbench.plugin.spec import Spec
from shadowbench.results.frame import write_cells
from shadowbench.results.law import Law
from shadowbench.results.times import ReferenceTime
from shadowbench.scenes.model import View
from shadowbench.studies.crossing import Techniques
from shadowbench.studies.study import Study
from shadowbench.survey.survey import Needs, needs
from shadowbench.techniques.unshadowed import Unshadowed
from shadowbench.truths.cache import cached_truth
from shadowbench.truths.trace import Truth

# By how much an error may be smaller than predicted, for the same filter and for another; from rows of all built-in
# scenes. edge_px, a mean of distances, is sensitive to single pixels, so that it falls less evenly with the map size.
# rmse of a hard shadow is the root of the share of wrong pixels, so that IoU's margins are generous.
MARGINS = {"iou": (1.8, 2.0), "edge_px": (3.5, 3.5), "rmse": (1.8, 2.0)}
UNPREDICTABLE = (math.inf, math.inf)  # rmse of a soft shadow need not fall as the map grows, since large texels blur
Standing = Literal["choice", "closest", "next", "unranked", "too slow", "misses", "so far"]
SAVED = 0.9  # cost relative to the choice's below which an alternative is worth relaxing the target for


@dataclass(frozen=True, eq=False)
class Recommendation:
    """Result of `recommend`.

    choice: the cheapest trial that meets the target, None if none does; trials: all successful ones, by cost;
    unsuccessful: status by spec of the others; excluded: specs that were not tried, by the survey or on principle;
    unranked: why specs have no cost, an infinite one in their trials; untried: those not tried by what is predicted of
    them, by technique; space_size: number of specs in the full space; needs: survey of the view, without penumbrae;
    reference: reference time of costs in milliseconds, None if costs are work, or predicted; cost: what ranks; among:
    the techniques that were asked for, empty for all.
    """

    view: View
    target: Target
    cost: Cost
    choice: Trial | None
    trials: tuple[Trial, ...]
    unsuccessful: Mapping[str, str]
    excluded: tuple[Exclusion, ...]
    unranked: Mapping[Spec, str]
    untried: Mapping[str, Untried]
    space_size: int
    needs: Needs
    reference: ReferenceTime | None
    among: tuple[str, ...] = ()

    @property
    def unit(self) -> Unit:
        """Of costs."""
        return self.cost.unit

    @property
    def law(self) -> Law | None:
        """By which costs are predicted, None if they are not."""
        return self.cost.law

    def __repr__(self) -> str:
        """One line: scene, target and choice."""
        choice = "nothing meets it" if self.choice is None else self.choice.spec.text
        measured = f"{self.measured} of {self.space_size} specs measured"
        return f"<Recommendation for {self.view.scene.name}, {self.target}: {choice}; {measured}>"

    @property
    def measured(self) -> int:
        """Number of specs that were tried: measured, or found to be unsupported or to fail."""
        return len(self.trials) + len(self.unsuccessful)

    @property
    def met(self) -> list[Trial]:
        """The trials that meet the target but for its budget, by cost."""
        return [trial for trial in self.trials if trial.error <= self.target.limit]

    @cached_property
    def closest(self) -> Trial | None:
        """Without a choice, the most accurate trial within the budget; of all trials if none is."""
        if self.choice is not None:
            return None
        within = [trial for trial in self.trials if self.target.affords(trial.cost)]
        return min(within or self.trials, key=lambda trial: (trial.error, trial.cost, trial.bytes), default=None)

    @cached_property
    def runners_up(self) -> tuple[Trial, ...]:
        """Of each technique but the choice's the cheapest trial that meets the target, else the most accurate.

        One with a cost and one without.
        """
        best: dict[tuple[str, bool], Trial] = {}
        for trial in (*self.met, *sorted(self.trials, key=lambda trial: (trial.error, trial.cost))):
            best.setdefault((trial.spec.technique.name, trial.ranked), trial)
        if self.choice is not None:
            best.pop((self.choice.spec.technique.name, self.choice.ranked))
        return tuple(sorted(best.values(), key=lambda trial: (trial.error > self.target.limit, trial.cost)))

    @property
    def cheaper(self) -> Trial | None:
        """The most accurate trial that saves a tenth of the choice's cost or more, and to which a target can relax."""
        most = SAVED * self.choice.cost if self.choice is not None and self.choice.ranked else -math.inf
        cheaper = [trial for trial in self.trials if trial.cost <= most and math.isfinite(trial.error)]
        return min(cheaper, key=lambda trial: (trial.error, trial.cost), default=None)

    @property
    def better(self) -> Trial | None:
        """The cheapest trial with less than half of the choice's error, and with a cost."""
        least = self.choice.error / 2 if self.choice is not None else -math.inf
        better = [trial for trial in self.trials if trial.error < least and trial.ranked]
        return min(better, key=lambda trial: (trial.cost, trial.error), default=None)

    def standing(self, trial: Trial) -> Standing:
        """What a trial is: its line in the table of `recommend`."""
        if trial is self.choice:
            return "choice"
        if trial is self.closest:
            return "closest"
        if trial.error <= self.target.limit and not trial.ranked:
            return "unranked"
        if trial.error <= self.target.limit:
            return "next" if self.target.affords(trial.cost) else "too slow"
        return "so far" if trial.spec.technique.name in self.untried else "misses"


def has_penumbra(view: View) -> bool:
    """Whether any pixel of a view is in penumbra, so that RMSE ranks its shadows."""
    return view.light.soft and prepare_truth(cached_truth(view)).soft


def recommend(
    view: View,
    target: Target,
    known: Techniques,
    campaign: Campaign,
    *,
    by: By | None = None,
    timed: bool = True,
    among: Sequence[str] = (),
    device: str | None = None,
) -> tuple[Recommendation, DeviceInfo]:
    """The cheapest measured of the `known` techniques that meets a target in a view, and the device.

    Measures into a campaign's folder: rows, masks, pictures, `table.csv`, `run.json`. by, timed, device: as by
    `cost_of`; among: names of the techniques to search, all if empty. Raises InputError for a folder with other files,
    a budget or a law where it cannot be, a device without pipeline statistics, and names of techniques of which none
    supports the light.
    """
    chosen_techniques(known, among, view.light.hard_kind, view.light.soft)  # before the truth is traced
    info = campaign.drawer.info
    cost = cost_of(target, view, info, by, timed, device)
    campaign.reporter.stage("truth", 1)
    study = Study.of([view.scene], [DEFAULT_REFERENCE], view_size=view.size, rounds=cost.rounds)
    block = study.block(view)
    truth = cached_truth(view)
    results: list[Result] = []
    with campaign:
        campaign.reporter.stage("measuring", None)  # the search ends when no spec is left that may be cheaper

        def measure(spec: Spec) -> Result:
            (found,) = campaign.measure([replace(block, cells=(Cell(spec),))])
            results.extend(found)
            return results[-1]

        found = find_cheapest(view, truth, target, cost, known, info.max_map_size, measure, among)
        campaign.finish(study.facts, view.scene.notes, [result.score["key"] for result in results])
        if results:
            write_cells(campaign.folder, {})
    return found, info


def find_cheapest(
    view: View,
    truth: Truth,
    target: Target,
    cost: Cost,
    known: Techniques,
    largest: int,
    measure: Callable[[Spec], Result],
    among: Sequence[str] = (),
) -> Recommendation:
    """Search the specs of `known` techniques, or of those named, with maps up to `largest`.

    Raises InputError as `needs` does, and if none of those named supports the light.
    """
    kind, soft = view.light.hard_kind, view.light.soft
    known = chosen_techniques(known, among, kind, soft)
    survey = needs(view, penumbrae=False)  # those rule out no spec
    space = full_space(known, kind, largest, soft)
    space_size = len(space)
    excluded = [
        *(Exclusion(name, why, 0) for name, why in unavailable(known, kind, soft).items()),
        *untried_filters(space, soft),
    ]
    left_out = prune(space, survey, target.value if target.metric == "iou" else None)
    if (lit := _nothing_dark(view, truth, target)) is not None:
        excluded, left_out = [Exclusion(f"all but {Unshadowed.name}", lit, len(space))], {}
        space, space_size = [Spec(Unshadowed, Unshadowed.Params())], space_size + 1
    unranked = {spec: why for spec in space if (why := cost.unranked(spec)) is not None}
    unsuccessful: dict[str, str] = {}

    def search_of(specs: Sequence[Spec], by: Cost) -> Search:
        def try_spec(spec: Spec) -> Trial | None:
            result = measure(spec)
            if (status := by.status(result)) == "ok":
                return by.trial(spec, result, target, view)
            unsuccessful[spec.text] = status
            return None

        return Search(
            space=specs,
            limit=target.limit,
            base=lambda spec: by.base(spec, view),
            start=lambda spec: start_size(spec, survey),
            measure=try_spec,
            margins=UNPREDICTABLE if target.metric == "rmse" and soft else MARGINS[target.metric],
            least=least_error(truth, target.metric),
        )

    ranked = search_of([spec for spec in space if not {spec} & (left_out.keys() | unranked.keys())], cost)
    others = search_of([spec for spec in unranked if spec not in left_out], Cost("work"))
    if ranked.run() is not None:
        ranked.run_spare(spec for spec in left_out if spec not in unranked)
        others.run_first()
    elif others.run() is None and ranked.run_rest(spec for spec in left_out if spec not in unranked) is None:
        others.run_rest(spec for spec in left_out if spec in unranked)
    trials, reference = cost.compared(ranked.trials)
    trials = sorted((*trials, *(replace(one, cost=math.inf) for one in others.trials)), key=lambda trial: trial.rank)
    tried = {trial.spec for trial in trials}
    searched = {*tried, *ranked.unmeasured, *others.unmeasured}
    left_out = {spec: why for spec, why in left_out.items() if spec not in searched and spec.text not in unsuccessful}
    excluded += [Exclusion(*reason, count) for reason, count in Counter(left_out.values()).items()]
    untried = ranked.untried()
    for spec in others.unmeasured:
        untried.setdefault(spec.technique.name, Untried()).unranked += 1
    best = next((trial for trial in trials if trial.error <= target.limit), None)
    return Recommendation(
        view=view,
        target=target,
        cost=cost,
        choice=best if best is not None and target.affords(best.cost) else None,
        trials=tuple(trials),
        unsuccessful=unsuccessful,
        excluded=tuple(excluded),
        unranked={spec: why for spec, why in unranked.items() if spec in tried},
        untried=untried,
        space_size=space_size,
        needs=survey,
        reference=reference,
        among=tuple(among),
    )


def _nothing_dark(view: View, truth: Truth, target: Target) -> str | None:
    """Why drawing no shadow is enough; None if it is not."""
    by_rmse = target.metric == "rmse"
    if (truth.receivers & (truth.visibility < (1.0 if by_rmse else 0.5))).any():
        return None
    return f"nothing that is seen is {'in shadow' if by_rmse or not view.light.soft else 'more than half in shadow'}"
