"""The cheapest spec that meets a target in a view: what is asked, what ranks, the search, and what came of it."""

import math
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Literal, NamedTuple, get_args

import numpy as np

from shadowbench.advice.search import (
    TINY,
    Exclusion,
    Search,
    Trial,
    chosen_techniques,
    full_space,
    prune,
    reads_of,
    start_size,
    unavailable,
)
from shadowbench.errors import InputError
from shadowbench.measure.campaign import DEFAULT_REFERENCE, UNSHADOWED, Campaign, Cell
from shadowbench.measure.rows import Result
from shadowbench.measure.scoring import prepare_truth
from shadowbench.measure.worker import DeviceInfo
from shadowbench.plugin.spec import Spec
from shadowbench.results.frame import cells_frame, write_cells
from shadowbench.results.law import SHORTEST_MS, Law, counts_of, find_law, kind_of, law_on_record
from shadowbench.results.summary import Target
from shadowbench.results.times import ReferenceTime, normalise_times
from shadowbench.scenes.model import View
from shadowbench.scenes.sequences import BUILT_IN, frames_of
from shadowbench.scores.masks import ThresholdedMask
from shadowbench.scores.metrics import METRICS, ranking
from shadowbench.studies.crossing import Techniques
from shadowbench.studies.study import Study
from shadowbench.survey.survey import Needs, needs
from shadowbench.truths.cache import cached_truth
from shadowbench.truths.trace import Truth

MOST = {"iou": 1.0, "edge_px": math.inf, "rmse": 1.0}
"""The metrics that a target may be of, and their largest values."""


def target_of(
    min_iou: float | None = None, max_edge_px: float | None = None, max_rmse: float | None = None
) -> Target | None:
    """Target given by options, None if none is. Raises InputError for invalid or conflicting ones."""
    values = {"--min-iou": min_iou, "--max-edge-px": max_edge_px, "--max-rmse": max_rmse}
    targets = {
        option: Target(metric, value)
        for metric, (option, value) in zip(MOST, values.items(), strict=True)
        if value is not None
    }
    if len(targets) > 1:
        raise InputError(
            f"{' and '.join(targets)}: found {'both' if len(targets) == 2 else 'all'}; allowed: one of them"
        )
    for option, target in targets.items():
        most = MOST[target.metric]
        if not 0 <= target.limit <= most or math.isinf(target.limit):
            allowed = "0 and more" if math.isinf(most) else f"0 to {most:g}"
            raise InputError(f"{option}: found {target.limit:g}; allowed: {allowed}")
        return target
    return None


def default_target(view: View) -> Target:
    """An IoU of 0.99, or an RMSE of 0.02 if any pixel is in penumbra, so that RMSE ranks shadows."""
    ranked_by = ranking(view.light.soft and prepare_truth(cached_truth(view)).soft)
    return Target(ranked_by.name, ranked_by.targets[1])


class Steadiness(NamedTuple):
    """The most flicker, in pixels, that is allowed in a sequence, by its name."""

    max_flicker: float
    sequence: str


def target_error(target: Target, metrics: Mapping[str, float | None]) -> float:
    """Error of a row's metrics: 1 − IoU, the edge distance in pixels, or the RMSE.

    IoU is None if neither the truth nor the mask has a shadow; the error is then 0. An edge distance is None if neither
    has an edge; the error is then 0 if their shadows are equal, else infinite.
    """
    value = metrics[target.metric]
    if value is None:
        return 0.0 if metrics["iou"] in (None, 1.0) else math.inf
    return METRICS[target.metric].error(value)


def least_error(truth: Truth, metric: str) -> float:
    """Approximate error of a single wrong pixel, of the shadow or of its edge: the smallest error above 0."""
    mask = ThresholdedMask(truth.visibility, truth.receivers & ~truth.undecided)
    if metric == "rmse":
        return 1 / math.sqrt(max(int(np.count_nonzero(mask.valid)), 1))
    return 1 / max(int(np.count_nonzero(mask.shadow if metric == "iou" else mask.edge)), 1)


ROUNDS = 9
By = Literal["work", "device", "time"]


