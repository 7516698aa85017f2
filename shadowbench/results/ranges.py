"""Failures of cells of `stress`, and operating ranges along axes, computed from rows alone."""

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import takewhile
from typing import Any

import pandas as pd

from shadowbench.extremes.model import Axis, Value, value_label
from shadowbench.measure.columns import ROW_METRICS
from shadowbench.measure.rows import Record
from shadowbench.scores.metrics import METRICS, is_soft
from shadowbench.scores.motion import MOTION

HARD = {"acne": 0.01, "leak": 0.01, "terminator": 0.01, "flicker": 0.04, "swim": 0.01, "iou": 0.95}
SOFT = {"bleed": 0.01, "false_dark": 0.01, "rmse": 0.05}
TOLERANCES: dict[str, float] = {**HARD, **SOFT}
"""Limits of tolerance, of hard and of soft shadows: a minimum for `iou`, maxima for the others.

Along the axes of movement about 1% of the pixels at true edges flip from frame to frame where `flicker`, under a moving
light, or `swim`, for a moving camera, reach these pixels.
"""
_WHOLE = {"iou": "IoU {:.3f}", "rmse": "RMSE {:.3f}"}  # of the whole mask
_TEXTS = {**_WHOLE, "flicker": "flicker {:.3f} px", "swim": "swim {:.4f} px"}  # of the metrics that are no shares

# Kinds of failure by the beginning or a part of the failure message.
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
    """Why a cell is out of tolerance. kind: a metric, or a kind of failure; amount: value of the metric."""

    kind: str
    amount: float | None = None
    text: str = ""

    def __str__(self) -> str:
        if self.amount is None:
            return self.kind
        return _TEXTS.get(self.kind, f"{self.kind} {{:.2%}}").format(self.amount)


def tolerances_of(metrics: Mapping[str, float | None]) -> dict[str, float]:
    """The limits for a row with these metrics: those of hard or of soft shadows."""
    return SOFT if is_soft(metrics) else HARD


def failure(row: Record) -> Failure | None:
    """Why a row's cell is out of tolerance, by its worst metric, IoU and RMSE last; None if it is not."""
    status = str(row["status"])
    if status.startswith("failed: "):
        reason = status.removeprefix("failed: ")
        kind = next((kind for pattern, kind in _FATAL if pattern.search(reason)), "error")
        return Failure(kind, text=reason)
    if status != "ok":
        return None
    values = row.get("metrics", {})
    if values["iou"] is None:
        return Failure("unjudged", text="neither the truth nor the mask has a shadow that is decided")
    exceeded = {
        name: value
        for name, limit in tolerances_of(values).items()
        if (value := values.get(name)) is not None and not ROW_METRICS[name].meets(value, limit)
    }
    if not exceeded:
        return None
    worst = max(exceeded, key=lambda name: -1 if name in _WHOLE else exceeded[name] / TOLERANCES[name])
    return Failure(worst, exceeded[worst])


@dataclass(frozen=True)
class Break:
    """An axis value at which a technique is out of tolerance."""

    value: Value
    failure: Failure


@dataclass(frozen=True)
class OperatingRange:
    """Operating range of a spec along an axis, under one kind of light. Values are in the order of the axis.

    in_tolerance: values in tolerance, on an ordered axis the contiguous ones around the default; breaks: values out of
    tolerance, on an ordered axis the first on either side; unsupported: values that the technique does not support;
    swept: all values of the sweep.
    """

    technique: str
    spec: str
    axis: Axis
    light: str
    in_tolerance: tuple[Value, ...]
    breaks: tuple[Break, ...]
    unsupported: tuple[Value, ...]
    swept: tuple[Value, ...]

    @property
    def share(self) -> float | None:
        """Share of the measured values that are in tolerance, in [0, 1]; None if none was measured."""
        return len(self.in_tolerance) / self.measured if self.in_tolerance or self.breaks else None

    @property
    def measured(self) -> int:
        """Number of swept values that are supported."""
        return len(self.swept) - len(self.unsupported)

    @property
    def text(self) -> str:
        """Text for tables: `plain`, the unsupported values, and the number of values swept if not all."""
        notes = [self.plain]
        if self.in_tolerance and self.unsupported:
            notes.append(f"refused: {', '.join(map(value_label, self.unsupported))}")
        if len(self.swept) < len(self.axis.values):
            notes.append(f"{len(self.swept)} of {len(self.axis.values)} values")
        return "; ".join(notes)

    @property
    def plain(self) -> str:
        """The range, such as `0.1…89.9°`, or where and why it breaks."""
        if self.breaks:
            alike: dict[str, list[str]] = {}
            for broken in self.breaks:
                alike.setdefault(str(broken.failure), []).append(value_text(self.axis, broken.value))
            return "; ".join(f"breaks at {', '.join(values)}: {how}" for how, values in alike.items())
        if not self.in_tolerance:
            return "unsupported"
        if not self.axis.ordered:
            return f"all {len(self.in_tolerance)}"
        ends = sorted({float(self.in_tolerance[0]), float(self.in_tolerance[-1])})
        return "…".join(value_label(end) for end in ends) + unit_suffix(self.axis)


