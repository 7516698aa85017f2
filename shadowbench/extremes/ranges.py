"""What breaks a cell of `stress`, and the operating range that is left of an axis. Reads rows alone."""

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import pandas as pd

from shadowbench.extremes.axes.model import Axis, Value, shown
from shadowbench.measure.rows import Record
from shadowbench.scores.metrics import METRICS

TOLERANCES: dict[str, float] = {"acne": 0.01, "leak": 0.01, "flips": 0.01, "iou": 0.95}
"""The worst that is in tolerance: least for `iou`, most for the others; flips are of the receivers at true edges."""

# What the worker says of a cell, and the kind of failure that it is.
_FATAL = (
    (re.compile(r"^crashed"), "crash"),
    (re.compile(r"^hung"), "hang"),
    (re.compile(r"^ate memory"), "memory"),
    (re.compile(r"OpenGL error"), "gl-error"),
    (re.compile(r"NaN or infinite| is (nan|-?inf);"), "nan"),
)
DEAD = frozenset({"crash", "hang", "memory", "error"})
BROKEN = frozenset({"nan", "gl-error"})


@dataclass(frozen=True)
class Failure:
    """How a cell left tolerance. kind: a metric, or what ended it; amount: the metric's value."""

    kind: str
    amount: float | None = None
    text: str = ""

    def __str__(self) -> str:
        if self.amount is None:
            return self.kind
        return f"IoU {self.amount:.3f}" if self.kind == "iou" else f"{self.kind} {self.amount:.2%}"


def failure(row: Record) -> Failure | None:
    """How a row's cell left tolerance, by what is farthest out; None where it held or is unsupported.

    IoU is named only where neither acne nor leak nor flips explain it. Another metric without a value holds.
    """
    status = str(row["status"])
    if status.startswith("failed: "):
        reason = status.removeprefix("failed: ")
        kind = next((kind for pattern, kind in _FATAL if pattern.search(reason)), "error")
        return Failure(kind, text=reason)
    if status != "ok":
        return None
    values = dict(row["metrics"]) | {"flips": row.get("flips")}
    if values["iou"] is None:
        return Failure("unjudged", text="neither the truth nor the mask has a shadow that is decided")
    found = {
        name: values[name]
        for name, limit in TOLERANCES.items()
        if values[name] is not None and (values[name] < limit if name == "iou" else values[name] > limit)
    }
    shares = {name: value for name, value in found.items() if name != "iou"}
    if shares:
        kind = max(shares, key=lambda name: shares[name] / TOLERANCES[name])
        return Failure(kind, shares[kind])
    return Failure("iou", found["iou"]) if found else None


@dataclass(frozen=True)
class Break:
    """A value of an axis at which a technique leaves tolerance."""

    value: Value
    failure: Failure


@dataclass(frozen=True)
class OperatingRange:
    """How far a technique may be trusted along an axis, under a kind of light.

    held: the values around home in which all holds, in the axis' order; breaks: on an ordered axis the first value out
    of tolerance on either side, else every such value; unsupported: values that the technique refuses; worst: the
    kinds of failure anywhere on the axis; swept: every value that was measured or refused, in the axis' order.
    """

    technique: str
    spec: str
    axis: Axis
    light: str
    held: tuple[Value, ...]
    breaks: tuple[Break, ...]
    unsupported: tuple[Value, ...]
    worst: tuple[str, ...]
    swept: tuple[Value, ...]

    @property
    def share(self) -> float | None:
        """The share in `held` of the values that were measured, in [0, 1]; None where all are refused."""
        return len(self.held) / self.measured if self.held or self.breaks else None

    @property
    def measured(self) -> int:
        """How many of the swept values were not refused."""
        return len(self.swept) - len(self.unsupported)

    @property
    def text(self) -> str:
        """As the table prints it: `plain`, what is refused, and how many values were swept if not all."""
        notes = [self.plain]
        if self.held and self.unsupported:
            notes.append(f"refused: {', '.join(map(shown, self.unsupported))}")
        if len(self.swept) < len(self.axis.values):
            notes.append(f"{len(self.swept)} of {len(self.axis.values)} values")
        return "; ".join(notes)

    @property
    def plain(self) -> str:
        """`0.1…89.9°`, or where and how it breaks."""
        if self.breaks:
            alike: dict[str, list[str]] = {}
            for one in self.breaks:
                alike.setdefault(str(one.failure), []).append(value_text(self.axis, one.value))
            return "; ".join(f"breaks at {', '.join(values)}: {how}" for how, values in alike.items())
        if not self.held:
            return "unsupported"
        if not self.axis.ordered:
            return f"all {len(self.held)}"
        ends = sorted({float(self.held[0]), float(self.held[-1])})
        return "…".join(shown(end) for end in ends) + unit_suffix(self.axis)