@dataclass(frozen=True)
class Cost:
    """The cost of a spec: work, a time that a law predicts from it, or a measured time.

    without_law: where work ranks, why no law does, empty if work was asked for.
    """

    name: Literal["work_cost", "predicted_ms", "frame_ms"]
    law: Law | None = None
    without_law: str = ""

    @property
    def rounds(self) -> int:
        """Rounds in which a cell is timed."""
        return ROUNDS if self.name == "frame_ms" else 0

    def base(self, spec: Spec, view: View) -> float:
        """The part of a spec's cost that is known before it is drawn; 0 where times are measured."""
        pixels, reads = view.size.pixels, reads_of(spec)
        if self.law is not None:
            triangles = view.scene.geometry.count
            counts = {"reads": pixels * reads, "triangles": triangles, "gpu_bytes": _bytes(spec, view)}
            return self.law.share(kind_of(spec.sizeless_text), counts)
        return float(pixels * (1 + reads)) if self.name == "work_cost" else 0.0

    def unranked(self, spec: Spec) -> str | None:
        """Why the cost of a spec is not known; None if it is."""
        if self.law is None:
            return spec.technique.extra_work(spec.params) if self.name == "work_cost" else None
        kind = kind_of(spec.sizeless_text)
        if self.law.holds(kind):
            return None
        why = "its work does not tell its time" if kind in self.law.kinds else "it was not timed"
        return f"{why} on {self.law.device}"

    def status(self, result: Result) -> str:
        """`ok`, or why a cell is no trial."""
        time = result.time
        if result.status == "ok" and self.rounds and (time is None or time["ratio"] is None):
            return f"failed: no ratio to the reference: {time and time['no_ratio']}"
        return result.status

    def trial(self, spec: Spec, result: Result, target: Target, view: View) -> Trial:
        """Trial of a measured spec; its cost is its work, predicted time, or ratio to the reference.

        A predicted time is the law's sum, which may be shorter than can be told apart: see `compared`.
        """
        row, work = result.score, result.score["work"]
        cost, fixed = float(work.get("cost", 0)), float(work.get("vertices", 0) + work.get("geometry", 0))
        if self.law is not None:
            counts = counts_of(row, view.scene.geometry.count)
            kind, vertices = kind_of(spec.sizeless_text), {"frames": 0, "vertices": counts["vertices"]}
            cost, fixed = self.law.share(kind, counts), self.law.share(kind, vertices)
        elif self.name == "frame_ms" and result.time is not None:
            ratio = float(result.time["ratio"])
            cost, fixed = ratio, ratio * fixed / cost if cost else 0.0  # the vertices' share
        return Trial(spec, result, target_error(target, row["metrics"]), cost, fixed)

    def compared(self, trials: Sequence[Trial]) -> tuple[Sequence[Trial], ReferenceTime | None]:
        """Trials whose costs can be compared, and the reference time of ratios, by which they become milliseconds.

        Predicted times that cannot be told apart are equal: then less work comes first.
        """
        if self.law is not None:
            return [replace(one, cost=max(one.cost, SHORTEST_MS)) if one.cost else one for one in trials], None
        if not self.rounds or not trials:
            return trials, None
        _, reference = normalise_times(cells_frame([trial.result for trial in trials]))
        assert reference is not None
        ms = reference.ms
        return [replace(trial, cost=trial.cost * ms, fixed=trial.fixed * ms) for trial in trials], reference


def _bytes(spec: Spec, view: View) -> int:
    """Of the maps of a spec, one for each face or slice; 0 without a format of depths."""
    bits = int("".join(filter(str.isdigit, getattr(spec.params, "depth", "0"))))
    maps = 6 if view.light.hard_kind == "point" else spec.technique.view_slices(spec.params)
    return maps * (spec.map_size or 0) ** 2 * bits // 8


