"""Search for the cheapest spec that meets a target, with few measurements.

Specs that differ only in map size, filter and depth format form a group. The cost of a spec has a part per pixel and a
part per texel, so one or two sizes of a group predict the others; its error is roughly inverse to its map size. Among
the specs that may be cheaper than the best so far and may meet the target, the cheapest one expected to meet it is
measured next, until none is left. Then each technique of which a spec meets the target is searched for a cheaper one of
its own.
"""

import itertools
import math
import statistics
from collections import Counter, defaultdict
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from typing import Any

from shadowbench.errors import InputError
from shadowbench.maps.filters import Filter
from shadowbench.measure.rows import Result
from shadowbench.plugin.base import Subject
from shadowbench.plugin.spec import Spec, format_value, parse_spec
from shadowbench.scenes.model import LightKind
from shadowbench.studies.crossing import Techniques
from shadowbench.survey.survey import Needs

SIZES = (256, 512, 1024, 2048, 4096)


@dataclass(frozen=True)
class Exclusion:
    """A part of the space that is not tried, the reason, and its number of specs."""

    what: str
    why: str
    specs: int


def grid_of(technique: type[Subject], soft: bool = False) -> dict[str, Sequence[Any]]:
    """Grid of parameter values of a technique, including map sizes. soft: for lights with a size."""
    grid = {**technique.catalogue.grid, **(technique.catalogue.soft_grid if soft else {})}
    if "size" in technique.Params.model_fields:
        grid.setdefault("size", SIZES)
    return grid


def specs_of(technique: type[Subject], largest: int, soft: bool = False, moving: bool = False) -> list[Spec]:
    """All specs of a technique's grid with maps up to `largest`. moving: also those that are steady."""
    grid = grid_of(technique, soft)
    if "size" in grid:
        grid["size"] = [size for size in grid["size"] if size <= largest] or [largest]
    home, steady = Spec(technique, technique.Params()), technique.catalogue.steady
    choices = [dict(zip(grid, values, strict=True)) for values in itertools.product(*grid.values())]
    choices += [chosen | dict(steady) for chosen in choices] if moving and steady else []
    return [home.with_(**chosen) if chosen else home for chosen in choices]


def full_space(
    known: Techniques, light: LightKind, largest: int, soft: bool = False, moving: bool = False
) -> list[Spec]:
    """All specs that support a kind of light, with or without a size, as an exhaustive search would measure them."""
    refused = unavailable(known, light, soft)
    answering = [technique for name, technique in known.items() if name not in refused]
    return [spec for technique in answering for spec in specs_of(technique, largest, soft, moving)]


def technique_names(texts: Sequence[str], known: Techniques) -> tuple[str, ...]:
    """Names of techniques, each once. Raises InputError for other texts, such as specs with parameters."""
    for text in texts:
        if ":" in text:
            raise InputError(
                f"technique {text!r:.60}: found parameters, which the search chooses; allowed: a name alone"
            )
    return tuple(dict.fromkeys(parse_spec(text, known).technique.name for text in texts))


def chosen_techniques(known: Techniques, names: Sequence[str], light: LightKind, soft: bool = False) -> Techniques:
    """The named techniques, all of them if none is named. Raises InputError if no named one can be searched."""
    refused = unavailable(known, light, soft)
    if names and refused.keys() >= set(names):
        whys = "; ".join(f"{name} {refused[name]}" for name in names)
        able = ", ".join(name for name in known if name not in refused)
        raise InputError(f"nothing to search: {whys}; allowed: {able}")
    return {name: known[name] for name in names} or known


def unavailable(known: Techniques, light: LightKind, soft: bool = False) -> dict[str, str]:
    """Why techniques are never in the space for this light, by name."""
    whys = {}
    for name, technique in known.items():
        if technique.catalogue.never_recommended:
            whys[name] = technique.catalogue.never_recommended
        elif light not in technique.lights:
            whys[name] = f"supports {' and '.join(sorted(technique.lights))} light, not {light}"
        elif technique.catalogue.soft_only and not soft:
            whys[name] = "is for lights with a size"
    return whys


