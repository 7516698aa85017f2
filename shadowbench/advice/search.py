"""The cheapest spec of a space that meets a target, found with few measurements.

What a map costs is what its pixels cost and what its texels do: one or two sizes of a group (a technique with all but
size, filter and depth format) tell all others. Its error falls about as its size grows. Of what may be cheaper than the
best so far and may meet the target, the cheapest that is expected to is measured next, until nothing is left.
"""

import math
import statistics
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field

from shadowbench.measure.rows import Result
from shadowbench.techniques.filters import Filter
from shadowbench.techniques.spec import Spec, format_value

SLOPE = 1.0  # of −log error over log size, where an edge is off by a part of a texel
SLOPES = (0.4, 1.6)  # of which a measured one is believed
GROWTH = (
    1.2,
    2.0,
)  # of log cost over log size, up and down: small triangles take a block of texels, large ones few more
FIRST = "hardware"  # the filter that a group is looked at with first
TINY = 1e-6  # error below which nothing is left to predict


@dataclass(frozen=True, eq=False)
class Tried:
    """A measured spec: what it costs, in work or milliseconds, its bytes, and its error, the smaller the better.

    fixed: the part of the cost that no map size changes, that of vertices; result: its rows.
    """

    spec: Spec
    cost: float
    fixed: float
    bytes: int
    error: float
    result: Result | None = None


@dataclass(frozen=True)
class Place:
    """Where a spec stands in its space. group: all but size, filter and depth format; reads: of the map, a pixel."""

    group: str
    filter: str
    reads: int
    size: int | None


def place_of(spec: Spec) -> Place:
    """Where a spec stands."""
    known = type(spec.params).model_fields
    bare = {name: known[name].default for name in ("size", "filter", "depth") if name in known}
    chosen = getattr(spec.params, "filter", None)
    return Place(
        group=spec.with_(**bare).text if bare else spec.text,
        filter=format_value(chosen) if chosen is not None else "",
        reads=chosen.reads if isinstance(chosen, Filter) else 0,
        size=spec.map_size,
    )