def unit_suffix(axis: Axis) -> str:
    """What follows an axis' values: `°`, ` texels`, or nothing."""
    return axis.unit if axis.unit in ("°", "") else f" {axis.unit}"


def value_text(axis: Axis, value: Value) -> str:
    """A value with its unit."""
    return shown(value) + unit_suffix(axis)


def operating_range(axis: Axis, rows: Sequence[Record]) -> OperatingRange:
    """The range of one spec under one light along an axis; rows: one a value that was swept."""
    by_value = {row["axis_value"]: row for row in rows}
    values = [value for value in axis.values if value in by_value]
    failures = {value: failure(by_value[value]) for value in values}
    refused = tuple(value for value in values if str(by_value[value]["status"]).startswith("unsupported"))
    first = rows[0]
    out = [value for value in values if failures[value] is not None]
    if axis.ordered:
        held, broken = _around(values, values.index(axis.home), set(out) | set(refused))
        out = [value for value in broken if value not in refused]
    else:
        held = tuple(value for value in values if value not in out and value not in refused)
    found = tuple(Break(value, one) for value in out if (one := failures[value]) is not None)
    kinds = dict.fromkeys(one.kind for one in failures.values() if one is not None)
    light = str(first["light_kind"])
    return OperatingRange(
        first["technique"], first["home_spec"], axis, light, held, found, refused, tuple(kinds), tuple(values)
    )


def _around(values: list[Value], home: int, out: set[Value]) -> tuple[tuple[Value, ...], tuple[Value, ...]]:
    """The values around home that are not in `out`, and the first on either side that are."""
    if values[home] in out:
        return (), (values[home],)
    low = high = home
    while low > 0 and values[low - 1] not in out:
        low -= 1
    while high < len(values) - 1 and values[high + 1] not in out:
        high += 1
    ends = [index for index in (low - 1, high + 1) if 0 <= index < len(values)]
    return tuple(values[low : high + 1]), tuple(values[index] for index in ends)


def operating_ranges(axes: Iterable[Axis], rows: Iterable[Record]) -> list[OperatingRange]:
    """All ranges, in the order of the axes."""
    groups: dict[tuple[str, str, str], list[Record]] = {}
    for row in rows:
        groups.setdefault((row["axis"], row["home_spec"], row["light_kind"]), []).append(row)
    known = {axis.name: axis for axis in axes}
    order = list(known)
    ranges = [operating_range(known[name], group) for (name, _, _), group in groups.items() if name in known]
    return sorted(ranges, key=lambda one: order.index(one.axis.name))


def ranges_frame(ranges: Sequence[OperatingRange]) -> pd.DataFrame:
    """`ranges.csv`: a line a technique, light and axis."""
    return pd.DataFrame([_line(one) for one in ranges])


def _line(one: OperatingRange) -> dict[str, Any]:
    ends = [shown(value) for value in (one.held[0], one.held[-1])] if one.held and one.axis.ordered else [None, None]
    return {
        "technique": one.technique,
        "spec": one.spec,
        "light": one.light,
        "axis": one.axis.name,
        "unit": one.axis.unit or None,
        "home": shown(one.axis.home),
        "holds_from": ends[0],
        "holds_to": ends[1],
        "breaks_at": "; ".join(shown(broken.value) for broken in one.breaks) or None,
        "failure": "; ".join(str(broken.failure) for broken in one.breaks) or None,
        "unsupported": "; ".join(shown(value) for value in one.unsupported) or None,
        "kinds": "; ".join(one.worst) or None,
        "range": one.text,
    }


def points_frame(rows: Iterable[Record]) -> pd.DataFrame:
    """`table.csv` of a sweep: a line a cell, the metrics along each axis."""
    identity = ["scene", "view", "light", "phase", "technique", "spec", "map_size", "view_size", "renderer", "status"]
    ours = ["axis", "axis_value", "axis_unit", "light_kind", "flips", "receivers", "undecided", "surface_mismatch",
            "gpu_bytes", "coordinates", "full_spec", "mask_sha256", "key"]  # fmt: skip
    lines = [{**row, **row.get("metrics", {}), "failure": str(failure(row) or "") or None} for row in rows]
    return pd.DataFrame(lines, columns=[*identity, *METRICS, "failure", "command", *ours])