def prune(space: Sequence[Spec], needs: Needs, least_iou: float | None) -> dict[Spec, tuple[str, str]]:
    """The specs of a space that the needs of a view leave out, with what and why as in `Exclusion`.

    Left out are the depth format that is not needed, and planar techniques if no plane is visible, or if an upper bound
    of their IoU misses the target: shadows on curved receivers stay lit; the bound assumes that as much as possible of
    the lit surface is curved, and the reason says what is seen. least_iou: target IoU, None for another target.
    """
    bits, unwanted = needs.bits.bits if needs.bits else None, "d16"
    if bits == 16:
        unwanted, format_why = "d32f", "by `needs` 16 bits separate casters from receivers, at half the bytes"
    elif bits:
        format_why = f"by `needs` {bits} bits are needed to separate casters from receivers"
    else:
        format_why = "no format is known to separate casters from receivers, so that the widest is taken"
    seen, planar_why = needs.receivers, ""
    most = 1 - max(seen.shadowed - seen.planar, 0.0) / seen.shadowed if seen.shadowed > 0 else 1.0
    if seen.planes == 0:
        planar_why = "no receiver that is seen is a plane"
    elif least_iou is not None and most < least_iou:
        planar_why = (
            f"by `needs` it would leave {seen.lost:.1%} of the shadow lit: its IoU is at most about {1 - seen.lost:.3g}"
        )
    reasons = {}
    for spec in space:
        if getattr(spec.params, "depth", None) == unwanted:
            reasons[spec] = f"depth={unwanted}", format_why
        elif planar_why and spec.technique.catalogue.only_planes:
            reasons[spec] = spec.technique.name, planar_why
    return reasons


def start_size(spec: Spec, needs: Needs) -> float:
    """Predicted map size for a technique: one texel per pixel, at shadow edges if there are any."""
    texels, several, slices = needs.texels, needs.cascades, spec.technique.view_slices(spec.params)
    if slices > 1 and several is not None:
        return several.edge_size.get(slices, several.edge_size[several.best])
    return texels.edge_size or texels.size


SLOPE = 1.0  # default of −d log(error) / d log(size): an edge is off by a fraction of a texel
SLOPES = (0.4, 1.6)  # range to which measured slopes are clamped
# Default of d log(cost) / d log(size), for larger and for smaller maps: each triangle costs at least a block of texels.
GROWTH = (1.2, 2.0)
FIRST = "hardware"  # filter of a group's first trial
TINY = 1e-6  # smallest error used in predictions
LEFT_OUT = {
    "dearer": "predicted to cost at least as much as {}",
    "inaccurate": "predicted to miss the target",
    "beyond": "with the map of one that failed, or a larger one",
    "unranked": "without a cost",
}
"""Why a search measures no spec, by a key; {}: the choice."""


@dataclass(frozen=True, eq=False)
class Trial:
    """A measured spec: its rows, its error by the target, and its cost in work or milliseconds.

    cost: infinite if it is not known; fixed: cost of vertices, which does not depend on the map size; flicker: as a
    share of the most that is allowed.
    """

    spec: Spec
    result: Result
    error: float
    cost: float
    fixed: float
    flicker: float = 0.0

    def miss(self, limit: float) -> float:
        """Its error, but above a limit of that in proportion to flicker that is too large."""
        return self.error if self.flicker <= 1 else max(self.error, self.flicker * max(limit, TINY))

    @property
    def ranked(self) -> bool:
        """Whether its cost is known."""
        return math.isfinite(self.cost)

    @property
    def rank(self) -> tuple[float, float, int, float]:
        """The lower, the better among trials that meet a target: at equal cost less work, then fewer bytes."""
        row = self.result.score
        return self.cost, float(row["work"].get("cost", 0)), int(row["gpu_bytes"]), self.error


def cheapest(trials: Iterable[Trial], limit: float) -> Trial | None:
    """The cheapest trial with an error of at most `limit`, and with no more flicker than allowed."""
    return min((trial for trial in trials if trial.miss(limit) <= limit), key=lambda trial: trial.rank, default=None)


def reads_of(spec: Spec) -> int:
    """Texels that the filter and the contact shadows of a spec read per pixel, 0 without them."""
    chosen, contact = getattr(spec.params, "filter", None), getattr(spec.params, "contact", None)
    return (chosen.reads if isinstance(chosen, Filter) else 0) + (contact.reads if contact else 0)


@cache
def group_of(spec: Spec) -> tuple[str, str]:
    """The group of a spec, which is its text without size, filter and depth format, and its filter."""
    known = type(spec.params).model_fields
    bare = {name: known[name].default for name in ("size", "filter", "depth") if name in known}
    chosen = getattr(spec.params, "filter", None)
    return spec.with_(**bare).text if bare else spec.text, format_value(chosen) if chosen is not None else ""


