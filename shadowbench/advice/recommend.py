"""`recommend`: the cheapest spec that meets a target in one view, measured as it is searched for."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from shadowbench.advice.search import Search, Tried
from shadowbench.advice.space import Excluded, needed_space, no_choices, start_size, whole_space
from shadowbench.measure.rows import Result
from shadowbench.scenes.model import View
from shadowbench.scores.thresholded import ThresholdedMask
from shadowbench.studies.tables import cells_frame
from shadowbench.studies.times import ReferenceTime, normalise_times
from shadowbench.survey.survey import Needs, needs
from shadowbench.techniques.base import Technique
from shadowbench.techniques.spec import Spec
from shadowbench.techniques.unshadowed import Unshadowed
from shadowbench.truths.trace import Truth

Unit = Literal["work", "ms"]
# How far below the predicted an error may be, of the same filter and of another: found on rows of all built-in scenes.
# Single specks move the mean of distances, so that it falls less evenly with the size of a map.
MARGINS = {"iou": (1.8, 2.0), "edge_px": (3.5, 3.5)}
SAVED = 0.9  # times the choice's cost, at most, of what is worth relaxing a target for


@dataclass(frozen=True)
class Target:
    """What a recommendation must reach: `iou` at least, or `edge_px` at most; and milliseconds at most, or None."""

    metric: Literal["iou", "edge_px"]
    value: float
    budget_ms: float | None = None

    @property
    def limit(self) -> float:
        """The largest error that meets it."""
        return 1 - self.value if self.metric == "iou" else self.value

    def error(self, metrics: Mapping[str, float | None]) -> float:
        """How far from the truth a row is, 0 at best.

        IoU is null where there is no shadow and none is drawn. A distance of edges is null where neither mask has an
        edge, even if one is dark all over and the other lit: infinite, then, unless their shadows are the same.
        """
        value = metrics[self.metric]
        if value is None:
            return 0.0 if metrics["iou"] in (None, 1.0) else math.inf
        return 1 - value if self.metric == "iou" else value

    def text(self, error: float) -> str:
        """An error in the target's own terms: `IoU 0.9712`, `edges 0.21 px off`; an infinite one in words."""
        if math.isinf(error):
            return "no edges to compare, and other shadows"
        return f"IoU {1 - error:.4f}" if self.metric == "iou" else f"edges {error:.3g} px off"

    def __str__(self) -> str:
        what = f"IoU ≥ {self.value:g}" if self.metric == "iou" else f"edges at most {self.value:g} px off"
        return what if self.budget_ms is None else f"{what} within {self.budget_ms:g} ms"


@dataclass(frozen=True, eq=False)
class Recommendation:
    """What was found. choice: None where nothing meets the target; closest is then what comes nearest to it.

    runners_up: of each technique that was tried, but the choice's own best row, the next; tried: all that held;
    refused: specs that did not, by reason; measured: how many; whole: specs of the whole space; cheaper, better: the
    next on either side of the choice among what was tried, None at the ends; reference: what milliseconds are shown by,
    None where costs are work.
    """

    view: View
    target: Target
    unit: Unit
    choice: Tried | None
    closest: Tried | None
    runners_up: tuple[Tried, ...]
    tried: tuple[Tried, ...]
    refused: Mapping[str, str]
    excluded: tuple[Excluded, ...]
    whole: int
    cheaper: Tried | None
    better: Tried | None
    needs: Needs
    reference: ReferenceTime | None

    @property
    def measured(self) -> int:
        """How many specs were measured."""
        return len(self.tried) + len(self.refused)