@dataclass
class Search:
    """Measures specs of `space` until the cheapest whose error is within `limit` is known, or that there is none.

    pixels: of the picture; start: the map size that needs predict for a group's first look; measure: None for a spec
    that did not hold; margins: how many times an error may be below what another size, and another filter, let expect;
    price: of a unit of work, 1 where costs are work, 0 where nothing is known of it: then less is left out; least: the
    smallest error above 0 that there is: where less is expected, there may be none.
    """

    space: Sequence[Spec]
    limit: float
    pixels: int
    start: Callable[[Spec], float]
    measure: Callable[[Spec], Tried | None]
    margins: tuple[float, float]
    price: float = 1.0
    least: float = TINY
    tried: list[Tried] = field(default_factory=list)

    def __post_init__(self) -> None:
        self._left = {spec: place_of(spec) for spec in self.space}
        self._seen: dict[str, list[tuple[Place, Tried]]] = {}  # what was tried, by group

    def run(self) -> Tried | None:
        """The cheapest that meets the target; None where nothing does."""
        for spec, place in list(self._left.items()):
            if place.size is None and self.cost(place) < self.enough:
                self._try(spec)
        for group in dict.fromkeys(place.group for place in self._left.values() if place.size is not None):
            self._look_at(group)
        while (following := self._next()) is not None:
            self._try(following)
        return self.best

    @property
    def best(self) -> Tried | None:
        """The cheapest so far that meets the target, the one of fewer bytes of two."""
        met = [one for one in self.tried if one.error <= self.limit]
        return min(met, key=lambda one: (one.cost, one.bytes, one.error), default=None)

    @property
    def enough(self) -> float:
        """What another must cost less than."""
        return self.best.cost if self.best else math.inf

    def _try(self, spec: Spec) -> None:
        place = self._left.pop(spec)
        tried = self.measure(spec)
        if tried is not None:
            self.tried.append(tried)
            self._seen.setdefault(place.group, []).append((place, tried))
        elif place.size is not None:  # nor will a map that is as large or larger
            self._left = {
                one: other
                for one, other in self._left.items()
                if other.group != place.group or other.size is None or other.size < place.size
            }

    def _look_at(self, group: str) -> None:
        """A group's first measurement, at about the size that is predicted, or the largest that may still pay."""
        mine = {spec: place for spec, place in self._left.items() if place.group == group}
        first = {spec: place for spec, place in mine.items() if place.filter == FIRST} or mine
        sizes = {spec: place.size for spec, place in first.items() if place.size and self.cost(place) < self.enough}
        if sizes:
            self._try(min(sizes, key=lambda spec: abs(math.log(sizes[spec] / self.start(spec)))))

    def _next(self) -> Spec | None:
        """The cheapest that is expected to meet the target, else the one that comes closest; None when none may."""
        enough, within = self.enough, max(self.limit, self.least)
        paying = [(spec, place, cost) for spec, place in self._left.items() if (cost := self.cost(place)) < enough]
        judged = [(spec, cost, *self.error(place)) for spec, place, cost in paying]
        alive = [(spec, cost, error) for spec, cost, error, margin in judged if error / margin <= within]
        expected = [one for one in alive if one[2] <= within]
        if expected:
            return min(expected, key=lambda one: (one[1], one[2]))[0]
        return min(alive, key=lambda one: (one[2], one[1]))[0] if alive else None

    def cost(self, place: Place) -> float:
        """What a spec is expected to cost; before anything of its group is measured, the least that it can."""
        base = self.price * self.pixels
        reads = base * place.reads
        if place.size is None:
            return base
        mine = {p.size: (p, one) for p, one in self._seen.get(place.group, []) if p.size}
        if not mine:
            return base + reads
        sizes = _nearest(mine, place.size)
        near, *others = [(size, self._texels(*mine[size])) for size in sizes]
        growth = GROWTH[place.size < near[0]]
        if others:
            measured = math.log(others[0][1] / near[1]) / math.log(others[0][0] / near[0])
            growth = min(max(measured, 0.0), GROWTH[1])
        texels: float = near[1] * (place.size / near[0]) ** growth
        return base + mine[near[0]][1].fixed + texels + reads

    def _texels(self, place: Place, one: Tried) -> float:
        """What a map's texels cost."""
        least = self.price * self.pixels * (1 + place.reads)
        return max(one.cost - one.fixed - least, TINY)

    def error(self, place: Place) -> tuple[float, float]:
        """The error that is expected of a spec, and how many times less it may be; 0 where nothing is known of it."""
        mine = self._seen.get(place.group, [])
        if not mine or place.size is None:
            return 0.0, 1.0
        same = {p.size: one.error for p, one in mine if p.filter == place.filter and p.size}
        if same:
            return extrapolated(same, place.size), self.margins[0]
        found = []
        for other, line in self._lines(mine).items():
            ratios = self._ratios(place.filter, other)
            ratio, margin = (statistics.geometric_mean(ratios), self.margins[0]) if ratios else (1.0, self.margins[1])
            found.append((ratio * extrapolated(line, place.size), margin))
        return min(found, key=lambda one: one[0] / one[1])

    def _lines(self, mine: list[tuple[Place, Tried]]) -> dict[str, dict[int, float]]:
        """Errors by size, of each filter."""
        lines: dict[str, dict[int, float]] = {}
        for place, one in mine:
            if place.size is not None:
                lines.setdefault(place.filter, {})[place.size] = one.error
        return lines

    def _ratios(self, filter: str, other: str) -> list[float]:
        """What a filter's error was to another's, at the same size in any group."""
        groups = [self._lines(seen) for seen in self._seen.values()]
        both = [(_numbers(lines.get(filter, {})), _numbers(lines.get(other, {}))) for lines in groups]
        return [max(a[size], TINY) / max(b[size], TINY) for a, b in both for size in a.keys() & b.keys()]


def extrapolated(errors: dict[int, float], size: int) -> float:
    """The error at a size from those at others: a line in logarithms through the two nearest.

    Infinite ones are on no line. Where all are, a map that is no larger is no better; of a larger nothing is known: 0.
    """
    if not _numbers(errors):
        return math.inf if size <= max(errors) else 0.0
    errors = _numbers(errors)
    near = _nearest(errors, size)
    first = math.log(max(errors[near[0]], TINY))
    slope = SLOPE
    if len(near) == 2:
        rise = math.log(max(errors[near[1]], TINY)) - first
        slope = min(max(-rise / math.log(near[1] / near[0]), SLOPES[0]), SLOPES[1])
    return math.exp(first - slope * math.log(size / near[0]))


def _numbers(errors: dict[int, float]) -> dict[int, float]:
    """The finite ones."""
    return {size: error for size, error in errors.items() if math.isfinite(error)}


def _nearest(sizes: Iterable[int], size: int) -> list[int]:
    """The two sizes that are nearest to one, or the only one."""
    return sorted(sizes, key=lambda other: abs(math.log(other / size)))[:2]