def unit_suffix(axis: Axis) -> str:
    """Unit after a value of an axis: `°`, ` texels`, or nothing."""
    return axis.unit if axis.unit in ("°", "") else f" {axis.unit}"


def value_text(axis: Axis, value: Value) -> str:
    """Text of a value with its unit."""
    return value_label(value) + unit_suffix(axis)


def operating_range(axis: Axis, rows: Sequence[Record]) -> OperatingRange:
    """Operating range of one spec under one light along an axis; rows: one per swept value."""
    by_value = {row["axis_value"]: row for row in rows}
    values = [value for value in axis.values if value in by_value]
    failures = {value: reason for value in values if (reason := failure(by_value[value])) is not None}
    refused = [value for value in values if str(by_value[value]["status"]).startswith("unsupported")]
    held = [value for value in values if value not in failures and value not in refused]
    held, ends = _around(values, axis.default, held) if axis.ordered else (held, list(failures))
    return OperatingRange(
        technique=rows[0]["technique"],
        spec=rows[0]["home_spec"],
        axis=axis,
        light=str(rows[0]["light_kind"]),
        in_tolerance=tuple(held),
        breaks=tuple(Break(value, failures[value]) for value in ends if value in failures),
        unsupported=tuple(refused),
        swept=tuple(values),
    )


def _around(values: list[Value], default: Value, held: list[Value]) -> tuple[list[Value], list[Value]]:
    """The contiguous values around the default that held, and the first that did not on either side."""
    at = values.index(default)
    if default not in held:
        return [], [default]
    low = at - len([*takewhile(held.__contains__, reversed(values[:at]))])
    high = at + len([*takewhile(held.__contains__, values[at:])])
    return values[low:high], [*values[:low][-1:], *values[high : high + 1]]


def operating_ranges(axes: Iterable[Axis], rows: Iterable[Record]) -> list[OperatingRange]:
    """All operating ranges, in the order of the axes; none on an ordered axis whose default value was not measured."""
    groups: dict[tuple[str, str, str], list[Record]] = {}
    for row in rows:
        groups.setdefault((row["axis"], row["home_spec"], row["light_kind"]), []).append(row)
    return [
        operating_range(axis, group)
        for axis in axes
        for (name, _, _), group in groups.items()
        if name == axis.name and (not axis.ordered or any(row["axis_value"] == axis.default for row in group))
    ]


def ranges_frame(ranges: Sequence[OperatingRange]) -> pd.DataFrame:
    """Contents of `ranges.csv`: one line per technique, light and axis."""
    return pd.DataFrame([_line(one) for one in ranges])


def _line(one: OperatingRange) -> dict[str, Any]:
    def joined(parts: Iterable[object]) -> str | None:
        return "; ".join(map(str, parts)) or None

    held = [value_label(value) for value in one.in_tolerance if one.axis.ordered]
    return {
        "technique": one.technique,
        "spec": one.spec,
        "light": one.light,
        "axis": one.axis.name,
        "unit": one.axis.unit or None,
        "home": value_label(one.axis.default),
        "holds_from": held[0] if held else None,
        "holds_to": held[-1] if held else None,
        "breaks_at": joined(value_label(broken.value) for broken in one.breaks),
        "failure": joined(broken.failure for broken in one.breaks),
        "unsupported": joined(map(value_label, one.unsupported)),
        "range": one.text,
    }


def points_frame(rows: Iterable[Record]) -> pd.DataFrame:
    """Contents of a sweep's `table.csv`: one line per cell, with its axis value and metrics."""
    columns = [
        *(
            "scene",
            "view",
            "light",
            "phase",
            "technique",
            "spec",
            "map_size",
            "view_size",
            "view_width",
            "renderer",
            "status",
        ),
        *(*METRICS, "failure", "command", "axis", "axis_value", "axis_unit", "light_kind", *MOTION, "receivers"),
        *("undecided", "surface_mismatch", "gpu_bytes", "coordinates", "full_spec", "mask_sha256", "key"),
    ]
    lines = [{**row, **row.get("metrics", {}), "failure": str(failure(row) or "") or None} for row in rows]
    return pd.DataFrame(lines, columns=columns)
