"""The cheapest spec that meets a target in a view: what is asked, what ranks, the search, and what came of it."""

import math
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from decimal import ROUND_CEILING, ROUND_FLOOR, Context
from functools import cached_property
from typing import Any, Literal, NamedTuple, cast, get_args

import numpy as np

from shadowbench.advice.search import (
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
from shadowbench.measure.campaign import DEFAULT_REFERENCE, Campaign, Cell
from shadowbench.measure.rows import Result
from shadowbench.measure.scoring import prepare_truth
from shadowbench.measure.worker import DeviceInfo
from shadowbench.plugin.spec import Spec
from shadowbench.results.frame import cells_frame, write_cells
from shadowbench.results.law import SHORTEST_MS, Law, counts_of, find_law, kind_of, law_on_record
from shadowbench.results.times import ReferenceTime, normalise_times
from shadowbench.scenes.model import View
from shadowbench.scores.masks import ThresholdedMask
from shadowbench.scores.metrics import METRICS, ranking
from shadowbench.studies.crossing import Techniques
from shadowbench.studies.study import Study
from shadowbench.survey.survey import Needs, needs
from shadowbench.techniques.unshadowed import Unshadowed
from shadowbench.truths.cache import cached_truth
from shadowbench.truths.trace import Truth

Measure = Literal["iou", "edge_px", "rmse"]


class _Measured(NamedTuple):
    """What a target may be of: its option, what that allows, the text of a target, and of a value."""

    option: str
    allows: Callable[[float], bool]
    allowed: str
    target: str
    value: str


_MEASURES: dict[Measure, _Measured] = {
    "iou": _Measured("--min-iou", lambda least: 0 < least <= 1, "above 0, up to 1", "IoU ≥ {:g}", "IoU {}"),
    "edge_px": _Measured(
        "--max-edge-px", lambda most: 0 <= most < math.inf, "0 and more", "edges at most {:g} px off", "edges {} px off"
    ),
    "rmse": _Measured("--max-rmse", lambda most: 0 <= most <= 1, "0 to 1", "RMSE ≤ {:g}", "RMSE {}"),
}


@dataclass(frozen=True)
class Target:
    """Target of a recommendation: minimum of `iou`, maximum of `edge_px` or `rmse`; optionally a budget in ms."""

    metric: Measure
    value: float
    budget_ms: float | None = None

    @property
    def limit(self) -> float:
        """Largest error that meets the target."""
        return METRICS[self.metric].error(self.value)

    def affords(self, cost: float) -> bool:
        """Whether a cost is within the budget."""
        return self.budget_ms is None or cost <= self.budget_ms

    def error(self, metrics: Mapping[str, float | None]) -> float:
        """Error of a row's metrics: 1 − IoU, the edge distance in pixels, or the RMSE.

        IoU is None if neither the truth nor the mask has a shadow; the error is then 0. An edge distance is None if
        neither has an edge; the error is then 0 if their shadows are equal, else infinite.
        """
        value = metrics[self.metric]
        if value is None:
            return 0.0 if metrics["iou"] in (None, 1.0) else math.inf
        return METRICS[self.metric].error(value)

    def text(self, error: float, row: Mapping[str, Any], as_target: bool = False) -> str:
        """Text of an error by the metric: `IoU 0.9712`, `edges 0.21 px off`, `RMSE 0.013`; in words if infinite.

        row: the score row, which has the error of its truth; as_target: rounded to a target that the error meets.
        """
        if math.isinf(error):
            return "no edges to compare, and other shadows"
        metric = METRICS[self.metric]
        value = metric.error(error)  # which is its own inverse
        return _MEASURES[self.metric].value.format(metric.text(value, self.reached if as_target else self.digits, row))

    def digits(self, value: float) -> str:
        """A value of the metric, rounded, but neither across the target nor to an IoU of 1 unless it is that."""
        form = "{:.4g}" if self.metric == "iou" else "{:.3g}"
        return METRICS[self.metric].digits_beside(self.value, form.format)(value)

    def reached(self, value: float) -> str:
        """A value of the metric as another target, which it meets: an IoU rounded down, others up."""
        least, rounding = (4, ROUND_FLOOR) if self.metric == "iou" else (3, ROUND_CEILING)
        for digits in range(least, 17):
            rounded = float(Context(digits, rounding).create_decimal(value))
            if rounded != self.value and (rounded > self.value) == (value > self.value):
                return f"{rounded:.{digits}g}"
        return f"{value:.16g}"

    def __str__(self) -> str:
        text = _MEASURES[self.metric].target.format(self.value)
        return text if self.budget_ms is None else f"{text} within {self.budget_ms:g} ms"


def target_of(
    min_iou: float | None = None,
    max_edge_px: float | None = None,
    budget_ms: float | None = None,
    max_rmse: float | None = None,
    *,
    soft: bool = False,
) -> Target:
    """Target given by options, by default an IoU of 0.99, or for soft shadows an RMSE of 0.02.

    soft: whether the view has penumbrae. Raises InputError for invalid or conflicting options.
    """
    values: dict[Measure, float | None] = {"iou": min_iou, "edge_px": max_edge_px, "rmse": max_rmse}
    given = {name: value for name, value in values.items() if value is not None}
    if len(given) > 1:
        both = " and ".join(_MEASURES[name].option for name in given)
        raise InputError(f"{both}: found {'both' if len(given) == 2 else 'all'}; allowed: one of them")
    if budget_ms is not None and not 0 < budget_ms < math.inf:
        raise InputError(f"--budget-ms: found {budget_ms:g}; allowed: above 0")
    for name, value in given.items():
        if not _MEASURES[name].allows(value):
            raise InputError(f"{_MEASURES[name].option}: found {value:g}; allowed: {_MEASURES[name].allowed}")
        return Target(name, value, budget_ms)
    return Target("rmse" if soft else "iou", ranking(soft).targets[1], budget_ms)


def least_error(truth: Truth, metric: Measure) -> float:
    """Approximate error of a single wrong pixel, of the shadow or of its edge: the smallest error above 0."""
    mask = ThresholdedMask(truth.visibility, truth.receivers & ~truth.undecided)
    if metric == "rmse":
        return 1 / math.sqrt(max(int(np.count_nonzero(mask.valid)), 1))
    return 1 / max(int(np.count_nonzero(mask.shadow if metric == "iou" else mask.edge)), 1)


ROUNDS = 9
Unit = Literal["work", "ms"]
By = Literal["work", "device", "time"]


@dataclass(frozen=True)
class Cost:
    """The cost of a spec; law: by which milliseconds are predicted, None if they are measured.

    without_law: where work ranks, why no law does, empty if work was asked for.
    """

    unit: Unit
    law: Law | None = None
    without_law: str = ""

    @property
    def rounds(self) -> int:
        """Rounds in which a cell is timed."""
        return ROUNDS if self.unit == "ms" and self.law is None else 0

    def base(self, spec: Spec, view: View) -> float:
        """The part of a spec's cost that is known before it is drawn; 0 where times are measured."""
        pixels, reads = view.size**2, reads_of(spec)
        if self.law is not None:
            counts = {
                "reads": pixels * reads,
                "triangles": view.scene.geometry.count,
                "gpu_bytes": _bytes(spec, view),
            }
            return self.law.share(kind_of(spec.sizeless_text), counts)
        return float(pixels * (1 + reads)) if self.unit == "work" else 0.0

    def unranked(self, spec: Spec) -> str | None:
        """Why the cost of a spec is not known; None if it is."""
        if self.law is None:
            return spec.technique.extra_work(spec.params) if self.unit == "work" else None
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
        cost = fixed = float(work.get("vertices", 0) + work.get("geometry", 0))
        if self.law is not None:
            counts = counts_of(row, view.scene.geometry.count)
            kind, vertices = kind_of(spec.sizeless_text), {"frames": 0, "vertices": counts["vertices"]}
            cost, fixed = self.law.share(kind, counts), self.law.share(kind, vertices)
        elif self.unit == "work":
            cost = float(work["cost"])
        else:
            assert result.time is not None
            cost = float(result.time["ratio"])
            fixed = cost * fixed / work["cost"] if "cost" in work else 0.0  # the vertices' share
        error = target.error(row["metrics"])
        return Trial(spec, cost, fixed, int(row["gpu_bytes"]), error, result, float(work.get("cost", 0)))

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


def by_of(name: str | None) -> By | None:
    """What ranks, by name. Raises InputError for another."""
    if name is None or name in get_args(By):
        return cast("By | None", name)
    raise InputError(f"--by: found {name!r:.60}; allowed: {', '.join(get_args(By))}")


def cost_of(
    target: Target, view: View, info: DeviceInfo, by: By | None = None, timed: bool = True, device: str | None = None
) -> Cost:
    """What ranks specs on a device, by default times: of a GPU that draws, else those predicted for another.

    by: what was asked for; timed: whether the device may be; device: its name. Raises InputError for
    options that cannot be met.
    """
    law = None if device is None else find_law(device)
    if law is not None and by not in (None, "device"):
        raise InputError(f"--device: found with --by {by}; allowed: --by device")
    if by == "time" and not timed:
        raise InputError("--by time: nothing is timed with --dask; allowed: without it")
    if by == "time" or (by is None and law is None and timed and not info.software):
        return Cost("ms")
    asked, law = law is not None or by == "device", law or law_on_record()
    obstacle = "" if by == "work" else _without_law(view, info, law)
    if law is not None and by != "work" and not obstacle:
        return Cost("ms", law)
    if asked:
        raise InputError(f"--device: {obstacle}")
    if target.budget_ms is not None:
        why = obstacle or "found with --by work, which has no times"
        raise InputError(f"--budget-ms: {why}; allowed: with --by time, which ranks by this machine's times")
    if not info.pipeline_statistics:
        raise InputError(f"{info.renderer} does not count work; allowed: --by time, which ranks by its times")
    return Cost("work", without_law=obstacle)


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

    choice: the cheapest trial that meets the target, None if none does; trials: all successful ones, by cost;
    unsuccessful: status by spec of the others; excluded: specs that were not tried, by the survey or on principle;
    unranked: why specs have no cost, an infinite one in their trials; untried: numbers of those not tried by technique
    and a key of `LEFT_OUT`; space_size: number of specs in the full space; needs: of the view, without penumbrae;
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
    untried: Mapping[tuple[str, str], int]
    space_size: int
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
        return "so far" if any(name == trial.spec.technique.name for name, _ in self.untried) else "misses"


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
    excluded = [Exclusion(name, why, 0) for name, why in unavailable(known, kind, soft).items()]
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
    untried = ranked.untried() + Counter((spec.technique.name, "unranked") for spec in others.unmeasured)
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
