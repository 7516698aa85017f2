"""Vega-Lite charts of a summary, for the interactive page and for figures, in one style."""

import io
import json
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

from PIL import Image

from shadowbench.errors import module_of_extra
from shadowbench.files import replace_file
from shadowbench.plugin.registry import preset_names
from shadowbench.reports.texts import COLUMNS, cost_text, digits, error_text, value_text
from shadowbench.results.summary import Setting, Summary, known
from shadowbench.techniques.unshadowed import Unshadowed

Chart = dict[str, Any]
Styles = dict[str, tuple[str, str]]
"""Colour and shape of each spec, in the order of the legend."""

# Okabe & Ito 2008, "Color Universal Design", without black and yellow, which is too faint on white, and ten more with
# L* from 36 to 84, as far apart as possible by CIEDE2000; the first eight are also visible on black.
COLORS = (
    *("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#8976FF", "#898989"),
    *("#8900C4", "#626200", "#B1D83B", "#B1003B", "#FFB19D", "#006262", "#D8C4FF", "#9DD8C4"),
)
# SVG paths of Vega's point shapes, within ±6.
OUTLINES = {
    "circle": "M6,0A6,6 0 1 1 -6,0A6,6 0 1 1 6,0",
    "square": "M-5,-5H5V5H-5Z",
    "triangle-up": "M0,-6L6,5H-6Z",
    "diamond": "M0,-6.5L5,0L0,6.5L-5,0Z",
    "cross": "M-6,-2H-2V-6H2V-2H6V2H2V6H-2V2H-6Z",
    "triangle-down": "M0,6L6,-5H-6Z",
    "triangle-right": "M6,0L-5,6V-6Z",
    "triangle-left": "M-6,0L5,6V-6Z",
}
SHAPES = tuple(OUTLINES)
MAX_SHOWN = 8
"""Number of specs that the charts of a page show at a time, each with a unique colour and shape."""

INK, PAPER = {"expr": "ink"}, {"expr": "paper"}  # signals, which the page sets to the colours of its theme
PARAMS: list[Chart] = [{"name": "ink", "value": "#1a1a1a"}, {"name": "paper", "value": "white"}]
SHOWN_ONLY = {"filter": "datum.shown !== false"}  # the page shows only some specs at a time
TOOLTIP = {"tooltip": {"field": "tooltip"}, "description": {"field": "spec"}}
"""Channels of a mark whose data have texts, by name, in `tooltip`."""
BASE_CHART: Chart = {
    "$schema": "https://vega.github.io/schema/vega-lite/v6.json",
    "params": PARAMS,
    "config": {
        "background": "white",
        "font": "sans-serif",
        "axis": {"gridColor": "#e6e6e6", "labelFontSize": 12, "titleFontSize": 12, "titleFontWeight": "normal"},
        "legend": {"labelFontSize": 12},
        "view": {"stroke": None},
    },
}
_LEGEND = {
    "orient": "bottom",
    "columns": 2,
    "columnPadding": 30,
    "labelLimit": 300,
    "symbolOpacity": 1,
    "symbolSize": 80,
}


def chart_of(about: str, values: Iterable[Chart], layer: Iterable[Chart], height: int | Chart) -> Chart:
    """A layered chart in the common style; about: alternative text; height: in pixels, or of a row."""
    size = {"width": "container", "height": height, "autosize": {"type": "fit-x", "contains": "padding"}}
    return {**BASE_CHART, "description": about, **size, "data": {"values": list(values)}, "layer": list(layer)}


def titled(chart: Chart, title: str, *subtitle: str, width: int | None = 760) -> Chart:
    """A chart as a standalone figure; width: None for a chart whose panels have widths."""
    heading = {"text": title, "subtitle": subtitle, "anchor": "start", "offset": 10}
    sized = {} if width is None else {"width": width}
    return {**chart, **sized, "autosize": "pad", "padding": 12, "title": heading}


def mark(kind: str, encoding: Chart, *where: Chart, **style: Any) -> Chart:
    """A layer of marks of one kind and style; where: transforms that choose its data."""
    return {**({"transform": list(where)} if where else {}), "mark": {"type": kind, **style}, "encoding": encoding}


def quantity(field: str, title: str | Sequence[str] | None, **more: Any) -> Chart:
    """A channel of numbers."""
    return {"field": field, "type": "quantitative", "title": title, **more}


