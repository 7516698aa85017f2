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
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
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

Rule = Callable[[Spec], tuple[str, str] | None]  # what is excluded and why


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


def specs_of(technique: type[Subject], largest: int, soft: bool = False) -> list[Spec]:
    """All specs of a technique's grid with maps up to `largest`."""
    grid = grid_of(technique, soft)
    if "size" in grid:
        grid["size"] = [size for size in grid["size"] if size <= largest] or [largest]
    home = Spec(technique, technique.Params())
    choices = [dict(zip(grid, values, strict=True)) for values in itertools.product(*grid.values())]
    return [home.with_(**chosen) if chosen else home for chosen in choices]


def full_space(known: Techniques, light: LightKind, largest: int, soft: bool = False) -> list[Spec]:
    """All specs that support a kind of light, with or without a size, as an exhaustive search would measure them."""
    refused = unavailable(known, light, soft)
    answering = [technique for name, technique in known.items() if name not in refused]
    return [spec for technique in answering for spec in specs_of(technique, largest, soft)]


def technique_names(texts: Sequence[str], known: Techniques) -> tuple[str, ...]:
    """Names of techniques, each once. Raises InputError for other texts, such as specs with parameters."""
    names = [parse_spec(text, known).technique.name for text in texts]
    for text in texts:
        if ":" in text:
            raise InputError(
                f"technique {text!r:.60}: found parameters, which the search chooses; allowed: a name alone"
            )
    return tuple(dict.fromkeys(names))


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

    least_iou: target IoU, None for another target.
    """
    rules = _depth_rule(needs), _planar_rule(needs, least_iou)
    reasons = {spec: next(filter(None, (rule(spec) for rule in rules)), None) for spec in space}
    return {spec: reason for spec, reason in reasons.items() if reason is not None}


def _depth_rule(needs: Needs) -> Rule:
    bits, unwanted = needs.bits.bits if needs.bits else None, "d16"
    if bits == 16:
        unwanted, why = "d32f", "by `needs` 16 bits separate casters from receivers, at half the bytes"
    elif bits:
        why = f"by `needs` {bits} bits are needed to separate casters from receivers"
    else:
        why = "no format is known to separate casters from receivers, so that the widest is taken"
    return lambda spec: (f"depth={unwanted}", why) if getattr(spec.params, "depth", None) == unwanted else None


def _planar_rule(needs: Needs, least_iou: float | None) -> Rule:
    """Excludes planar techniques if no plane is visible, or if an upper bound of their IoU misses the target.

    Shadows on curved receivers stay lit; the bound assumes that as much as possible of the lit surface is curved, and
    the reason says what is seen.
    """
    seen = needs.receivers
    curved, shadow = 1 - seen.planar, seen.shadowed
    most = 1 - max(curved + shadow - 1, 0.0) / shadow if shadow > 0 else 1.0
    why = None
    if seen.planes == 0:
        why = "no receiver that is seen is a plane"
    elif least_iou is not None and most < least_iou:
        why = (
            f"by `needs` it would leave {seen.lost:.1%} of the shadow lit: its IoU is at most about {1 - seen.lost:.3g}"
        )
    return lambda spec: (spec.technique.name, why) if why is not None and spec.technique.catalogue.only_planes else None


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
    """A measured spec: its cost in work or milliseconds, GPU bytes, error and rows.

    cost: infinite if it is not known; tie: the lower, the better at equal cost; fixed: cost of vertices, which does not
    depend on the map size.
    """

    spec: Spec
    cost: float
    fixed: float
    bytes: int
    error: float
    result: Result
    tie: float = 0.0

    @property
    def ranked(self) -> bool:
        """Whether its cost is known."""
        return math.isfinite(self.cost)

    @property
    def rank(self) -> tuple[float, float, int, float]:
        """The lower, the better among trials that meet a target."""
        return self.cost, self.tie, self.bytes, self.error


@dataclass(frozen=True)
class SearchPoint:
    """Position of a spec in the search space.

    group: the spec without size, filter and depth format; size: None without a map; base: the part of its cost that is
    known before it is drawn.
    """

    group: str
    filter: str
    size: int | None
    base: float


def reads_of(spec: Spec) -> int:
    """Texels that the filter of a spec reads per pixel, 0 without one."""
    chosen = getattr(spec.params, "filter", None)
    return chosen.reads if isinstance(chosen, Filter) else 0


def point_of(spec: Spec, base: float = 0.0) -> SearchPoint:
    """Position of a spec in the search space."""
    known = type(spec.params).model_fields
    bare = {name: known[name].default for name in ("size", "filter", "depth") if name in known}
    chosen = getattr(spec.params, "filter", None)
    return SearchPoint(
        group=spec.with_(**bare).text if bare else spec.text,
        filter=format_value(chosen) if chosen is not None else "",
        size=spec.map_size,
        base=base,
    )


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
        self._left = {spec: point_of(spec, self.base(spec)) for spec in self.space}
        self._beyond: list[Spec] = []
        self._begun: set[str] = set()
        self._within = max(self.limit, self.least)
        # By group: the cost of a map's texels and of vertices by size, and errors by filter and size.
        self._costs: defaultdict[str, dict[int, tuple[float, float]]] = defaultdict(dict)
        self._errors: defaultdict[str, dict[str, dict[int, float]]] = defaultdict(dict)

    def run(self) -> Trial | None:
        """Search, and return the cheapest spec measured that meets the target; None if none does."""
        self.run_first()
        while (following := self._next() or self._next_of_others()) is not None:
            self._measure(following)
        return self.best

    def run_first(self) -> None:
        """Measure what has no map, and one spec of each group of maps, those first that may cost least."""
        for spec, point in sorted(self._left.items(), key=lambda item: item[1].base):
            if point.size is None and self.cost(point) < self.cost_limit:
                self._measure(spec)
            elif point.size is not None and point.group not in self._begun:
                self._begun.add(point.group)
                self._try_first(point.group)

    def run_spare(self, left_out: Iterable[Spec]) -> None:
        """Measure what was left out, the cheapest first, while it is predicted to meet the target for less."""
        spare = {spec: point_of(spec, self.base(spec)) for spec in left_out}
        while (limit := self.cost_limit) < math.inf:
            costs = {spec: self.cost(point) for spec, point in spare.items() if self._expected(point) <= self._within}
            cheapest = min(costs, key=lambda spec: costs[spec], default=None)
            if cheapest is None or costs[cheapest] >= limit:
                return
            self._left[cheapest] = spare.pop(cheapest)
            self._measure(cheapest)

    def run_rest(self, left_out: Iterable[Spec] = ()) -> Trial | None:
        """Measure what is left and what was left out, the cheapest predicted first, until one meets the target."""
        self._left |= {spec: point_of(spec, self.base(spec)) for spec in left_out}
        while self._left and self.best is None:
            self._measure(min(self._left, key=lambda spec: self.cost(self._left[spec])))
        return self.best

    @property
    def unmeasured(self) -> list[Spec]:
        """Specs that were not measured."""
        return [*self._left, *self._beyond]

    def untried(self) -> Counter[tuple[str, str]]:
        """Numbers of specs that were not measured, by technique and by a key of `LEFT_OUT`."""
        whys = Counter((spec.technique.name, "beyond") for spec in self._beyond)
        for spec, point in self._left.items():
            whys[spec.technique.name, "dearer" if self.cost(point) >= self.cost_limit else "inaccurate"] += 1
        return whys

    @property
    def best(self) -> Trial | None:
        """The cheapest trial so far that meets the target; of equal ones, that with fewer bytes."""
        return self._cheapest(self.trials)

    def _cheapest(self, trials: Iterable[Trial]) -> Trial | None:
        met = [trial for trial in trials if trial.error <= self.limit]
        return min(met, key=lambda trial: trial.rank, default=None)

    @property
    def cost_limit(self) -> float:
        """Cost of the best trial so far, below which others are of interest."""
        return self.best.cost if self.best else math.inf

    def _measure(self, spec: Spec) -> None:
        point = self._left.pop(spec)
        trial = self.measure(spec)
        if trial is None:
            self._leave_out_beyond(point)
            return
        self.trials.append(trial)
        if point.size is not None:
            texels = trial.cost - trial.fixed - point.base
            self._costs[point.group][point.size] = max(texels, TINY), trial.fixed
            self._errors[point.group].setdefault(point.filter, {})[point.size] = trial.error

    def _leave_out_beyond(self, failed: SearchPoint) -> None:
        """Larger maps of a group would fail too."""
        if failed.size is not None:
            same = [(spec, point) for spec, point in self._left.items() if point.group == failed.group]
            beyond = [spec for spec, point in same if point.size is not None and point.size >= failed.size]
            self._beyond += beyond
            self._left = {spec: point for spec, point in self._left.items() if spec not in beyond}

    def _try_first(self, group: str) -> None:
        """First trial of a group, at the size closest to the predicted one that may still be cheap enough."""
        mine = {spec: point for spec, point in self._left.items() if point.group == group}
        first = {spec: point for spec, point in mine.items() if point.filter == FIRST} or mine
        sizes = {spec: point.size for spec, point in first.items() if point.size and self.cost(point) < self.cost_limit}
        if sizes:
            self._measure(min(sizes, key=lambda spec: abs(math.log(sizes[spec] / self.start(spec)))))

    def _next(self) -> Spec | None:
        """The cheapest spec expected to meet the target, else the one expected to come closest; None if none may."""
        cost_limit = self.cost_limit
        paying = [(spec, point, cost) for spec, point in self._left.items() if (cost := self.cost(point)) < cost_limit]
        judged = [(spec, cost, *self.error(point)) for spec, point, cost in paying]
        alive = [(spec, cost, error) for spec, cost, error, margin in judged if error / margin <= self._within]
        expected = [candidate for candidate in alive if candidate[2] <= self._within]
        if expected:
            return min(expected, key=lambda candidate: (candidate[1], candidate[2]))[0]
        return min(alive, key=lambda candidate: (candidate[2], candidate[1]))[0] if alive else None

    def _next_of_others(self) -> Spec | None:
        """The cheapest spec expected to meet the target for less than its own technique's cheapest so far, if any."""
        names = {spec.technique.name for spec in self._left}
        best = {name: self._cheapest(one for one in self.trials if one.spec.technique.name == name) for name in names}
        paying = [
            (cost, error, spec)
            for spec, point in self._left.items()
            if (mine := best[spec.technique.name]) is not None
            and (cost := self.cost(point)) < mine.cost
            and (error := self._expected(point)) <= self._within
        ]
        return min(paying, key=lambda candidate: candidate[:2])[2] if paying else None

    def cost(self, point: SearchPoint) -> float:
        """Predicted cost of a spec; a lower bound before anything of its group was measured."""
        known = self._costs.get(point.group)
        if point.size is None or not known:
            return point.base
        near, *others = _nearest(known, point.size)
        texels, fixed = known[near]
        growth = GROWTH[point.size < near]
        if others:
            measured = math.log(known[others[0]][0] / texels) / math.log(others[0] / near)
            growth = min(max(measured, 0.0), GROWTH[1])
        grown: float = texels * (point.size / near) ** growth
        return point.base + fixed + grown

    def error(self, point: SearchPoint) -> tuple[float, float]:
        """Predicted error of a spec, and the factor by which it may be smaller; 0 if nothing is known."""
        if point.size is None or point.group not in self._errors:
            return 0.0, 1.0
        same = self._errors[point.group].get(point.filter)
        if same:
            return extrapolate(same, point.size), self.margins[0]
        return min(self._by_filters(point, point.size), key=lambda prediction: prediction[0] / prediction[1])

    def _expected(self, point: SearchPoint) -> float:
        """Predicted error of a spec by any filter of its group, the most favourable; infinite if nothing is known.

        A neighbour in size says more than the same filter far away, so that both count.
        """
        if point.size is None or point.group not in self._errors:
            return math.inf
        return min(error for error, _ in self._by_filters(point, point.size))

    def _by_filters(self, point: SearchPoint, size: int) -> list[tuple[float, float]]:
        """Predictions of a spec's error by each filter measured in its group, with their margins."""
        found = []
        for other, line in self._errors[point.group].items():
            ratios = [1.0] if other == point.filter else self._ratios(point.filter, other)
            ratio, margin = (statistics.geometric_mean(ratios), self.margins[0]) if ratios else (1.0, self.margins[1])
            found.append((ratio * extrapolate(line, size), margin))
        return found

    def _ratios(self, filter: str, other: str) -> list[float]:
        """Ratios of a filter's error to another's at the same map size, over all groups."""
        both = [(_finite(lines.get(filter, {})), _finite(lines.get(other, {}))) for lines in self._errors.values()]
        return [max(a[size], TINY) / max(b[size], TINY) for a, b in both for size in a.keys() & b.keys()]


def extrapolate(errors: dict[int, float], size: int) -> float:
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


def _finite(errors: dict[int, float]) -> dict[int, float]:
    return {size: error for size, error in errors.items() if math.isfinite(error)}


def _nearest(sizes: Iterable[int], size: int) -> list[int]:
    """The two sizes nearest to a size on a log scale, or the only one."""
    return sorted(sizes, key=lambda other: abs(math.log(other / size)))[:2]
