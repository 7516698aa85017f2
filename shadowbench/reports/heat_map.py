"""The heat map of a sweep as Vega-Lite: how much of each axis every technique holds."""

import json
import re
import textwrap

from shadowbench.extremes.axes import Axis, value_label
from shadowbench.extremes.axes.model import NAMES
from shadowbench.extremes.ranges import Failure, OperatingRange
from shadowbench.reports.axes import Chart
from shadowbench.reports.charts import chart_of
from shadowbench.reports.stability import Line, Stability
from shadowbench.reports.words import digits

SHADES = ("#8a3200", "#f2a777", "#e6f0f7")
"""Of a share of 0, ½ and 1: also told apart in grey, and by those who see no red or green."""
_DARK = 0.19
NOTHING = "#dedede"
"""Of what a technique refuses."""


def shade(share: float) -> str:
    """The colour of a share, as the heat map's scale has it."""
    at = min(max(share, 0.0), 1.0) * (len(SHADES) - 1)
    low = min(int(at), len(SHADES) - 2)
    ends = [[int(SHADES[low + k][1 + 2 * c : 3 + 2 * c], 16) for c in range(3)] for k in range(2)]
    return "#" + "".join(f"{round(a + (b - a) * (at - low)):02x}" for a, b in zip(*ends, strict=True))


def is_dark(share: float) -> bool:
    """Whether text on that colour must be white; on the others black has a contrast of 4.5 and more."""
    return share < _DARK


def heat_map(found: Stability) -> Chart:
    """Share of each axis' values that hold, by spec and light."""
    cells = []
    for spec, kind in found.lines:
        for axis in found.axes:
            one = found.at.get((spec, axis.name, kind))
            if one is not None:
                cell = {"row": _row((spec, kind)), "axis": axis.name, "share": one.share}
                cells.append({**cell, "text": _cell_text(one)})
    rows = [_row(line) for line in found.lines]
    deep = max((row.count("\n") for row in rows), default=0) + 1
    # Labels of several lines grow downwards.
    offsets = [
        {"test": f"length(split(datum.value, '\\n')) == {count}", "value": -6 * (count - 1)}
        for count in range(2, deep + 1)
    ]
    headings = {axis.name: _heading(axis) for axis in found.axes}
    tall = max((len(one) for one in headings.values()), default=1)
    headings = {name: [""] * (tall - len(one)) + one for name, one in headings.items()}
    y = {
        "field": "row",
        "type": "ordinal",
        "sort": rows,
        "title": None,
        "axis": {
            "labelExpr": "split(datum.value, '\\n')",
            "labelOffset": {"condition": offsets, "value": 0},
            "labelLimit": 190,
            "labelFontSize": 11,
            "ticks": False,
            "domain": False,
        },
        "scale": {"paddingInner": 0.05, "paddingOuter": 0.02},
    }
    x = {
        "field": "axis",
        "type": "ordinal",
        "sort": [axis.name for axis in found.axes],
        "title": None,
        "axis": {
            "orient": "top",
            "labelExpr": f"{json.dumps(headings, ensure_ascii=False)}[datum.value]",
            "labelAngle": 0,
            "labelFontSize": 10,
            "labelPadding": 12 * tall - 7,  # lines grow downwards
            "labelLimit": 120,
            "ticks": False,
            "domain": False,
        },
        "scale": {"paddingInner": 0.05, "paddingOuter": 0.02},
    }
    refused = [{"filter": "datum.share === null"}]
    layer: list[Chart] = [
        {
            "transform": [{"filter": "datum.share !== null"}],
            "mark": {"type": "rect"},
            "encoding": {
                "x": x,
                "y": y,
                "color": {
                    "field": "share",
                    "type": "quantitative",
                    "title": "share of the axis' values that hold",
                    "scale": {"domain": [0, 0.5, 1], "range": list(SHADES), "interpolate": "rgb"},
                    "legend": {
                        "orient": "bottom",
                        "direction": "horizontal",
                        "format": "%",
                        "values": [0, 0.5, 1],
                        "gradientLength": 220,
                        "titleLimit": 330,
                        "titleFontWeight": "normal",
                    },
                },
            },
        },
        {
            "transform": refused,
            "mark": {"type": "rect", "color": NOTHING},
            "encoding": {"x": x, "y": y},
        },
        {
            "transform": refused,
            "mark": {"type": "rule", "color": "#8c8c8c"},
            "encoding": {
                "x": {**x, "bandPosition": 0},
                "x2": {"field": "axis", "bandPosition": 1},
                "y": {**y, "bandPosition": 1},
                "y2": {"field": "row", "bandPosition": 0},
            },
        },
    ]
    text = {"type": "text", "fontSize": 9.5, "lineBreak": "\n", "lineHeight": 11, "baseline": "middle"}
    layer.append(
        {
            "transform": [{"calculate": "-5.5 * (length(split(datum.text, '\\n')) - 1)", "as": "up"}],
            "mark": {
                **text,
                "dy": {"expr": "datum.up"},
            },
            "encoding": {
                "x": x,
                "y": y,
                "text": {"field": "text"},
                "color": {
                    "condition": {"test": f"datum.share !== null && datum.share < {_DARK}", "value": "white"},
                    "value": "black",
                },
            },
        }
    )
    about = f"Operating range of every technique along every axis, {found.sweep.label}"
    deep = max([deep, *(str(cell["text"]).count("\n") + 1 for cell in cells)])
    return chart_of(about, cells, layer, (12 * deep + 6) * len(rows))


def _row(line: Line) -> str:
    """The name of a row, its spec and its light, broken between parameters where it is long."""
    lines = [""]
    for piece in re.findall(r"[^,:]*[,:]?", f"{line[0]}, {NAMES[line[1]]}"):
        if lines[-1] and len(lines[-1]) + len(piece) > 30:
            lines.append("")
        lines[-1] += piece
    return "\n".join(one.strip() for one in lines)


def _heading(axis: Axis) -> list[str]:
    """The lines of an axis' name, which end with its unit."""
    return [*axis.name.split("-"), *textwrap.wrap(axis.unit, 10)]


def _cell_text(one: OperatingRange) -> str:
    """A range in the width of a cell: what holds, where that ends, how it breaks; the unit stands above."""
    if one.share is None:
        return "unsupported"
    held = f"{len(one.in_tolerance)} of {len(one.swept)}"
    if one.axis.ordered and one.in_tolerance:
        held = "…".join(
            dict.fromkeys(value_label(end) for end in sorted({float(one.in_tolerance[0]), float(one.in_tolerance[-1])}))
        )
    if not one.breaks:
        return held if one.axis.ordered else f"all {len(one.in_tolerance)}"
    hows = list(dict.fromkeys(_short(broken.failure) for broken in one.breaks))
    how = hows[0] if len(hows) == 1 else ", ".join(dict.fromkeys(broken.failure.kind for broken in one.breaks))
    where = [f"{'or' if k else 'not'} {value_label(broken.value)}" for k, broken in enumerate(one.breaks)]
    return "\n".join([*([held] if one.in_tolerance else []), *(where if one.axis.ordered else []), how])


def _short(broken: Failure) -> str:
    """A failure with no more digits than a cell has room for."""
    if broken.amount is None:
        return broken.kind
    return f"IoU {broken.amount:.2f}" if broken.kind == "iou" else f"{broken.kind} {digits(100 * broken.amount)}%"
