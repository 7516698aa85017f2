"""Vega-Lite charts of a section, for the interactive page and for PNG figures."""

from collections.abc import Sequence
from typing import Any

from shadowbench.reports.axes import (
    Chart,
    chart_point,
    error_axis,
    label_points,
    log_axis,
    mark,
    quantity,
    tooltip,
    tooltip_texts,
    zero_error_rule,
)
from shadowbench.reports.styles import COLORS, INK, MAX_SHOWN, Styles
from shadowbench.reports.words import digits, section_notes, time_source
from shadowbench.results.configurations import Configuration, Section
from shadowbench.results.curves import Curve, curves

_GRID = "#e6e6e6"
_BAR = 36
_PASS_TIMES = [
    "ms; passes are timed separately,",
    "each finished before the next,",
    "so that their sum may exceed the frame;",
    "tick: the whole frame, timed separately",
]


def front_chart(section: Section, styles: Styles) -> Chart | None:
    """Error against frame time of all configurations, with the Pareto front emphasised; None without times."""
    best = section.front
    points = [{**chart_point(section, one), "front": one in best} for one in section.timed]
    if not points:
        return None
    label_points([point for point in points if point["front"]])
    title = f"frame time, ms{' (software renderer)' if section.run.software else ''}"
    x = quantity("ms", title, **log_axis("x", [point["ms"] for point in points]))
    y = error_axis(section, [point["drawn"] for point in points])
    on_front, fields = {"filter": "datum.front"}, tooltip(section)
    label: Chart = {"align": {"expr": f"{_NO_ROOM} ? 'right' : 'left'"}, "dx": {"expr": f"{_NO_ROOM} ? -8 : 8"}}
    label |= {"dy": {"expr": f"{_NO_ROOM} ? 12 : -9"}, "fontSize": 11, "color": INK_SIGNAL, "clip": True}
    look = styles.channels(one.spec for one in section.timed) | {
        "size": _where_front(140, 60),
        "stroke": _where_front(INK_SIGNAL, None),
        "opacity": _where_front(1, 0.55),
    }
    line = {"interpolate": "step-after", "color": INK_SIGNAL, "strokeWidth": 2, "clip": True}
    point = {"filled": True, "clip": True, "strokeWidth": 1.5, "cursor": "crosshair"}
    at, hidden = {"x": x, "y": y}, {"filter": "datum.front && datum.shown === false"}
    layer: list[Chart] = [
        *zero_error_rule(section, points),
        mark("line", {**at, "order": {"field": "ms"}}, on_front, **line),
        mark("point", {**at, "tooltip": fields}, hidden, filled=True, color=INK_SIGNAL, size=25, clip=True),
        {"params": [_ZOOM], **mark("point", {**at, **look, "tooltip": fields}, SHOWN_ONLY, **point)},
        mark("text", {**at, "text": {"field": "label"}}, on_front, SHOWN_ONLY, **label),
    ]
    return chart_of(f"Error against frame time in {section.title}; the line is the Pareto front", points, layer, 430)


def _where_front(value: Any, other: Any) -> Chart:
    """A channel that has one value for points of the Pareto front, and another elsewhere."""
    return {"condition": {"test": "datum.front", "value": value}, "value": other}


def size_chart(section: Section, styles: Styles) -> Chart | None:
    """Error against map size, a line per spec, with confidence intervals over its cells; None without maps."""
    points = [chart_point(section, one) for one in section.scored]
    sizes = sorted({point["size"] for point in points if point["size"]})
    if not sizes:
        return None
    for index, point in enumerate(points):
        point["rank"] = sum(one["drawn"] == point["drawn"] for one in points[:index] if not one["size"])
    y = error_axis(section, [value for point in points for value in (point["drawn"], point["low"], point["high"])])
    scale = {"type": "log", "base": 2, "domain": [sizes[0] / 1.15, sizes[-1] * 1.15], "nice": False}
    x = quantity("size", "map size, texels a side", scale=scale, axis={"values": sizes, "format": "d"})
    channels = styles.channels(point["spec"] for point in points)
    color = channels["color"]
    mapped, unmapped = ({"filter": "datum.size"}, SHOWN_ONLY), ({"filter": "!datum.size"}, SHOWN_ONLY)
    fields, at, interval = tooltip(section), {"x": x, "y": y}, {"y": {**y, "field": "low"}, "y2": {"field": "high"}}
    name = {"x": {"value": {"expr": "width"}}, "y": y, "text": {"field": "spec"}, "color": color}
    aside = {"expr": "-4 - 96 * datum.rank"}
    layer: list[Chart] = [
        *zero_error_rule(section, points),
        mark("rule", {"y": y, "color": color, "tooltip": fields}, *unmapped, strokeDash=[6, 4], strokeWidth=2),
        mark("text", name, *unmapped, align="right", dx=aside, dy=-7, fontSize=11),
        mark("line", {**at, "color": color, "detail": {"field": "spec"}}, *mapped, strokeWidth=1.8),
        mark("rule", {"x": x, **interval, "color": color}, *mapped, strokeWidth=1.5),
        mark("point", {**at, **channels, "tooltip": fields}, *mapped, filled=True, size=70),
    ]
    return chart_of(f"Error against map size in {section.title}", points, layer, 400)