def cost_of(
    view: View,
    info: DeviceInfo,
    by: str | None = None,
    device: str | None = None,
    budget_ms: float | None = None,
    timed: bool = True,
) -> Cost:
    """What ranks specs on a device, by default times: of a GPU that draws, else those predicted for another.

    by: what was asked for; device: its name; timed: whether the machine may be. Raises InputError for options that
    cannot be met.
    """
    if by is not None and by not in get_args(By):
        raise InputError(f"--by: found {by!r:.60}; allowed: {', '.join(get_args(By))}")
    law = None if device is None else find_law(device)
    if law is not None and by not in (None, "device"):
        raise InputError(f"--device: found with --by {by}; allowed: --by device")
    if by == "time" and not timed:
        raise InputError("--by time: nothing is timed with --dask; allowed: without it")
    if by == "time" or (by is None and law is None and timed and not info.software):
        return Cost("frame_ms")
    named, law = law is not None or by == "device", law or law_on_record()
    obstacle = "" if by == "work" else _without_law(view, info, law)
    if by != "work" and not obstacle:
        return Cost("predicted_ms", law)
    if named:
        raise InputError(f"--device: {obstacle}")
    if budget_ms is not None:
        why = obstacle or "found with --by work, which has no times"
        raise InputError(f"--budget-ms: {why}; allowed: with --by time, which ranks by this machine's times")
    if not info.pipeline_statistics:
        raise InputError(f"{info.renderer} does not count work; allowed: --by time, which ranks by its times")
    return Cost("work_cost", without_law=obstacle)


def _without_law(view: View, info: DeviceInfo, law: Law | None) -> str:
    """Why no law gives times of what a device draws of a view; empty if one does."""
    if law is None:
        return "no device has times on record"
    if not info.software:
        return "times are predicted from the work that a software renderer counts, not on a GPU"
    if view.light.soft:
        return f"found a light with a size; those of which {law.device} has times have none"
    return "" if info.pipeline_statistics else f"{info.renderer} does not count work, from which times are predicted"


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

    trials: all successful ones, by cost; unsuccessful: status by spec of the others; excluded: specs that were not
    tried, by the survey or on principle; unranked: why specs have no cost, an infinite one in their trials; untried:
    numbers of those not tried by technique and a key of `LEFT_OUT`; space_size: number of specs in the full space;
    needs: of the view, without penumbrae; reference: reference time of costs in milliseconds, None if costs are work,
    or predicted; cost: what ranks; steadiness: how much flicker is allowed, None for a still view; budget_ms: the
    largest cost, if given; among: the techniques that were asked for, empty for all.
    """

    view: View
    target: Target
    cost: Cost
    trials: tuple[Trial, ...]
    unsuccessful: Mapping[str, str]
    excluded: tuple[Exclusion, ...]
    unranked: Mapping[Spec, str]
    untried: Mapping[tuple[str, str], int]
    space_size: int
    needs: Needs
    reference: ReferenceTime | None
    steadiness: Steadiness | None = None
    budget_ms: float | None = None
    among: tuple[str, ...] = ()

    def __repr__(self) -> str:
        """One line: scene, target and choice."""
        choice = "nothing meets it" if self.choice is None else self.choice.spec.text
        measured = f"{self.measured} of {self.space_size} specs measured"
        return f"<Recommendation for {self.view.scene.name}, {self.asked}: {choice}; {measured}>"

    @property
    def asked(self) -> str:
        """Text such as `IoU ≥ 0.99, flicker ≤ 0.01 px in pan within 2 ms`, or `edges at most 0.5 px off`."""
        metric, limit = METRICS[self.target.metric], self.target.limit
        text = f"{metric.label} {'≥' if metric.better == 'higher' else '≤'} {limit:g}"
        if metric.name == "edge_px":
            text = f"edges at most {limit:g} px off"
        if self.steadiness is not None:
            text += f", flicker ≤ {self.steadiness.max_flicker:g} px in {self.steadiness.sequence}"
        return text if self.budget_ms is None else f"{text} within {self.budget_ms:g} ms"

    @property
    def measured(self) -> int:
        """Number of specs that were tried: measured, or found to be unsupported or to fail."""
        return len(self.trials) + len(self.unsuccessful)

    @property
    def limit(self) -> float:
        """The largest error that meets the target."""
        return METRICS[self.target.metric].error(self.target.limit)

    def meets(self, trial: Trial) -> bool:
        """Whether a trial meets the target but for its budget."""
        return trial.miss(self.limit) <= self.limit

    def affords(self, trial: Trial) -> bool:
        """Whether a trial's cost is within the budget."""
        return self.budget_ms is None or trial.cost <= self.budget_ms

    @cached_property
    def met(self) -> list[Trial]:
        """The trials that meet the target but for its budget, by cost."""
        return list(filter(self.meets, self.trials))

    @cached_property
    def choice(self) -> Trial | None:
        """The cheapest trial that meets the target within the budget, None if none does."""
        return self.met[0] if self.met and self.affords(self.met[0]) else None

    @cached_property
    def closest(self) -> Trial | None:
        """Without a choice, the most accurate trial within the budget; of all trials if none is."""
        if self.choice is not None:
            return None
        within = list(filter(self.affords, self.trials)) or self.trials
        return min(within, key=lambda trial: (trial.miss(self.limit), trial.error, *trial.rank), default=None)

    @cached_property
    def runners_up(self) -> tuple[Trial, ...]:
        """Of each technique but the choice's the cheapest trial that meets the target, else the most accurate.

        One with a cost and one without.
        """
        best: dict[tuple[str, bool], Trial] = {}
        for trial in (*self.met, *sorted(self.trials, key=lambda trial: (trial.miss(self.limit), trial.cost))):
            best.setdefault((trial.spec.technique.name, trial.ranked), trial)
        if self.choice is not None:
            best.pop((self.choice.spec.technique.name, self.choice.ranked))
        return tuple(sorted(best.values(), key=lambda trial: (not self.meets(trial), trial.cost)))

    @property
    def cheaper(self) -> Trial | None:
        """The most accurate trial that saves a tenth of the choice's cost or more, and to which a target can relax."""
        most = SAVED * self.choice.cost if self.choice is not None and self.choice.ranked else -math.inf
        steady = [trial for trial in self.trials if trial.flicker <= 1]
        cheaper = [trial for trial in steady if trial.cost < most and math.isfinite(trial.error)]
        return min(cheaper, key=lambda trial: (trial.error, trial.cost), default=None)

    @property
    def better(self) -> Trial | None:
        """The cheapest trial with less than half of the choice's error, and with a cost."""
        least = self.choice.error / 2 if self.choice is not None else -math.inf
        better = [trial for trial in self.trials if trial.error < least and trial.flicker <= 1 and trial.ranked]
        return min(better, key=lambda trial: (trial.cost, trial.error), default=None)

    def standing(self, trial: Trial) -> Standing:
        """What a trial is: its line in the table of `recommend`."""
        if trial is self.choice:
            return "choice"
        if trial is self.closest:
            return "closest"
        if self.meets(trial):
            return "unranked" if not trial.ranked else "next" if self.affords(trial) else "too slow"
        return "so far" if any(name == trial.spec.technique.name for name, _ in self.untried) else "misses"