def recommend(
    view: View,
    truth: Truth,
    target: Target,
    unit: Unit,
    known: Mapping[str, type[Technique]],
    largest: int,
    measure: Callable[[Spec], Result],
) -> Recommendation:
    """Search the space of `known` techniques with maps up to `largest`; raises InputError as `needs` does."""
    found = needs(view)
    whole = whole_space(known, view.light.kind, largest)
    least_iou = target.value if target.metric == "iou" else None
    left, excluded = needed_space(whole, found, least_iou, unit == "work")
    out = [*no_choices(known, view.light.kind), *excluded]
    if not (truth.receivers & (truth.visibility < 0.5)).any():
        left = [Spec(Unshadowed, Unshadowed.Params())]
        out = [Excluded(f"all but {Unshadowed.name}", "nothing that is seen is in shadow", len(whole))]
    refused: dict[str, str] = {}

    def tried(spec: Spec) -> Tried | None:
        result = measure(spec)
        status = result.status
        if status == "ok" and unit == "ms" and _ratio(result) is None:
            status = f"failed: no ratio to the reference: {result.time and result.time['no_ratio']}"
        if status != "ok":
            refused[spec.text] = status
            return None
        return tried_of(spec, result, target, unit)

    search = Search(
        space=left,
        limit=target.limit,
        pixels=view.size**2,
        start=lambda spec: start_size(spec, found),
        measure=tried,
        margins=MARGINS[target.metric],
        price=1.0 if unit == "work" else 0.0,
        least=least_error(truth, target.metric),
    )
    best, tried_all, reference = search.run(), search.tried, None
    if unit == "ms" and search.tried:
        tried_all, reference = in_milliseconds(search.tried)
        best = tried_all[search.tried.index(best)] if best else None
    if best is not None and target.budget_ms is not None and best.cost > target.budget_ms:
        best = None
    return Recommendation(
        view=view,
        target=target,
        unit=unit,
        choice=best,
        closest=None if best else closest(tried_all, target),
        runners_up=runners_up(tried_all, best, target),
        tried=tuple(sorted(tried_all, key=lambda one: (one.cost, one.bytes, one.error))),
        refused=refused,
        excluded=tuple(out),
        whole=len(whole),
        cheaper=_cheaper(tried_all, best),
        better=_better(tried_all, best),
        needs=found,
        reference=reference,
    )


def least_error(truth: Truth, metric: Literal["iou", "edge_px"]) -> float:
    """About the error of one wrong pixel: errors come in whole ones, of the shadow or of its edge."""
    mask = ThresholdedMask(truth.visibility, truth.receivers & ~truth.undecided)
    return 1 / max(int(np.count_nonzero(mask.shadow if metric == "iou" else mask.edge)), 1)


def tried_of(spec: Spec, result: Result, target: Target, unit: Unit) -> Tried:
    """A row as the search sees it, by its work, or where `unit` is ms by its ratio to the reference.

    What vertices cost is then their share of the work.
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
    return Tried(spec, cost, fixed, int(row["gpu_bytes"]), target.error(row["metrics"]), result)


def in_milliseconds(tried: Sequence[Tried]) -> tuple[list[Tried], ReferenceTime]:
    """What costs ratios to the reference, each measured in a block of its own, by one time of that reference."""
    _, reference = normalise_times(cells_frame([one.result for one in tried if one.result is not None]))
    assert reference is not None
    return [replace(one, cost=one.cost * reference.ms, fixed=one.fixed * reference.ms) for one in tried], reference


def _ratio(result: Result) -> float | None:
    ratio = None if result.time is None else result.time["ratio"]
    return None if ratio is None else float(ratio)


def closest(tried: Sequence[Tried], target: Target) -> Tried | None:
    """The most accurate, of those within the budget where any is."""
    within = [one for one in tried if target.budget_ms is None or one.cost <= target.budget_ms]
    return min(within or tried, key=lambda one: (one.error, one.cost, one.bytes), default=None)


def runners_up(tried: Sequence[Tried], best: Tried | None, target: Target) -> tuple[Tried, ...]:
    """Of each technique the cheapest other row that meets the target, else the one that comes closest to it."""
    found = []
    for name in dict.fromkeys(one.spec.technique.name for one in tried):
        mine = [one for one in tried if one.spec.technique.name == name and one is not best]
        met = [one for one in mine if one.error <= target.limit]
        if met:
            found.append(min(met, key=lambda one: (one.cost, one.bytes, one.error)))
        elif mine:
            found.append(min(mine, key=lambda one: (one.error, one.cost)))
    return tuple(sorted(found, key=lambda one: (one.error > target.limit, one.cost)))


def _cheaper(tried: Sequence[Tried], best: Tried | None) -> Tried | None:
    """The most accurate of what saves a tenth of the choice's cost or more."""
    cheaper = [one for one in tried if best is not None and one.cost <= SAVED * best.cost]
    less = [one for one in cheaper if math.isfinite(one.error)]  # no target relaxes to an infinite one
    return min(less, key=lambda one: (one.error, one.cost), default=None)


def _better(tried: Sequence[Tried], best: Tried | None) -> Tried | None:
    """The cheapest of what is more accurate than the choice by half of its error or more."""
    more = [one for one in tried if best is not None and one.error < best.error / 2]
    return min(more, key=lambda one: (one.cost, one.error), default=None)
