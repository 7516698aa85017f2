"""Vega-Lite charts of a sweep's metrics along an axis, a line for each spec and kind of light."""

import json
import math
from collections.abc import Sequence

from shadowbench.extremes.model import NAMES, Axis, Value, value_label
from shadowbench.measure.flips import row_metrics
from shadowbench.measure.rows import Record
from shadowbench.reports.axes import Chart, mark, quantity
from shadowbench.reports.charts import BASE_CHART, INK_SIGNAL, PARAMS, SHOWN_ONLY, chart_of
from shadowbench.reports.stability import Stability
from shadowbench.reports.styles import Styles
from shadowbench.reports.words import digits
from shadowbench.results.ranges import TOLERANCES, OperatingRange, failure, tolerances_of, value_text
from shadowbench.scenes.model import LightKind

ERROR = "1 − IoU"
LIMITS: dict[str, float] = {ERROR: round(1 - TOLERANCES["iou"], 9)} | {
    name: limit for name, limit in TOLERANCES.items() if name != "iou"
}
"""The metrics in charts along axes, all of them errors, with the largest value of each that is in tolerance."""
ALL_LIGHTS = "all"
_DASHES: dict[LightKind, list[int]] = {"directional": [1, 0], "spot": [7, 4], "point": [2, 3]}


def axis_chart(found: Stability, axis: Axis, styles: Styles) -> Chart:
    """The chart of one metric along an axis; the page sets its signals `metric` and `light`."""
    chart = chart_of(f"Metrics along {axis.name}, {found.sweep.label}", *_along(found, axis, styles, "metric"), 230)
    signals = [{"name": "metric", "value": ERROR}, {"name": "light", "value": ALL_LIGHTS}]
    return {**chart, "params": [*chart["params"], *signals]}


def axis_figure(found: Stability, axis: Axis, styles: Styles) -> Chart:
    """A figure of all metrics along an axis, in panels one below the other."""
    panels = []
    for name in metrics_along(found, axis):
        values, layer = _along(found, axis, styles, f"'{name}'")
        title = {"text": name, "anchor": "start"}
        panels.append({"width": 760, "height": 190, "title": title, "data": {"values": values}, "layer": layer})
    params = [*PARAMS, {"name": "light", "value": ALL_LIGHTS}]
    return {**BASE_CHART, "description": f"Metrics along {axis.name}", "params": params, "vconcat": panels}


def metrics_along(found: Stability, axis: Axis) -> list[str]:
    """The metrics that have a value anywhere on an axis."""
    rows = [row for one in found.ranges if one.axis is axis for row in found.rows_of(one)]
    return [name for name in LIMITS if any(_errors(row)[name] is not None for row in rows)]


