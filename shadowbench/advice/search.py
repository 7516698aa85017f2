"""Search for the cheapest spec that meets a target, with few measurements.

Specs that differ only in map size, filter and depth format form a group. The cost of a spec has a part per pixel and a
part per texel, so one or two sizes of a group predict the others; its error is roughly inverse to its map size. Among
the specs that may be cheaper than the best so far and may meet the target, the cheapest one expected to meet it is
measured next, until none is left. Then each technique of which a spec meets the target is searched for a cheaper one of
its own.
"""

import math
import statistics
from collections import defaultdict
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field

from shadowbench.maps.filters import Filter
from shadowbench.measure.rows import Result
from shadowbench.plugin.spec import Spec, format_value

SLOPE = 1.0  # default of −d log(error) / d log(size): an edge is off by a fraction of a texel
SLOPES = (0.4, 1.6)  # range to which measured slopes are clamped
# Default of d log(cost) / d log(size), for larger and for smaller maps: each triangle costs at least a block of texels.
GROWTH = (1.2, 2.0)
FIRST = "hardware"  # filter of a group's first trial
TINY = 1e-6  # smallest error used in predictions


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


@dataclass
class Untried:
    """Numbers of specs of a technique that a search left out.

    dearer: predicted to cost at least as much as the cheapest that meets the target; inaccurate: predicted to miss the
    target; beyond: with the map of one that failed, or a larger one; unranked: without a cost.
    """

    dearer: int = 0
    inaccurate: int = 0
    beyond: int = 0
    unranked: int = 0


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

    def untried(self) -> dict[str, Untried]:
        """Specs that were not measured, counted by technique and by what is predicted of them."""
        found: defaultdict[str, Untried] = defaultdict(Untried)
        for spec, point in self._left.items():
            if self.cost(point) >= self.cost_limit:
                found[spec.technique.name].dearer += 1
            else:
                found[spec.technique.name].inaccurate += 1
        for spec in self._beyond:
            found[spec.technique.name].beyond += 1
        return dict(found)

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
