"""What a sweep says: how far each spec may be trusted along each axis, and the cells at which that ends."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from statistics import fmean

from shadowbench.extremes.axes import AXES, Axis, Value
from shadowbench.extremes.axes.model import NAMES
from shadowbench.extremes.ranges import Break, OperatingRange, operating_ranges
from shadowbench.measure.rows import Record
from shadowbench.scenes.model import LightKind
from shadowbench.studies.folder import Sweep
from shadowbench.techniques.unshadowed import Unshadowed

Line = tuple[str, LightKind]
"""A spec under a kind of light: a row of the heat map, a line of the charts."""


@dataclass(frozen=True, eq=False)
class Stability:
    """The operating ranges of a sweep. Specs stand best first, axes and lights as `stress` prints them.

    unknown: rows at axes or values that this version does not have; unfinished: spec, axis and light of those that
    were stopped before the value from which a range is searched; floor: rows of `unshadowed`, which every score is read
    against and which breaks wherever there is a shadow. All three are left out of `ranges`.
    """

    sweep: Sweep
    ranges: tuple[OperatingRange, ...]
    unknown: int
    unfinished: tuple[tuple[str, str, str], ...]
    floor: int

    @property
    def axes(self) -> list[Axis]:
        """Those with a range, in the order of the table."""
        return list(dict.fromkeys(one.axis for one in self.ranges))

    @cached_property
    def specs(self) -> list[str]:
        """Those with a range, first the one that holds the largest share of its axes."""
        shares: dict[str, list[float]] = {}
        for one in self.ranges:
            shares.setdefault(one.spec, []).append(one.share or 0.0)
        return sorted(shares, key=lambda spec: -fmean(shares[spec]))

    @property
    def lines(self) -> list[Line]:
        """Spec by spec, its kinds of light."""
        found = {(one.spec, one.light) for one in self.ranges}
        return [(spec, kind) for spec in self.specs for kind in NAMES if (spec, kind) in found]

    @cached_property
    def at(self) -> dict[tuple[str, str, str], OperatingRange]:
        """The range of a spec, an axis and a light."""
        return {(one.spec, one.axis.name, one.light): one for one in self.ranges}

    @cached_property
    def points(self) -> dict[tuple[str, str, str, Value], Record]:
        """The row of a spec, an axis, a light and a value."""
        return {(row["home_spec"], row["axis"], row["light_kind"], row["axis_value"]): row for row in self.sweep.rows}

    def rows_of(self, one: OperatingRange) -> list[Record]:
        """Its rows, in the order of the axis."""
        return [self.points[one.spec, one.axis.name, one.light, value] for value in one.swept]

    def breaking_points(self) -> Iterator[tuple[OperatingRange, Break, Record]]:
        """Every break of every range, with the row that was measured there."""
        for one in self.ranges:
            for broken in one.breaks:
                yield one, broken, self.points[one.spec, one.axis.name, one.light, broken.value]


def stability(sweep: Sweep) -> Stability:
    """The ranges of a sweep's rows."""
    subjects = [row for row in sweep.rows if row["technique"] != Unshadowed.name]
    known = [row for row in subjects if row["axis"] in AXES and row["axis_value"] in AXES[row["axis"]].values]
    begun = dict.fromkeys((row["home_spec"], row["axis"], row["light_kind"]) for row in known)
    homed = {(row["home_spec"], row["axis"], row["light_kind"]) for row in known if _from_here(row)}
    rows = [row for row in known if (row["home_spec"], row["axis"], row["light_kind"]) in homed]
    ranges = operating_ranges(AXES.values(), rows)
    return Stability(
        sweep,
        tuple(ranges),
        unknown=len(subjects) - len(known),
        unfinished=tuple(one for one in begun if one not in homed),
        floor=len(sweep.rows) - len(subjects),
    )


def _from_here(row: Record) -> bool:
    """Whether a range can be searched from a row's value: on an axis without an order, from any."""
    axis = AXES[row["axis"]]
    return not axis.ordered or row["axis_value"] == axis.default


def whole(ranges: Sequence[OperatingRange]) -> int:
    """How many of them hold at every value."""
    return sum(one.share == 1 for one in ranges)
