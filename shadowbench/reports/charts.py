"""Vega-Lite charts of a section, for the interactive page and for PNG figures."""

from collections.abc import Sequence

from shadowbench.reports.analysis import Section, front
from shadowbench.reports.axes import Chart, chart_point, error_axis, label_points, log_axis, tooltip, zero_error_rule
from shadowbench.reports.styles import COLORS, INK, MAX_SHOWN, Styles
from shadowbench.reports.words import digits, section_notes, time_source

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
    best = front(section)
    points = [{**chart_point(section, one), "front": one in best} for one in section.timed]
    if not points:
        return None
    label_points([point for point in points if point["front"]])
    title = f"frame time, ms{' (software renderer)' if section.run.software else ''}"
    x = {"field": "ms", "type": "quantitative", "title": title, **log_axis("x", [point["ms"] for point in points])}
    y = error_axis(section, [point["drawn"] for point in points])
    on_front, fields = [{"filter": "datum.front"}], tooltip(section)
    layer: list[Chart] = [
        *zero_error_rule(section, points),
        {
            "transform": on_front,
            "mark": {"type": "line", "interpolate": "step-after", "color": INK_SIGNAL, "strokeWidth": 2, "clip": True},
            "encoding": {"x": x, "y": y, "order": {"field": "ms"}},
        },
        {
            "transform": [{"filter": "datum.front && datum.shown === false"}],
            "mark": {"type": "point", "filled": True, "color": INK_SIGNAL, "size": 25, "clip": True},
            "encoding": {"x": x, "y": y, "tooltip": fields},
        },
        {
            "params": [_ZOOM],
            "transform": [SHOWN_ONLY],
            "mark": {"type": "point", "filled": True, "clip": True, "strokeWidth": 1.5, "cursor": "crosshair"},
            "encoding": {
                "x": x,
                "y": y,
                **styles.channels(one.spec for one in section.timed),
                "size": {"condition": {"test": "datum.front", "value": 140}, "value": 60},
                "stroke": {"condition": {"test": "datum.front", "value": INK_SIGNAL}, "value": None},
                "opacity": {"condition": {"test": "datum.front", "value": 1}, "value": 0.55},
                "tooltip": fields,
            },
        },
        {
            "transform": [*on_front, SHOWN_ONLY],
            "mark": {
                "type": "text",
                "align": {"expr": f"{_NO_ROOM} ? 'right' : 'left'"},
                "dx": {"expr": f"{_NO_ROOM} ? -8 : 8"},
                "dy": {"expr": f"{_NO_ROOM} ? 12 : -9"},
                "fontSize": 11,
                "color": INK_SIGNAL,
                "clip": True,
            },
            "encoding": {"x": x, "y": y, "text": {"field": "label"}},
        },
    ]
    return chart_of(f"Error against frame time in {section.title}; the line is the Pareto front", points, layer, 430)


def size_chart(section: Section, styles: Styles) -> Chart | None:
    """Error against map size, a line per spec, with confidence intervals over its cells; None without maps."""
    points = [chart_point(section, one) for one in section.scored]
    sizes = sorted({point["size"] for point in points if point["size"]})
    if not sizes:
        return None
    for index, point in enumerate(points):
        point["rank"] = sum(one["drawn"] == point["drawn"] for one in points[:index] if not one["size"])
    y = error_axis(section, [value for point in points for value in (point["drawn"], point["low"], point["high"])])
    x = {
        "field": "size",
        "type": "quantitative",
        "title": "map size, texels a side",
        "scale": {"type": "log", "base": 2, "domain": [sizes[0] / 1.15, sizes[-1] * 1.15], "nice": False},
        "axis": {"values": sizes, "format": "d"},
    }
    channels = styles.channels(point["spec"] for point in points)
    color = channels["color"]
    mapped, unmapped = [{"filter": "datum.size"}, SHOWN_ONLY], [{"filter": "!datum.size"}, SHOWN_ONLY]
    fields = tooltip(section)
    layer: list[Chart] = [
        *zero_error_rule(section, points),
        {
            "transform": unmapped,
            "mark": {"type": "rule", "strokeDash": [6, 4], "strokeWidth": 2},
            "encoding": {"y": y, "color": color, "tooltip": fields},
        },
        {
            "transform": unmapped,
            "mark": {
                "type": "text",
                "align": "right",
                "dx": {"expr": "-4 - 96 * datum.rank"},
                "dy": -7,
                "fontSize": 11,
            },
            "encoding": {"x": {"value": {"expr": "width"}}, "y": y, "text": {"field": "spec"}, "color": color},
        },
        {
            "transform": mapped,
            "mark": {"type": "line", "strokeWidth": 1.8},
            "encoding": {"x": x, "y": y, "color": color, "detail": {"field": "spec"}},
        },
        {
            "transform": mapped,
            "mark": {"type": "rule", "strokeWidth": 1.5},
            "encoding": {"x": x, "y": {**y, "field": "low"}, "y2": {"field": "high"}, "color": color},
        },
        {
            "transform": mapped,
            "mark": {"type": "point", "filled": True, "size": 70},
            "encoding": {"x": x, "y": y, **channels, "tooltip": fields},
        },
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
    x = {"field": "ms", "type": "quantitative", "title": _PASS_TIMES}
    first = [{"filter": "datum.first"}, SHOWN_ONLY]
    layer: list[Chart] = [
        {
            "transform": [SHOWN_ONLY],
            "mark": {"type": "bar", "stroke": PAPER_SIGNAL, "strokeWidth": 0.8},
            "encoding": {
                "y": y,
                "x": {**x, "stack": "zero"},
                "order": {"field": "rank"},
                "color": {
                    "field": "pass",
                    "title": None,
                    "scale": {"domain": names, "range": colors},
                    "legend": {"orient": "top", "columns": {"expr": "max(2, floor(width / 110))"}},
                },
                "tooltip": [{"field": name} for name in ("spec", "pass", "time", "redrawn", "whole frame")],
            },
        },
        {
            "transform": first,
            "mark": {
                "type": "tick",
                "color": INK_SIGNAL,
                "thickness": 3,
                "bandSize": 20,
                "stroke": PAPER_SIGNAL,
                "opacity": 1,
            },
            "encoding": {"y": y, "x": {"field": "frame", "type": "quantitative"}},
        },
        {
            "transform": first,
            "mark": {
                "type": "text",
                "align": "left",
                "baseline": "bottom",
                "yOffset": -10,
                "color": INK_SIGNAL,
                "fontSize": 11,
            },
            "encoding": {"y": y, "x": {"datum": 0}, "text": {"field": "spec"}},
        },
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