def recommend(
    view: View,
    target: Target | None,
    known: Techniques,
    campaign: Campaign,
    *,
    by: str | None = None,
    device: str | None = None,
    budget_ms: float | None = None,
    timed: bool = True,
    among: Sequence[str] = (),
    max_flicker: float | None = None,
) -> tuple[Recommendation, DeviceInfo]:
    """The cheapest measured of the `known` techniques that meets a target in a view, and the device.

    Measures into a campaign's folder: rows, masks, pictures, `table.csv`, `run.json`. target: None for the default;
    by, device, budget_ms, timed: as by `cost_of`; among: names of the techniques to search, all if empty; max_flicker:
    the most in the first sequence of the scene's file, else in `pan`, over whose frames the target is a mean then.
    Raises InputError for a folder with other files, a budget or a law where it cannot be, a device without pipeline
    statistics, and names of techniques of which none supports the light.
    """
    if budget_ms is not None and not 0 < budget_ms < math.inf:
        raise InputError(f"--budget-ms: found {budget_ms:g}; allowed: above 0")
    if max_flicker is not None and not 0 <= max_flicker < math.inf:
        raise InputError(f"--max-flicker: found {max_flicker:g}; allowed: 0 and more")
    known = chosen_techniques(known, among, view.light.hard_kind, view.light.soft)
    info = campaign.drawer.info
    cost = cost_of(view, info, by, device, budget_ms, timed)
    campaign.reporter.stage("truth", 1)
    target = target or default_target(view)
    study = Study.of([view.scene], [DEFAULT_REFERENCE], view_size=view.size, rounds=cost.rounds)
    block, steadiness = study.block(view), None
    if max_flicker is not None:
        motion = (*view.scene.motions, BUILT_IN["pan"])[0]
        study, steadiness = study.with_(sequence=motion.name), Steadiness(max_flicker, motion.name)
        block = study.block(*frames_of(view, motion), sequence=motion.name)
    truth = cached_truth(view)
    results: list[Result] = []
    with campaign:
        campaign.reporter.stage("measuring", None)  # the search ends when no spec is left that may be cheaper

        def measure(spec: Spec) -> Result:
            (block_results,) = campaign.measure([replace(block, cells=(Cell(spec),))])
            results.extend(block_results)
            return results[-1]

        advice = find_cheapest(view, truth, target, cost, known, info.max_map_size, measure, steadiness)
        campaign.finish(study.facts, view.scene.notes, [result.score["key"] for result in results])
        if results:
            write_cells(campaign.folder, {})
    return replace(advice, budget_ms=budget_ms, among=tuple(among)), info