def pass_chart(section: Section, size: int | None) -> Chart | None:
    """Stacked bars of the pass times of specs at one map size and of those without a map; None without times.

    Passes are stacked in the order in which they are drawn.
    """
    shown = sorted(
        (one for one in section.timed if one.passes and one.map_size in (None, size)),
        key=lambda one: one.value("frame_ms") or 0.0,
    )
    names = list(dict.fromkeys(timed.name for one in section.timed for timed in one.passes))
    if not shown:
        return None
    bars = [
        {
            "spec": one.spec,
            "row": row,
            "pass": timed.name,
            "rank": rank,
            "ms": timed.ms,
            "time": f"{digits(timed.ms)} ms",
            "redrawn": _CHANGES.get(timed.changes, timed.changes),
            "frame": one.value("frame_ms"),
            "whole frame": f"{digits(one.value('frame_ms') or 0)} ms",
            "first": timed is one.passes[0],
        }
        for row, one in enumerate(shown)
        for rank, timed in enumerate(one.passes)
    ]
    # The first of them belong to specs on every other chart of the page.
    own = (*COLORS[MAX_SHOWN:], *COLORS[:MAX_SHOWN])
    colors = [own[index % len(own)] for index in range(len(names))]
    y = {"field": "row", "type": "ordinal", "axis": None, "scale": {"paddingInner": 0.55, "paddingOuter": 0.4}}
    at_size = f"map size {size}" if size else "no maps"
    x = quantity("ms", _PASS_TIMES)
    first = {"filter": "datum.first"}, SHOWN_ONLY
    color = {
        "field": "pass",
        "title": None,
        "scale": {"domain": names, "range": colors},
        "legend": {"orient": "top", "columns": {"expr": "max(2, floor(width / 110))"}},
    }
    stacked = {"y": y, "x": {**x, "stack": "zero"}, "order": {"field": "rank"}, "color": color}
    told = {"tooltip": [{"field": name} for name in ("spec", "pass", "time", "redrawn", "whole frame")]}
    whole, name = {"field": "frame", "type": "quantitative"}, {"x": {"datum": 0}, "text": {"field": "spec"}}
    tick = {"color": INK_SIGNAL, "thickness": 3, "bandSize": 20, "stroke": PAPER_SIGNAL, "opacity": 1}
    above = {"align": "left", "baseline": "bottom", "yOffset": -10, "color": INK_SIGNAL, "fontSize": 11}
    layer: list[Chart] = [
        mark("bar", stacked | told, SHOWN_ONLY, stroke=PAPER_SIGNAL, strokeWidth=0.8),
        mark("tick", {"y": y, "x": whole}, *first, **tick),
        mark("text", {"y": y, **name}, *first, **above),
    ]
    chart = chart_of(f"Time of each pass in {section.title}, {at_size}", bars, layer, _BAR * len(shown) + 12)
    return {**chart, "usermeta": {"row": _BAR}}  # the page scales the height by the number of rows shown


