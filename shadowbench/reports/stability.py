"""Operating ranges of a sweep, with the rows behind them, and what reports say of them in words."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from statistics import fmean

from shadowbench.errors import counted
from shadowbench.extremes.axes import AXES
from shadowbench.extremes.model import NAMES, Axis, Value
from shadowbench.measure.rows import Record
from shadowbench.results.frame import Run
from shadowbench.results.ranges import HARD, SOFT, Break, OperatingRange, operating_ranges, value_text
from shadowbench.scenes.model import LightKind
from shadowbench.scores.motion import MOTION
from shadowbench.techniques.unshadowed import Unshadowed

Series = tuple[str, LightKind]
"""A spec and a kind of light: a row of the heat map, a line in the charts."""


@dataclass(frozen=True, eq=False)
class Stability:
    """The operating ranges of a sweep."""

    sweep: Run
    ranges: tuple[OperatingRange, ...]

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
        pairs = {(one.spec, one.light) for one in self.ranges}
        return [(spec, kind) for spec in self.specs for kind in NAMES if (spec, kind) in pairs]

    @cached_property
    def range_at(self) -> dict[tuple[str, str, str], OperatingRange]:
        """The ranges by spec, axis and kind of light."""
        return {(one.spec, one.axis.name, one.light): one for one in self.ranges}

    @cached_property
    def _row_at(self) -> dict[tuple[str, str, str, Value], Record]:
        return {(*_line(row), row["axis_value"]): row for row in self.sweep.rows}

    def rows_of(self, one: OperatingRange) -> list[Record]:
        """The rows of a range, in the order of the axis."""
        return [self._row_at[one.spec, one.axis.name, one.light, value] for value in one.swept]

    def breaking_points(self) -> Iterator[tuple[OperatingRange, Break, Record]]:
        """The breaks of all ranges, each with its range and its row."""
        for one in self.ranges:
            for broken in one.breaks:
                yield one, broken, self._row_at[one.spec, one.axis.name, one.light, broken.value]

    @property
    def headline(self) -> list[str]:
        """Sentences on the number of axes along which each spec is in tolerance, and on cells left out."""
        counts = []
        for spec in self.specs:
            whole = [one.share == 1 for one in self.ranges if one.spec == spec]
            counts.append(f"`{spec}` {sum(whole)} of {len(whole)}")
        about = "Axes, counted per kind of light, that are in tolerance from end to end"
        lines = [f"{about}: {', '.join(counts)}." if counts else "No spec has an operating range."]
        if left_out := len(self.sweep.rows) - sum(len(one.swept) for one in self.ranges):
            why = f"of `{Unshadowed.name}`, of an unfinished sweep, or at a value that this version lacks"
            lines.append(f"Left out: {counted(left_out, 'cell')} {why}.")
        return lines

    def table(self, series: Sequence[Series]) -> list[tuple[Axis, list[OperatingRange | None]]]:
        """A row per axis with a range in any of the series: the axis, and the range of each, None if not swept."""
        rows = [(axis, [self.range_at.get((spec, axis.name, kind)) for spec, kind in series]) for axis in self.axes]
        return [row for row in rows if any(row[1])]

    @property
    def without_picture(self) -> list[tuple[str, str]]:
        """Breaking points without a picture, as (spec, axis value and light; status) pairs."""
        return [
            (f"{one.spec} at {one.axis.name} {value_text(one.axis, broken.value)}, {row['light']}", row["status"])
            for one, broken, row in self.breaking_points()
            if row["status"] != "ok"
        ]


def analyse(sweep: Run) -> Stability:
    """The operating ranges of a sweep, without those of `unshadowed`, which is out of tolerance wherever shadow is."""
    subjects = [row for row in sweep.rows if row["technique"] != Unshadowed.name]
    known = [row for row in subjects if row["axis"] in AXES and row["axis_value"] in AXES[row["axis"]].values]
    return Stability(sweep, tuple(operating_ranges(AXES.values(), known)))


def _line(row: Record) -> tuple[str, str, str]:
    return row["home_spec"], row["axis"], row["light_kind"]


def tolerances() -> str:
    """The tolerances of `stress` as text."""
    most = {name: f"{limit:g} px" if name in MOTION else f"{100 * limit:g}%" for name, limit in HARD.items()}
    hard = [f"{name} of at most {limit}" for name, limit in most.items() if name != "iou"]
    soft = ", ".join(f"{name} of at most {limit:g}" for name, limit in SOFT.items())
    limits = ", ".join([f"IoU of at least {HARD['iou']:g}", *hard, f"of soft shadows {soft}"])
    return f"{limits}; no NaN, infinity, OpenGL error, crash or hang"
