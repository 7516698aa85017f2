"""Charts of a sweep: the colours of its table, and the metrics along each axis."""

import json
import math
from collections.abc import Sequence
from typing import Any

from shadowbench.extremes.model import NAMES, Axis, Value, value_label
from shadowbench.measure.rows import Record
from shadowbench.reports.charts import (
    BASE_CHART,
    INK,
    PARAMS,
    SHOWN_ONLY,
    TOOLTIP,
    Chart,
    Styles,
    chart_of,
    looks,
    mark,
    quantity,
)
from shadowbench.reports.stability import Stability
from shadowbench.reports.texts import digits
from shadowbench.results.ranges import TOLERANCES, OperatingRange, failure, tolerances_of, value_text

SHADES = ("#8a3200", "#f2a777", "#e6f0f7")
"""Colours of shares 0, ½ and 1; distinguishable in greyscale and by the colour-blind."""
UNSUPPORTED_COLOR = "#dedede"
_DARK = 0.19  # share below which text on the colour is white, so that the contrast is at least 4.5

ERROR = "1 − IoU"
LIMITS: dict[str, float] = {ERROR: round(1 - TOLERANCES["iou"], 9)} | {
    name: limit for name, limit in TOLERANCES.items() if name != "iou"
}
"""The metrics in charts along axes, all of them errors, with the largest value of each that is in tolerance."""
_ALL_LIGHTS = "all"
_DASHES = {"sun": [1, 0], "spot": [7, 4], "lamp": [2, 3]}


def share_colors(one: OperatingRange) -> tuple[str, str]:
    """The colours of a range's cell and of its text, by the share of values in tolerance."""
    if one.share is None:
        return UNSUPPORTED_COLOR, "black"
    return share_color(one.share), "white" if one.share < _DARK else "black"


def share_color(share: float) -> str:
    """The hex colour of a share in [0, 1] on the scale of the table."""
    low = int(share >= 0.5)
    ends = zip(bytes.fromhex(SHADES[low][1:]), bytes.fromhex(SHADES[low + 1][1:]), strict=True)
    return "#" + "".join(f"{round(a + (b - a) * (2 * share - low)):02x}" for a, b in ends)


def axis_chart(stability: Stability, axis: Axis) -> Chart:
    """The chart of one metric along an axis; the page sets its signals `metric` and `light`."""
    chart = chart_of(
        f"Metrics along {axis.name}, {stability.sweep.label}", *_along(stability, axis, None, "metric"), 230
    )
    signals = [{"name": "metric", "value": ERROR}, {"name": "light", "value": _ALL_LIGHTS}]
    return {**chart, "params": [*PARAMS, *signals]}


def axis_figure(stability: Stability, axis: Axis, styles: Styles) -> Chart:
    """A figure of all metrics along an axis, in panels one below the other."""
    panels = []
    for name in metrics_along(stability, axis):
        values, layer = _along(stability, axis, styles, f"'{name}'")
        title = {"text": name, "anchor": "start"}
        panels.append({"width": 760, "height": 190, "title": title, "data": {"values": values}, "layer": layer})
    params = [*PARAMS, {"name": "light", "value": _ALL_LIGHTS}]
    return {**BASE_CHART, "description": f"Metrics along {axis.name}", "params": params, "vconcat": panels}


def metrics_along(stability: Stability, axis: Axis) -> list[str]:
    """The metrics that have a value anywhere on an axis."""
    every = [_errors(row) for one in stability.ranges if one.axis is axis for row in stability.rows_of(one)]
    return [name for name in LIMITS if any(errors[name] is not None for errors in every)]