def _along(found: Stability, axis: Axis, styles: Styles, metric: str) -> tuple[list[Chart], list[Chart]]:
    """The data and layers of one panel; metric: Vega expression of the metric's name."""
    ranges = [
        (kind, found.range_at[spec, axis.name, kind])
        for spec, kind in found.series
        if (spec, axis.name, kind) in found.range_at
    ]
    swept = [value for value in axis.values if any(value in one.swept for _, one in ranges)]
    positions = _positions(axis, swept)
    points = [
        _point(one, NAMES[kind], row, positions[row["axis_value"]])
        for kind, one in ranges
        for row in found.rows_of(one)
    ]
    channels = styles.channels(one.spec for _, one in ranges)
    places, labels = list(positions.values()), json.dumps([value_label(value) for value in swept], ensure_ascii=False)
    x = quantity(
        "x",
        f"{axis.name}{f', {axis.unit}' if axis.unit else ''}; default: {value_label(axis.default)}",
        scale={"domain": [min(places), max(places)], "nice": False, "zero": False, "padding": 12},
        axis={
            "values": places,
            "labelExpr": f"{labels}[indexof({json.dumps(places)}, datum.value)]",
            "labelOverlap": "greedy",
            "grid": True,
        },
    )
    scale = {"type": "symlog", "constant": 1e-4, "domain": [0, 1], "nice": False}
    y = quantity("y", None, scale=scale, axis={"values": [0, 1e-4, 1e-3, 1e-2, 1e-1, 1], "format": ".2~%"})
    dash = {
        "field": "light",
        "title": None,
        "legend": {"orient": "bottom", "symbolType": "stroke"} if styles.legend else None,
        "scale": {"domain": list(NAMES.values()), "range": [_DASHES[kind] for kind in NAMES]},
    }
    light_filter = {"filter": f"light == '{ALL_LIGHTS}' || datum.light == light"}
    valid = [light_filter, SHOWN_ONLY, {"calculate": f"datum[{metric}]", "as": "y"}, {"filter": "isValid(datum.y)"}]
    tooltip = [{"field": name} for name in ("spec", "light", "at", "scores", "verdict")]
    limit = {"data": {"values": [LIMITS]}, "transform": [{"calculate": f"datum[{metric}]", "as": "y"}]}
    label = {"x": {"value": 0}, "y": y, "text": {"value": "tolerance"}}
    line = {"strokeDash": dash, "detail": [{"field": "spec"}, {"field": "light"}], "order": {"field": "x"}}
    broken = {"condition": {"test": "datum.broken", "value": INK_SIGNAL}, "value": None}
    point = {"filled": True, "size": 44, "strokeWidth": 1.2, "cursor": "crosshair"}
    at, color, ended = {"x": x, "y": y}, {"color": channels["color"]}, {"filter": "datum.ended"}
    cross = {"text": "✕", "fontSize": 14, "fontWeight": "bold", "cursor": "crosshair"}
    layer: list[Chart] = [
        {**limit, **mark("rule", {"y": y}, color=INK_SIGNAL, strokeDash=[2, 2])},
        {**limit, **mark("text", label, align="left", dx=3, dy=-6, fontSize=10.5, color=INK_SIGNAL)},
        mark("line", {**at, **color, **line}, *valid, strokeWidth=1.6),
        mark("point", {**at, **channels, "stroke": broken, "tooltip": tooltip}, *valid, **point),
        mark(
            "text", {"x": x, "y": {"value": 7}, **color, "tooltip": tooltip}, light_filter, SHOWN_ONLY, ended, **cross
        ),
    ]
    return points, layer


def _point(one: OperatingRange, light: str, row: Record, x: float) -> Chart:
    """The chart data of a row; metrics without a value are None."""
    broken, status = failure(row), str(row["status"])
    errors = _errors(row)
    if status == "ok":
        verdict = "in tolerance" if broken is None else f"out of tolerance: {broken}"
        scores = ", ".join(f"{name} {digits(value)}" for name, value in errors.items() if value is not None)
    else:
        verdict, scores = status, "none"
    return {
        "spec": one.spec,
        "light": light,
        "at": value_text(one.axis, row["axis_value"]),
        "x": x,
        **errors,
        "scores": scores,
        "verdict": verdict,
        "broken": broken is not None,
        "ended": broken is not None and status != "ok",
    }


def _errors(row: Record) -> dict[str, float | None]:
    """The metrics in charts, by name; None without a value, or for shadows of the other kind."""
    values = row_metrics(row)
    judged = {name: values.get(name) for name in tolerances_of(values)}
    iou = judged.pop("iou", None)
    return dict.fromkeys(LIMITS) | judged | {ERROR: None if iou is None else 1 - iou}


def _positions(axis: Axis, values: Sequence[Value]) -> dict[Value, float]:
    """Coordinates of values, in the order of the axis: logarithmic if they span a decade, else at equal distances."""
    numbers = [float(value) for value in values if not isinstance(value, str)]
    if len(numbers) < len(values) or len(numbers) < 2 or min(numbers) <= 0 or max(numbers) < 10 * min(numbers):
        return {value: float(index) for index, value in enumerate(values)}
    sign = 1.0 if numbers[0] < numbers[-1] else -1.0
    return {value: sign * round(math.log10(float(value)), 9) for value in values}