def default_size(section: Section) -> int | None:
    """The map size of charts that show one: the median size, rounded down; None without maps."""
    sizes = sorted({one.map_size for one in section.timed if one.map_size})
    return sizes[(len(sizes) - 1) // 2] if sizes else None


def section_figure(chart: Chart, section: Section) -> Chart:
    """A chart as a standalone figure, titled with the section, its renderer and its notes."""
    return titled(chart, section.title, f"{section.run.renderer}; {time_source(section.run)}", *section_notes(section))


def titled(chart: Chart, title: str, *subtitle: str, width: int | None = 760) -> Chart:
    """A chart with a title, subtitle lines and a width; None for a chart whose panels have widths."""
    heading = {"text": title, "subtitle": subtitle, "anchor": "start", "offset": 10}
    sized = {} if width is None else {"width": width}
    return {**chart, **sized, "autosize": "pad", "padding": 12, "title": heading}


_CHANGES = {
    "light": "when the light moves",
    "view": "when light or camera moves",
    "frame": "every frame",
}
# Wheel and touch alone scroll the page; the page has buttons for zoom and reset.
_ZOOM = {
    "name": "zoom",
    "bind": "scales",
    "select": {
        "type": "interval",
        "zoom": "wheel![event.ctrlKey || event.shiftKey]",
        "translate": "[pointerdown[event.pointerType !== 'touch'], window:pointerup] > window:pointermove!",
    },
}
# Signals that the page sets to the colours of its theme.
INK_SIGNAL, PAPER_SIGNAL = {"expr": "ink"}, {"expr": "paper"}
# A label at the right edge goes below its point and to the left, where a Pareto front has no other.
_NO_ROOM = "scale('x', datum.ms) + 8 + 6.5 * length(datum.label) > width"
# The page shows only some specs at a time.
SHOWN_ONLY = {"filter": "datum.shown !== false"}

BASE_CHART: Chart = {
    "$schema": "https://vega.github.io/schema/vega-lite/v6.json",
    "config": {
        "background": "white",
        "font": "sans-serif",
        "axis": {"gridColor": _GRID, "labelFontSize": 12, "titleFontSize": 12, "titleFontWeight": "normal"},
        "legend": {"labelFontSize": 12},
        "view": {"stroke": None},
    },
}
PARAMS: list[Chart] = [{"name": "ink", "value": INK}, {"name": "paper", "value": "white"}]


def chart_of(about: str, values: Sequence[Chart], layer: Sequence[Chart], height: int) -> Chart:
    """A layered chart in the common style; about: alternative text; values: its data; height: in pixels."""
    return {
        **BASE_CHART,
        "description": about,
        "width": "container",
        "height": height,
        "autosize": {"type": "fit-x", "contains": "padding"},
        "params": PARAMS,
        "data": {"values": list(values)},
        "layer": list(layer),
    }


_TICKS = (0.0, 0.001, 0.003, 0.01, 0.03, 0.1, 0.3, 1.0)
_LINEAR_BELOW = 1e-3  # the scale is linear below this share and logarithmic above, so that it includes 0


def bias_charts(section: Section) -> list[tuple[str, Chart]]:
    """Pairs of a swept spec and its chart; specs without values of acne and contact, and soft shadows, are left out."""
    found = curves(section.scored, section.run.sweep_positions)
    bases = dict.fromkeys(one.base for one in found)
    charts = [(base, _chart(section, base, [one for one in found if one.base == base])) for base in bases]
    return [(base, chart) for base, chart in charts if chart is not None]


def _chart(section: Section, base: str, found: list[Curve]) -> Chart | None:
    points = [point for curve in found for factor, one in curve.points if (point := _point(curve, factor, one))]
    if not points:
        return None
    maps = list(dict.fromkeys(point["map"] for point in points))
    x, y = _share(points, "x", "contact shadow lost (peter-panning)"), _share(points, "y", "acne")
    color = {
        "field": "map",
        "title": "map size",
        "scale": {"domain": maps, "range": [COLORS[at % len(COLORS)] for at in range(len(maps))]},
        "legend": {"orient": "top"} if len(maps) > 1 else None,
    }
    names = ("spec", "map", "× bias", "acne", "contact", section.ranked_by.error_label, "SSIM")
    tooltip = [{"field": name} for name in names]
    at = {"x": x, "y": y}
    best = {"condition": {"test": "datum.best", "value": INK_SIGNAL}, "value": None}
    point, label = {**at, "color": color, "stroke": best, "tooltip": tooltip}, {**at, "text": {"field": "× bias"}}
    layer: list[Chart] = [
        mark("line", {**at, "color": color, "order": {"field": "factor"}}, strokeWidth=1.5),
        mark("point", point, filled=True, size=70, strokeWidth=2),
        mark("text", label, align="left", dx=7, dy=-7, fontSize=11, color=INK_SIGNAL),
    ]
    return chart_of(f"Acne against contact of {base} in {section.title}", points, layer, 320)


def _point(curve: Curve, factor: float, one: Configuration) -> Chart | None:
    acne, contact = one.value("acne"), one.value("contact")
    if acne is None or contact is None or one.soft:
        return None
    return {
        **tooltip_texts(one),
        "acne": digits(acne),
        "contact": digits(contact),
        "× bias": f"×{factor:g}",
        "factor": factor,
        "best": factor == curve.best,
        "y": acne,
        "x": contact,
    }


def _share(points: list[Chart], field: str, title: str) -> Chart:
    most = max(point[field] for point in points)
    top = next((tick for tick in _TICKS if tick >= most and tick > _LINEAR_BELOW), 1.0)
    scale = {"type": "symlog", "constant": _LINEAR_BELOW, "domain": [0, top], "nice": False}
    axis = {"values": [tick for tick in _TICKS if tick <= top], "format": "~g", "grid": True}
    return quantity(field, title, scale=scale, axis=axis)
