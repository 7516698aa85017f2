"""Operating ranges of a sweep, with the rows behind them."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from statistics import fmean

from shadowbench.extremes.axes import AXES
from shadowbench.extremes.model import NAMES, Axis, Value
from shadowbench.measure.rows import Record
from shadowbench.results.folder import Sweep
from shadowbench.results.ranges import Break, OperatingRange, operating_ranges
from shadowbench.scenes.model import LightKind
from shadowbench.techniques.unshadowed import Unshadowed

Series = tuple[str, LightKind]
"""A spec and a kind of light: a row of the heat map, a line in the charts."""


@dataclass(frozen=True, eq=False)
class Stability:
    """The operating ranges of a sweep; specs best first, axes and lights in the order of `stress`.

    unknown: number of rows at axes or values that this version does not have; unfinished: spec, axis and light of
    sweeps that were stopped before their default value; floor: number of rows of `unshadowed`, which is out of
    tolerance wherever there is a shadow. All three are left out of `ranges`.
    """

    sweep: Sweep
    ranges: tuple[OperatingRange, ...]
    unknown: int
    unfinished: tuple[tuple[str, str, str], ...]
    floor: int

    @property
    def axes(self) -> list[Axis]:
        """The axes with a range, in the order of the table."""
        return list(dict.fromkeys(one.axis for one in self.ranges))

    @cached_property
    def specs(self) -> list[str]:
        """The specs with a range, by decreasing share of values in tolerance."""
        shares: dict[str, list[float]] = {}
        for one in self.ranges:
            shares.setdefault(one.spec, []).append(one.share or 0.0)
        return sorted(shares, key=lambda spec: -fmean(shares[spec]))

    @property
    def series(self) -> list[Series]:
        """All pairs of a spec and a kind of light with a range, in the order of specs and lights."""
        found = {(one.spec, one.light) for one in self.ranges}
        return [(spec, kind) for spec in self.specs for kind in NAMES if (spec, kind) in found]

    @cached_property
    def range_at(self) -> dict[tuple[str, str, str], OperatingRange]:
        """The ranges by spec, axis and kind of light."""
        return {(one.spec, one.axis.name, one.light): one for one in self.ranges}

    @cached_property
    def row_at(self) -> dict[tuple[str, str, str, Value], Record]:
        """The rows by spec, axis, kind of light and axis value."""
        return {(row["home_spec"], row["axis"], row["light_kind"], row["axis_value"]): row for row in self.sweep.rows}

    def rows_of(self, one: OperatingRange) -> list[Record]:
        """The rows of a range, in the order of the axis."""
        return [self.row_at[one.spec, one.axis.name, one.light, value] for value in one.swept]

    def breaking_points(self) -> Iterator[tuple[OperatingRange, Break, Record]]:
        """The breaks of all ranges, each with its range and its row."""
        for one in self.ranges:
            for broken in one.breaks:
                yield one, broken, self.row_at[one.spec, one.axis.name, one.light, broken.value]


def analyse(sweep: Sweep) -> Stability:
    """The operating ranges of a sweep."""
    subjects = [row for row in sweep.rows if row["technique"] != Unshadowed.name]
    known = [row for row in subjects if row["axis"] in AXES and row["axis_value"] in AXES[row["axis"]].values]
    started = dict.fromkeys((row["home_spec"], row["axis"], row["light_kind"]) for row in known)
    complete = {(row["home_spec"], row["axis"], row["light_kind"]) for row in known if _at_default(row)}
    rows = [row for row in known if (row["home_spec"], row["axis"], row["light_kind"]) in complete]
    ranges = operating_ranges(AXES.values(), rows)
    return Stability(
        sweep,
        tuple(ranges),
        unknown=len(subjects) - len(known),
        unfinished=tuple(one for one in started if one not in complete),
        floor=len(sweep.rows) - len(subjects),
    )


def _at_default(row: Record) -> bool:
    """Whether a range can be searched from the row's axis value: the default, or any value of an unordered axis."""
    axis = AXES[row["axis"]]
    return not axis.ordered or row["axis_value"] == axis.default


def complete_count(ranges: Sequence[OperatingRange]) -> int:
    """Number of ranges that are in tolerance at every measured value."""
    return sum(one.share == 1 for one in ranges)