@dataclass
class Search:
    """Measures specs of `space` until the cheapest with an error of at most `limit` is known, if there is one.

    base: the part of a spec's cost that is known before it is drawn, 0 if none is, which prunes less; start: map size
    predicted for a spec, used for a group's first trial; measure: returns None if the spec failed; margins: factors by
    which an error may be below its prediction from another size, and from another filter; least: smallest possible
    error above 0.
    """

    space: Sequence[Spec]
    limit: float
    base: Callable[[Spec], float]
    start: Callable[[Spec], float]
    measure: Callable[[Spec], Trial | None]
    margins: tuple[float, float]
    least: float = TINY
    trials: list[Trial] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.base = cache(self.base)
        self._left = dict.fromkeys(self.space)
        self._beyond: list[Spec] = []
        self._within = max(self.limit, self.least)
        # By group: the cost of a map's texels and of vertices by size, and errors by filter and size.
        self._costs: defaultdict[str, dict[int, tuple[float, float]]] = defaultdict(dict)
        self._errors: defaultdict[str, dict[str, dict[int, float]]] = defaultdict(dict)
        self._ratios: dict[tuple[str, str], tuple[float, float]] = {}

    def run(self) -> Trial | None:
        """Search, and return the cheapest spec measured that meets the target; None if none does."""
        self.run_first()
        while (following := self._next() or self._next_of_others()) is not None:
            self._measure(following)
        return self.best

    def run_first(self) -> None:
        """Measure what has no map, and one spec of each group of maps, those first that may cost least.

        Of a group at the size closest to the predicted one that may still be cheap enough.
        """
        begun = set()
        for spec in sorted(self._left, key=self.base):
            group, _ = group_of(spec)
            if not spec.map_size:
                if self.cost(spec) < self.cost_limit:
                    self._measure(spec)
            elif group not in begun:
                begun.add(group)
                mine = [one for one in self._left if group_of(one)[0] == group]
                first = [one for one in mine if group_of(one)[1] == FIRST] or mine
                able = [one for one in first if self.cost(one) < self.cost_limit]
                if able:
                    self._measure(min(able, key=lambda one: abs(math.log((one.map_size or 1) / self.start(one)))))

    def run_spare(self, left_out: Iterable[Spec]) -> None:
        """Measure what was left out, the cheapest first, while it is predicted to meet the target for less."""
        spare = dict.fromkeys(left_out)
        while (limit := self.cost_limit) < math.inf:
            able = (spec for spec in spare if self._expected(spec) <= self._within)
            following = min(able, key=self.cost, default=None)
            if following is None or self.cost(following) >= limit:
                return
            del spare[following]
            self._measure(following)

    def run_rest(self, left_out: Iterable[Spec] = ()) -> Trial | None:
        """Measure what is left and what was left out, the cheapest predicted first, until one meets the target."""
        self._left |= dict.fromkeys(left_out)
        while self._left and self.best is None:
            self._measure(min(self._left, key=self.cost))
        return self.best

    @property
    def unmeasured(self) -> list[Spec]:
        """Specs that were not measured."""
        return [*self._left, *self._beyond]

    def untried(self) -> Counter[tuple[str, str]]:
        """Numbers of specs that were not measured, by technique and by a key of `LEFT_OUT`."""
        whys = Counter((spec.technique.name, "beyond") for spec in self._beyond)
        for spec in self._left:
            whys[spec.technique.name, "dearer" if self.cost(spec) >= self.cost_limit else "inaccurate"] += 1
        return whys

    @property
    def best(self) -> Trial | None:
        """The cheapest trial so far that meets the target."""
        return cheapest(self.trials, self.limit)

    @property
    def cost_limit(self) -> float:
        """Cost of the best trial so far, below which others are of interest."""
        return self.best.cost if self.best else math.inf

    def _measure(self, spec: Spec) -> None:
        """Measure a spec; where it fails, the larger maps of its group would fail too."""
        self._left.pop(spec, None)
        (group, filter), size, trial = group_of(spec), spec.map_size, self.measure(spec)
        if trial is not None:
            self.trials.append(trial)
            if size:
                self._costs[group][size] = max(trial.cost - trial.fixed - self.base(spec), TINY), trial.fixed
                self._errors[group].setdefault(filter, {})[size] = trial.miss(self._within)
                self._ratios.clear()
        elif size:
            beyond = [one for one in self._left if group_of(one)[0] == group and (one.map_size or 0) >= size]
            self._beyond += beyond
            self._left = {one: None for one in self._left if one not in beyond}

    def _next(self) -> Spec | None:
        """The cheapest spec expected to meet the target, else the one expected to come closest; None if none may."""
        limit = self.cost_limit
        paying = [(spec, cost) for spec in self._left if (cost := self.cost(spec)) < limit]
        judged = [(spec, cost, *self.error(spec)) for spec, cost in paying]
        alive = [(spec, cost, error) for spec, cost, error, margin in judged if error / margin <= self._within]
        expected = [candidate for candidate in alive if candidate[2] <= self._within]
        if expected:
            return min(expected, key=lambda candidate: (candidate[1], candidate[2]))[0]
        return min(alive, key=lambda candidate: (candidate[2], candidate[1]))[0] if alive else None

    def _next_of_others(self) -> Spec | None:
        """The cheapest spec expected to meet the target for less than its own technique's cheapest so far, if any."""
        names = {spec.technique.name for spec in self._left}
        own = {name: [one for one in self.trials if one.spec.technique.name == name] for name in names}
        best = {name: cheapest(trials, self.limit) for name, trials in own.items()}
        paying = [
            (cost, error, spec)
            for spec in self._left
            if (mine := best[spec.technique.name]) is not None
            and (cost := self.cost(spec)) < mine.cost
            and (error := self._expected(spec)) <= self._within
        ]
        return min(paying, key=lambda candidate: candidate[:2])[2] if paying else None

    def cost(self, spec: Spec) -> float:
        """Predicted cost of a spec; a lower bound before anything of its group was measured."""
        size, known = spec.map_size, self._costs.get(group_of(spec)[0])
        if not size or not known:
            return self.base(spec)
        near, *others = _nearest(known, size)
        texels, fixed = known[near]
        growth = GROWTH[size < near]
        if others:
            measured = math.log(known[others[0]][0] / texels) / math.log(others[0] / near)
            growth = min(max(measured, 0.0), GROWTH[1])
        grown: float = texels * (size / near) ** growth
        return self.base(spec) + fixed + grown

    def error(self, spec: Spec) -> tuple[float, float]:
        """Predicted error of a spec, and the factor by which it may be smaller; 0 if nothing is known."""
        predictions = self._predictions(spec)
        by_others = min(predictions.values(), key=lambda one: one[0] / one[1], default=(0.0, 1.0))
        return predictions.get(group_of(spec)[1], by_others)

    def _expected(self, spec: Spec) -> float:
        """Predicted error by any filter, the most favourable: a neighbour in size says more than the same far away."""
        return min((error for error, _ in self._predictions(spec).values()), default=math.inf)

    def _predictions(self, spec: Spec) -> dict[str, tuple[float, float]]:
        """Predictions of a spec's error by each filter measured in its group, with their margins."""
        group, filter = group_of(spec)
        return {
            other: (ratio * extrapolate(line, spec.map_size or 1), margin)
            for other, line in self._errors.get(group, {}).items()
            for ratio, margin in [self._ratio(filter, other)]
        }

    def _ratio(self, filter: str, other: str) -> tuple[float, float]:
        """Mean ratio of two filters' errors at equal map sizes of all groups, and the margin of a prediction by it."""
        if (filter, other) not in self._ratios:
            both = [(_finite(own.get(filter, {})), _finite(own.get(other, {}))) for own in self._errors.values()]
            ratios = [max(a[size], TINY) / max(b[size], TINY) for a, b in both for size in a.keys() & b.keys()]
            ratio = statistics.geometric_mean(ratios) if ratios and other != filter else 1.0
            self._ratios[filter, other] = ratio, self.margins[not ratios and other != filter]
        return self._ratios[filter, other]


def extrapolate(errors: Mapping[int, float], size: int) -> float:
    """Error at a map size, extrapolated from errors at other sizes by a log-log line through the two nearest.

    Infinite errors are ignored. If all are infinite, the error is infinite up to the largest size, and 0 (unknown)
    beyond it.
    """
    finite = _finite(errors)
    if not finite:
        return math.inf if size <= max(errors) else 0.0
    near = _nearest(finite, size)
    first = math.log(max(finite[near[0]], TINY))
    slope = SLOPE
    if len(near) == 2:
        rise = math.log(max(finite[near[1]], TINY)) - first
        slope = min(max(-rise / math.log(near[1] / near[0]), SLOPES[0]), SLOPES[1])
    return math.exp(first - slope * math.log(size / near[0]))


def _finite(errors: Mapping[int, float]) -> dict[int, float]:
    return {size: error for size, error in errors.items() if math.isfinite(error)}


def _nearest(sizes: Iterable[int], size: int) -> list[int]:
    """The two sizes nearest to a size on a log scale, or the only one."""
    return sorted(sizes, key=lambda other: abs(math.log(other / size)))[:2]