def log_axis(channel: str, values: Sequence[float]) -> Chart:
    """A logarithmic scale and axis with a margin."""
    domain = [min(values) / (1.3 if channel == "x" else 2.4), max(values) * 1.8]
    scale = {"type": "log", "domain": domain, "nice": False}
    return {"scale": scale, "axis": {"grid": True, "format": ".6~r", "tickCount": 5, "labelOverlap": "greedy"}}


def chart_point(summary: Summary, one: Setting) -> Chart:
    """The chart data of a scored setting: coordinates, and the texts of its tooltip."""
    cost = one.cost / (1e6 if summary.cost == "work_cost" else 1) if known(one.cost) else None
    if summary.cost == "frame_ms" and cost is not None:
        spread = f"IQR {f'{digits(one.frame_iqr_ms)} ms' if known(one.frame_iqr_ms) else 'unknown'}"
        time = f"{digits(cost)} ms, {spread}{'; rough' if one.rough else ''}"
        costs = {"time": time, "× reference": value_text(one, "ratio")}
    else:
        costs = {"cost": cost_text(summary, one) if summary.cost != "map_size" else "not timed"}
    tooltip = {
        "spec": one.spec,
        "full spec": one.full_spec,
        "map": str(one.map_size) if one.map_size else one.technique,
        summary.ranked_by.error_label: error_text(summary, one),
        "IoU": f"{one.iou:.6g}" if known(one.iou) else "–",
        **{title: value_text(one, name) for title, name in COLUMNS[summary.soft].items() if name != "iou"},
        **costs,
        "cells": one.cells,
        "phases": one.phases,
    }
    ends = {"drawn": one.error, "low": one.low, "high": one.high}
    place = {"spec": one.spec, "name": one.name, "size": one.map_size, "error": one.error, "cost": cost}
    least = {name: max(end if known(end) else one.error, summary.least_error) for name, end in ends.items()}
    return {**place, **least, "tooltip": tooltip}