def _along(stability: Stability, axis: Axis, styles: Styles | None, metric: str) -> tuple[list[Chart], list[Chart]]:
    """The data and layers of one panel; metric: Vega expression of the metric's name."""
    keys = {(spec, axis.name, kind): NAMES[kind] for spec, kind in stability.series}
    ranges = {stability.range_at[key]: light for key, light in keys.items() if key in stability.range_at}
    swept = [value for value in axis.values if any(value in one.swept for one in ranges)]
    places = dict(zip(swept, _places(swept), strict=True))
    points = [
        _point(one, light, row, places[row["axis_value"]])
        for one, light in ranges.items()
        for row in stability.rows_of(one)
    ]
    ticks, labels = list(places.values()), json.dumps([value_label(value) for value in swept], ensure_ascii=False)
    x = quantity(
        "x",
        f"{axis.name}{f', {axis.unit}' if axis.unit else ''}; default: {value_label(axis.default)}",
        scale={"domain": [min(ticks), max(ticks)], "nice": False, "zero": False, "padding": 12},
        axis={
            "values": ticks,
            "labelExpr": f"{labels}[indexof({json.dumps(ticks)}, datum.value)]",
            "labelOverlap": "greedy",
            "grid": True,
        },
    )
    scale = {"type": "symlog", "constant": 1e-4, "domain": [0, 1], "nice": False}
    y = quantity("y", None, scale=scale, axis={"values": [0, 1e-4, 1e-3, 1e-2, 1e-1, 1], "format": "~g"})
    dash = {
        "field": "light",
        "title": None,
        "legend": {"orient": "bottom", "symbolType": "stroke"} if styles else None,
        "scale": {"domain": list(_DASHES), "range": list(_DASHES.values())},
    }
    chosen = {"filter": f"light == '{_ALL_LIGHTS}' || datum.light == light"}
    value = {"calculate": f"datum[{metric}]", "as": "y"}
    valid = [chosen, SHOWN_ONLY, value, {"filter": "isValid(datum.y)"}]
    limit = {"data": {"values": [LIMITS]}, "transform": [value]}
    label = {"x": {"value": 0}, "y": y, "text": {"value": "tolerance"}}
    look = looks(styles, (one.spec for one in ranges))
    at, color = {"x": x, "y": y}, {"color": look["color"]}
    line = {"strokeDash": dash, "detail": [{"field": "spec"}, {"field": "light"}], "order": {"field": "x"}}
    broken = {"stroke": {"condition": {"test": "datum.broken", "value": INK}, "value": None}}
    cross: dict[str, Any] = {"text": "✕", "fontSize": 14, "fontWeight": "bold", "cursor": "crosshair"}
    ended = {"x": x, "y": {"value": 7}} | color | TOOLTIP
    layer: list[Chart] = [
        {**limit, **mark("rule", {"y": y}, color=INK, strokeDash=[2, 2])},
        {**limit, **mark("text", label, align="left", dx=3, dy=-6, fontSize=10.5, color=INK)},
        mark("line", at | color | line, *valid, strokeWidth=1.6),
        mark("point", at | look | broken | TOOLTIP, *valid, filled=True, size=44, strokeWidth=1.2, cursor="crosshair"),
        mark("text", ended, chosen, SHOWN_ONLY, {"filter": "datum.ended"}, **cross),
    ]
    return points, layer


def _point(one: OperatingRange, light: str, row: Record, x: float) -> Chart:
    """The chart data of a row; metrics without a value are None."""
    broken, verdict, errors = failure(row), str(row["status"]), _errors(row)
    ended = broken is not None and verdict != "ok"
    if verdict == "ok":
        verdict = "in tolerance" if broken is None else f"out of tolerance: {broken}"
    tooltip = {
        "spec": one.spec,
        "light": light,
        "at": value_text(one.axis, row["axis_value"]),
        "scores": ", ".join(f"{name} {digits(value)}" for name, value in errors.items() if value is not None) or "none",
        "verdict": verdict,
    }
    return {
        "spec": one.spec,
        "light": light,
        "x": x,
        **errors,
        "tooltip": tooltip,
        "broken": broken is not None,
        "ended": ended,
    }


def _errors(row: Record) -> dict[str, float | None]:
    """The metrics in charts, by name; None without a value, or for shadows of the other kind."""
    values = row.get("metrics", {})
    judged = {name: values.get(name) for name in tolerances_of(values)}
    iou = judged.pop("iou", None)
    return dict.fromkeys(LIMITS) | judged | {ERROR: None if iou is None else 1 - iou}


def _places(values: Sequence[Value]) -> list[float]:
    """Coordinates of values, in the order of the axis: logarithmic if they span a decade, else at equal distances."""
    numbers = [float(value) for value in values if not isinstance(value, str)]
    if len(numbers) < len(values) or len(numbers) < 2 or min(numbers) <= 0 or max(numbers) < 10 * min(numbers):
        return [float(index) for index in range(len(values))]
    sign = 1.0 if numbers[0] < numbers[-1] else -1.0
    return [sign * round(math.log10(value), 9) for value in numbers]