def find_cheapest(
    view: View,
    truth: Truth,
    target: Target,
    cost: Cost,
    known: Techniques,
    largest: int,
    measure: Callable[[Spec], Result],
    steadiness: Steadiness | None = None,
) -> Recommendation:
    """Search the specs of `known` techniques with maps up to `largest`. Raises InputError as `needs` does."""
    kind, soft = view.light.hard_kind, view.light.soft
    survey = needs(view, penumbrae=False)  # those rule out no spec
    space = full_space(known, kind, largest, soft, steadiness is not None)
    space_size, limit = len(space), METRICS[target.metric].error(target.limit)
    excluded = [Exclusion(name, why, 0) for name, why in unavailable(known, kind, soft).items()]
    left_out = prune(space, survey, target.limit if target.metric == "iou" else None)
    if steadiness is None and (lit := _nothing_dark(view, truth, target)) is not None:
        excluded, left_out = [Exclusion(f"all but {UNSHADOWED.text}", lit, len(space))], {}
        space, space_size = [UNSHADOWED], space_size + 1
    unranked = {spec: why for spec in space if (why := cost.unranked(spec)) is not None}
    unsuccessful: dict[str, str] = {}

    def search_of(specs: Sequence[Spec], by: Cost) -> Search:
        def try_spec(spec: Spec) -> Trial | None:
            result = measure(spec)
            if (status := by.status(result)) == "ok":
                flicker = result.score["metrics"].get("flicker") or 0.0  # none without an edge, or in a still view
                share = flicker / max(steadiness.max_flicker, TINY) if steadiness else 0.0
                return replace(by.trial(spec, result, target, view), flicker=share)
            unsuccessful[spec.text] = status
            return None

        return Search(
            space=specs,
            limit=limit,
            base=lambda spec: by.base(spec, view),
            start=lambda spec: start_size(spec, survey),
            measure=try_spec,
            margins=UNPREDICTABLE
            if target.metric == "rmse" and soft
            else MARGINS[target.metric if steadiness is None else "edge_px"],
            least=least_error(truth, target.metric),
        )

    ranked = search_of([spec for spec in space if not {spec} & (left_out.keys() | unranked.keys())], cost)
    others = search_of([spec for spec in unranked if spec not in left_out], Cost("work_cost"))
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
    return Recommendation(
        view=view,
        target=target,
        cost=cost,
        trials=tuple(trials),
        unsuccessful=unsuccessful,
        excluded=tuple(excluded),
        unranked={spec: why for spec, why in unranked.items() if spec in tried},
        untried=ranked.untried() + Counter((spec.technique.name, "unranked") for spec in others.unmeasured),
        space_size=space_size,
        needs=survey,
        reference=reference,
        steadiness=steadiness,
    )


def _nothing_dark(view: View, truth: Truth, target: Target) -> str | None:
    """Why drawing no shadow is enough; None if it is not."""
    by_rmse = target.metric == "rmse"
    if (truth.receivers & (truth.visibility < (1.0 if by_rmse else 0.5))).any():
        return None
    return f"nothing that is seen is {'in shadow' if by_rmse or not view.light.soft else 'more than half in shadow'}"
