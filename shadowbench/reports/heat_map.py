"""The Vega-Lite heat map of a sweep: share of each axis' values at which a technique is in tolerance."""

import json
import re
import textwrap
from collections.abc import Sequence
from typing import Any

from shadowbench.extremes.model import NAMES, Axis, value_label
from shadowbench.reports.axes import Chart, mark, quantity
from shadowbench.reports.charts import chart_of
from shadowbench.reports.stability import Series, Stability
from shadowbench.reports.words import digits
from shadowbench.results.ranges import Failure, OperatingRange

SHADES = ("#8a3200", "#f2a777", "#e6f0f7")
"""Colours of shares 0, ½ and 1; distinguishable in greyscale and by the colour-blind."""
_DARK = 0.19  # share below which text on the colour is white
UNSUPPORTED_COLOR = "#dedede"
"""Colour of unsupported axes."""


def share_color(share: float) -> str:
    """The hex colour of a share in [0, 1] on the heat map's scale."""
    at = min(max(share, 0.0), 1.0) * (len(SHADES) - 1)
    low = min(int(at), len(SHADES) - 2)
    ends = [[int(SHADES[low + k][1 + 2 * c : 3 + 2 * c], 16) for c in range(3)] for k in range(2)]
    return "#" + "".join(f"{round(a + (b - a) * (at - low)):02x}" for a, b in zip(*ends, strict=True))


def is_dark(share: float) -> bool:
    """Whether text on the colour of a share must be white, so that the contrast is at least 4.5."""
    return share < _DARK


def heat_map(found: Stability) -> Chart:
    """The heat map: rows are specs by kind of light, columns are axes."""
    cells = [
        {"row": _row((spec, kind)), "axis": axis.name, "share": one.share, "text": _cell_text(one)}
        for spec, kind in found.series
        for axis in found.axes
        if (one := found.range_at.get((spec, axis.name, kind))) is not None
    ]
    rows = [_row(series) for series in found.series]
    label_lines = max((row.count("\n") for row in rows), default=0) + 1
    x, y = _columns(found.axes), _rows(rows, label_lines)
    shades = quantity(
        "share",
        "share of the axis' values in tolerance",
        scale={"domain": [0, 0.5, 1], "range": list(SHADES), "interpolate": "rgb"},
        legend={
            "orient": "bottom",
            "direction": "horizontal",
            "format": "%",
            "values": [0, 0.5, 1],
            "gradientLength": 220,
            "titleLimit": 330,
            "titleFontWeight": "normal",
        },
    )
    at, unsupported = {"x": x, "y": y}, {"filter": "datum.share === null"}
    diagonal = {"x": {**x, "bandPosition": 0}, "x2": {"field": "axis", "bandPosition": 1}}
    diagonal |= {"y": {**y, "bandPosition": 1}, "y2": {"field": "row", "bandPosition": 0}}
    dark = {"test": f"datum.share !== null && datum.share < {_DARK}", "value": "white"}
    text = {**at, "text": {"field": "text"}, "color": {"condition": dark, "value": "black"}}
    up = {"calculate": "-5.5 * (length(split(datum.text, '\\n')) - 1)", "as": "up"}
    lines_of = {"fontSize": 9.5, "lineBreak": "\n", "lineHeight": 11, "baseline": "middle", "dy": {"expr": "datum.up"}}
    layer: list[Chart] = [
        mark("rect", {**at, "color": shades}, {"filter": "datum.share !== null"}),
        mark("rect", at, unsupported, color=UNSUPPORTED_COLOR),
        mark("rule", diagonal, unsupported, color="#8c8c8c"),
        mark("text", text, up, **lines_of),
    ]
    about = f"Operating range of every technique along every axis, {found.sweep.label}"
    lines = max([label_lines, *(str(cell["text"]).count("\n") + 1 for cell in cells)])
    return chart_of(about, cells, layer, (12 * lines + 6) * len(rows))


def _bands(field: str, sort: Sequence[str], **axis: Any) -> Chart:
    """A channel of rows or columns of cells."""
    about = {"field": field, "type": "ordinal", "sort": sort, "title": None}
    return {
        **about,
        "axis": {**axis, "ticks": False, "domain": False},
        "scale": {"paddingInner": 0.05, "paddingOuter": 0.02},
    }


def _rows(rows: Sequence[str], most_lines: int) -> Chart:
    # Multi-line labels extend downwards; the offsets centre them.
    offsets = [
        {"test": f"length(split(datum.value, '\\n')) == {count}", "value": -6 * (count - 1)}
        for count in range(2, most_lines + 1)
    ]
    return _bands(
        "row",
        rows,
        labelExpr="split(datum.value, '\\n')",
        labelOffset={"condition": offsets, "value": 0},
        labelLimit=190,
        labelFontSize=11,
    )


def _columns(axes: Sequence[Axis]) -> Chart:
    headings = {axis.name: _heading(axis) for axis in axes}
    lines = max((len(one) for one in headings.values()), default=1)
    headings = {name: [""] * (lines - len(one)) + one for name, one in headings.items()}
    return _bands(
        "axis",
        list(headings),
        orient="top",
        labelExpr=f"{json.dumps(headings, ensure_ascii=False)}[datum.value]",
        labelAngle=0,
        labelFontSize=10,
        labelPadding=12 * lines - 7,  # multi-line labels extend downwards
        labelLimit=120,
    )


def _row(series: Series) -> str:
    """The label of a row, its spec and light; long labels have line breaks between parameters."""
    lines = [""]
    for piece in re.findall(r"[^,:]*[,:]?", f"{series[0]}, {NAMES[series[1]]}"):
        if lines[-1] and len(lines[-1]) + len(piece) > 30:
            lines.append("")
        lines[-1] += piece
    return "\n".join(one.strip() for one in lines)


def _heading(axis: Axis) -> list[str]:
    """The lines of a column heading: the axis' name and unit."""
    return [*axis.name.split("-"), *textwrap.wrap(axis.unit, 10)]


def _cell_text(one: OperatingRange) -> str:
    """Short text of a range: the values in tolerance, where it breaks, and how; without the unit."""
    if one.share is None:
        return "unsupported"
    in_tolerance = f"{len(one.in_tolerance)} of {len(one.swept)}"
    if one.axis.ordered and one.in_tolerance:
        in_tolerance = "…".join(
            dict.fromkeys(value_label(end) for end in sorted({float(one.in_tolerance[0]), float(one.in_tolerance[-1])}))
        )
    if not one.breaks:
        return in_tolerance if one.axis.ordered else f"all {len(one.in_tolerance)}"
    failures = list(dict.fromkeys(_short(broken.failure) for broken in one.breaks))
    failure = (
        failures[0] if len(failures) == 1 else ", ".join(dict.fromkeys(broken.failure.kind for broken in one.breaks))
    )
    where = [f"{'or' if k else 'not'} {value_label(broken.value)}" for k, broken in enumerate(one.breaks)]
    return "\n".join([*([in_tolerance] if one.in_tolerance else []), *(where if one.axis.ordered else []), failure])


def _short(failure: Failure) -> str:
    """Text of a failure that fits into a cell."""
    if failure.amount is None:
        return failure.kind
    return f"IoU {failure.amount:.2f}" if failure.kind == "iou" else f"{failure.kind} {digits(100 * failure.amount)}%"