def styles_of(specs: Iterable[str]) -> Styles:
    """Looks of specs, in the order of the legend: first one of each technique, then the others, `unshadowed` last."""
    every = list(dict.fromkeys(specs))
    first = {spec.partition(":")[0]: spec for spec in reversed(every)}.values()
    order = sorted(every, key=lambda spec: (spec == Unshadowed.name, spec not in first))
    colors = len(COLORS)  # where they repeat, shapes move on by one
    return {
        spec: (COLORS[index % colors], SHAPES[(index + index // colors) % len(SHAPES)])
        for index, spec in enumerate(order)
    }


def looks(styles: Styles | None, shown: Iterable[str]) -> Chart:
    """The channels of colour and shape, with a legend of the specs that a chart shows.

    styles: None on a page, whose script adds `color`, `shape` and `shown` to each point, by its common legend.
    """
    if styles is None:
        return {channel: {"field": channel, "type": "nominal", "scale": None} for channel in ("color", "shape")}
    wanted = set(shown)
    used = {spec: look for spec, look in styles.items() if spec in wanted}
    named = {spec: name for spec, name in preset_names().items() if spec in used}
    legend = {**_LEGEND, "labelExpr": f"({json.dumps(named)})[datum.label] || datum.label"}
    return {
        channel: {
            "field": "spec",
            "title": None,
            "legend": legend,
            "scale": {"domain": list(used), "range": [look[at] for look in used.values()]},
        }
        for at, channel in enumerate(("color", "shape"))
    }


# The charts of a summary

_BAR = 36  # height in pixels
_PASS_TIMES = [
    "ms; passes are timed separately,",
    "each finished before the next,",
    "so that their sum may exceed the frame;",
    "tick: the whole frame, timed separately",
]
_CHANGES = {"light": "when the light moves", "view": "when light or camera moves", "frame": "every frame"}
# A label at the right edge goes below its point and to the left, where a Pareto front has no other.
_NO_ROOM = "scale('x', datum.cost) + 8 + 6.5 * length(datum.label) > width"


def front_chart(summary: Summary, styles: Styles | None) -> Chart | None:
    """Error against cost of all settings, with the Pareto front emphasised; None without costs.

    Its axis has no zero, so that `unshadowed`, whose predicted time is none, is left out.
    """
    points = [{**chart_point(summary, one), "front": bool(one.front)} for one in summary.shown if one.cost > 0]
    if not points:
        return None
    _label(sorted((point for point in points if point["front"]), key=lambda point: point["cost"]))
    titles = {"predicted_ms": f"ms predicted for {summary.device}", "work_cost": "work, M"}
    title = titles.get(summary.cost, f"frame time, ms{' (software renderer)' if summary.run.software else ''}")
    x = quantity("cost", title, **log_axis("x", [point["cost"] for point in points]))
    at = {"x": x, "y": _error_axis(summary, [point["drawn"] for point in points])}
    on_front, hidden = {"filter": "datum.front"}, {"filter": "datum.front && datum.shown === false"}
    look = looks(styles, (point["spec"] for point in points)) | {
        channel: {"condition": {"test": "datum.front", "value": best}, "value": other}
        for channel, best, other in (("size", 140, 60), ("stroke", INK, None), ("opacity", 1, 0.55))
    }
    label = {
        channel: {"expr": f"{_NO_ROOM} ? {left} : {right}"}
        for channel, left, right in (("align", "'right'", "'left'"), ("dx", -8, 8), ("dy", 12, -9))
    }
    line = {"interpolate": "step-after", "color": INK, "strokeWidth": 2, "clip": True}
    point = {"filled": True, "clip": True, "strokeWidth": 1.5, "cursor": "crosshair"}
    named = {**at, "text": {"field": "label"}}
    layer: list[Chart] = [
        *_zero_error_rule(summary, points),
        mark("line", {**at, "order": {"field": "cost"}}, on_front, **line),
        mark("point", at | TOOLTIP, hidden, filled=True, color=INK, size=25, clip=True),
        mark("point", at | look | TOOLTIP, SHOWN_ONLY, **point),
        mark("text", named, on_front, SHOWN_ONLY, **label, fontSize=11, color=INK, clip=True),
    ]
    return chart_of(f"Error against cost in {summary.title}; the line is the Pareto front", points, layer, 430)


def _label(front: Sequence[Chart]) -> None:
    """Label the points of a Pareto front, by increasing cost, except where one would overlap the previous label."""
    last: Chart | None = None
    for point in front:
        near = last is not None and point["cost"] < 1.2 * last["cost"] and point["drawn"] > 0.6 * last["drawn"]
        point["label"] = "" if near else point["tooltip"]["map"]
        last = last if near else point


def _error_axis(summary: Summary, values: Sequence[float]) -> Chart:
    """The y channel of an error chart; values: all errors drawn."""
    about = "root mean square error of visibility" if summary.soft else "share of the shadow that is wrong"
    return quantity("drawn", f"{summary.ranked_by.error_label}: {about}", **log_axis("y", values))


def _zero_error_rule(summary: Summary, points: Sequence[Chart]) -> list[Chart]:
    """The labelled line at which an error of 0, or one below the truth's own, is drawn; empty if no point has one."""
    least = summary.least_error
    if not any(point["error"] < least if summary.soft else point["error"] == 0 for point in points):
        return []
    y = {"datum": least, "type": "quantitative"}
    what = "below the truth's own error, drawn at it" if summary.soft else "no wrong pixel: drawn at half a pixel"
    label = {"x": {"value": 0}, "y": y, "text": {"value": f"{what} ({digits(least)})"}}
    layers = [
        mark("rule", {"y": y}, color="#767676", strokeDash=[2, 3], clip=True),
        mark("text", label, align="left", dx=4, dy=9, fontSize=11, color=INK, opacity=0.75, clip=True),
    ]
    return [{"data": {"values": [{}]}, **layer} for layer in layers]


def size_chart(summary: Summary, styles: Styles | None) -> Chart | None:
    """Error against map size, a line per spec, with confidence intervals over its cells; None without maps."""
    points = [chart_point(summary, one) for one in summary.shown]
    sizes = sorted({point["size"] for point in points if point["size"]})
    if not sizes:
        return None
    for index, point in enumerate(points):
        point["rank"] = sum(one["drawn"] == point["drawn"] for one in points[:index] if not one["size"])
    y = _error_axis(summary, [point[end] for point in points for end in ("drawn", "low", "high")])
    scale = {"type": "log", "base": 2, "domain": [sizes[0] / 1.15, sizes[-1] * 1.15], "nice": False}
    x = quantity("size", "map size, texels a side", scale=scale, axis={"values": sizes, "format": "d"})
    look = looks(styles, (point["spec"] for point in points))
    color, at = {"color": look["color"]}, {"x": x, "y": y}
    mapped, unmapped = ({"filter": "datum.size"}, SHOWN_ONLY), ({"filter": "!datum.size"}, SHOWN_ONLY)
    interval = {"x": x, "y": {**y, "field": "low"}, "y2": {"field": "high"}}
    name = {"x": {"value": {"expr": "width"}}, "y": y, "text": {"field": "name"}}
    aside = {"expr": "-4 - 96 * datum.rank"}
    layer: list[Chart] = [
        *_zero_error_rule(summary, points),
        mark("rule", {"y": y} | color | TOOLTIP, *unmapped, strokeDash=[6, 4], strokeWidth=2),
        mark("text", name | color, *unmapped, align="right", dx=aside, dy=-7, fontSize=11),
        mark("line", at | color | {"detail": {"field": "spec"}}, *mapped, strokeWidth=1.8),
        mark("rule", interval | color, *mapped, strokeWidth=1.5),
        mark("point", at | look | TOOLTIP, *mapped, filled=True, size=70),
    ]
    return chart_of(f"Error against map size in {summary.title}", points, layer, 400)


def pass_chart(summary: Summary) -> Chart | None:
    """Stacked bars of the pass times of specs at the median map size and of those without a map; None without times.

    Passes are stacked in the order in which they are drawn.
    """
    sizes = sorted({one.map_size for one in summary.shown if one.map_size and known(one.cost)})
    size = sizes[(len(sizes) - 1) // 2] if sizes else None
    passes = {one.Index: summary.passes(one) for one in summary.timed}
    shown = [one for one in summary.timed if passes[one.Index] and one.map_size in (None, size)]
    if not shown:
        return None
    bars: list[Chart] = []
    for row, one in enumerate(sorted(shown, key=lambda one: one.frame_ms)):
        for rank, (name, ms, changes) in enumerate(passes[one.Index]):
            tooltip = {
                "spec": one.spec,
                "pass": name,
                "time": f"{digits(ms)} ms",
                "redrawn": _CHANGES.get(changes, changes),
                "whole frame": f"{digits(one.frame_ms)} ms",
            }
            place = {"spec": one.spec, "name": one.name, "pass": name, "row": row, "rank": rank}
            bars.append({**place, "ms": ms, "frame": one.frame_ms, "tooltip": tooltip})
    names = list(dict.fromkeys(name for every in passes.values() for name, _, _ in every))
    # The first of them belong to specs on every other chart of the page.
    own = (*COLORS[MAX_SHOWN:], *COLORS[:MAX_SHOWN])
    color = {
        "field": "pass",
        "title": None,
        "scale": {"domain": names, "range": [own[index % len(own)] for index in range(len(names))]},
        "legend": {"orient": "top", "columns": {"expr": "max(2, floor(width / 110))"}},
    }
    y = {"field": "row", "type": "ordinal", "axis": None, "scale": {"paddingInner": 0.55, "paddingOuter": 0.4}}
    stacked = {"y": y, "x": quantity("ms", _PASS_TIMES, stack="zero"), "order": {"field": "rank"}, "color": color}
    whole = {"y": y, "x": {"field": "frame", "type": "quantitative"}}
    named = {"y": y, "x": {"datum": 0}, "text": {"field": "name"}}
    first = {"filter": "datum.rank == 0"}, SHOWN_ONLY
    above = {"align": "left", "baseline": "bottom", "yOffset": -10, "color": INK, "fontSize": 11}
    layer: list[Chart] = [
        mark("bar", stacked | TOOLTIP, SHOWN_ONLY, stroke=PAPER, strokeWidth=0.8),
        mark("tick", whole, *first, color=INK, thickness=3, bandSize=20, stroke=PAPER, opacity=1),
        mark("text", named, *first, **above),
    ]
    at_size = f"map size {size}" if size else "no maps"
    return chart_of(f"Time of each pass in {summary.title}, {at_size}", bars, layer, {"step": _BAR})


# Files

_SCALE = 2.5  # 760 units of width become 1900 pixels: 16 cm at 300 dots an inch


def write_chart(file: Path, chart: Chart) -> None:
    """Write a Vega-Lite chart as .svg or .pdf, else as PNG. Raises InputError without the extra `figures`."""
    vl_convert = module_of_extra("vl_convert", "figures", "charts outside the page are drawn by")
    with replace_file(file) as temporary:
        if file.suffix == ".svg":
            temporary.write_text(vl_convert.vegalite_to_svg(chart), encoding="utf-8")
        elif file.suffix == ".pdf":
            temporary.write_bytes(vl_convert.vegalite_to_pdf(chart))
        else:
            with Image.open(io.BytesIO(vl_convert.vegalite_to_png(chart, scale=_SCALE))) as image:
                # Without transparency and better compressed, about a fifth of the size.
                image.convert("RGB").save(temporary, format="PNG", optimize=True, dpi=(72 * _SCALE, 72 * _SCALE))
