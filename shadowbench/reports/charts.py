"""The charts of a section as Vega-Lite: one description for the page, where it is alive, and for the PNG of a paper."""

from collections.abc import Sequence

from shadowbench.reports.analysis import Section, front
from shadowbench.reports.axes import Chart, error_axis, label, log_axis, point_of, zero_rule
from shadowbench.reports.styles import COLORS, INK, Styles
from shadowbench.reports.words import digits, section_notes, times_are

_GRID = "#e6e6e6"
_BAR = 36
_PASS_TIMES = [
    "ms of passes timed one by one,",
    "each finished before the next,",
    "so that their sum may exceed the frame;",
    "tick: the whole frame, timed apart",
]
_TOOLTIP = [
    "spec",
    "full spec",
    "map",
    "1 − IoU",
    "IoU",
    "edge px",
    "SSIM",
    "acne",
    "leak",
    "time",
    "× reference",
    "cells",
    "phases",
]


def front_chart(section: Section, styles: Styles) -> Chart | None:
    """Error against time: every configuration faint, the Pareto front bold; None where nothing was timed."""
    best = front(section)
    points = [{**point_of(section, one), "front": one in best} for one in section.timed]
    if not points:
        return None
    label([point for point in points if point["front"]])
    title = f"frame time, ms{' (software renderer)' if section.run.software else ''}"
    x = {"field": "ms", "type": "quantitative", "title": title, **log_axis("x", [point["ms"] for point in points])}
    y = error_axis([point["drawn"] for point in points])
    on_front, told = [{"filter": "datum.front"}], [{"field": name} for name in _TOOLTIP]
    layer: list[Chart] = [
        *zero_rule(section, points),
        {
            "transform": on_front,
            "mark": {"type": "line", "interpolate": "step-after", "color": INK_NOW, "strokeWidth": 2, "clip": True},
            "encoding": {"x": x, "y": y, "order": {"field": "ms"}},
        },
        {
            "transform": [{"filter": "datum.front && datum.shown === false"}],
            "mark": {"type": "point", "filled": True, "color": INK_NOW, "size": 25, "clip": True},
            "encoding": {"x": x, "y": y, "tooltip": told},
        },
        {
            "params": [_ZOOM],
            "transform": [SHOWN],
            "mark": {"type": "point", "filled": True, "clip": True, "strokeWidth": 1.5, "cursor": "crosshair"},
            "encoding": {
                "x": x,
                "y": y,
                **styles.channels(one.spec for one in section.timed),
                "size": {"condition": {"test": "datum.front", "value": 140}, "value": 60},
                "stroke": {"condition": {"test": "datum.front", "value": INK_NOW}, "value": None},
                "opacity": {"condition": {"test": "datum.front", "value": 1}, "value": 0.55},
                "tooltip": told,
            },
        },
        {
            "transform": [*on_front, SHOWN],
            "mark": {
                "type": "text",
                "align": "left",
                "dx": 8,
                "dy": -9,
                "fontSize": 11,
                "color": INK_NOW,
                "clip": True,
            },
            "encoding": {"x": x, "y": y, "text": {"field": "label"}},
        },
    ]
    return chart_of(f"Error against frame time in {section.title}; the line is the Pareto front", points, layer, 430)


def size_chart(section: Section, styles: Styles) -> Chart | None:
    """Error against map size, a line for each spec, with intervals where it has several cells; None without maps."""
    points = [point_of(section, one) for one in section.held]
    sizes = sorted({point["size"] for point in points if point["size"]})
    if not sizes:
        return None
    for point in points:
        point["rank"] = sum(one["drawn"] == point["drawn"] for one in points[: points.index(point)] if not one["size"])
    y = error_axis([value for point in points for value in (point["drawn"], point["low"], point["high"])])
    x = {
        "field": "size",
        "type": "quantitative",
        "title": "map size, texels a side",
        "scale": {"type": "log", "base": 2, "domain": [sizes[0] / 1.15, sizes[-1] * 1.15], "nice": False},
        "axis": {"values": sizes, "format": "d"},
    }
    channels = styles.channels(point["spec"] for point in points)
    color = channels["color"]
    mapped, unmapped = [{"filter": "datum.size"}, SHOWN], [{"filter": "!datum.size"}, SHOWN]
    tooltip = [{"field": name} for name in _TOOLTIP]
    layer: list[Chart] = [
        *zero_rule(section, points),
        {
            "transform": unmapped,
            "mark": {"type": "rule", "strokeDash": [6, 4], "strokeWidth": 2},
            "encoding": {"y": y, "color": color, "tooltip": tooltip},
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
            "encoding": {"x": x, "y": y, **channels, "tooltip": tooltip},
        },
    ]
    return chart_of(f"Error against map size in {section.title}", points, layer, 400)


def pass_chart(section: Section, size: int | None) -> Chart | None:
    """The time of each pass of every spec at one map size or without a map; None where no pass was timed.

    Passes are stacked as their spec draws them, one after the other.
    """
    shown = sorted(
        (one for one in section.timed if one.passes and one.map_size in (None, size)),
        key=lambda one: one.value("frame_ms") or 0.0,
    )
    names = list(dict.fromkeys(made.name for one in section.timed for made in one.passes))
    if not shown:
        return None
    bars = [
        {
            "spec": one.spec,
            "row": row,
            "pass": made.name,
            "rank": rank,
            "ms": made.ms,
            "time": f"{digits(made.ms)} ms",
            "again": _CHANGES.get(made.changes, made.changes),
            "frame": one.value("frame_ms"),
            "whole": f"{digits(one.value('frame_ms') or 0)} ms",
            "first": made is one.passes[0],
        }
        for row, one in enumerate(shown)
        for rank, made in enumerate(one.passes)
    ]
    marks = [COLORS[index % len(COLORS)] for index in range(len(names))]
    y = {"field": "row", "type": "ordinal", "axis": None, "scale": {"paddingInner": 0.55, "paddingOuter": 0.4}}
    where = f"map size {size}" if size else "no maps"
    x = {"field": "ms", "type": "quantitative", "title": _PASS_TIMES}
    first = [{"filter": "datum.first"}, SHOWN]
    layer: list[Chart] = [
        {
            "transform": [SHOWN],
            "mark": {"type": "bar", "stroke": PAPER_NOW, "strokeWidth": 0.8},
            "encoding": {
                "y": y,
                "x": {**x, "stack": "zero"},
                "order": {"field": "rank"},
                "color": {
                    "field": "pass",
                    "title": None,
                    "scale": {"domain": names, "range": marks},
                    "legend": {"orient": "top", "columns": {"expr": "max(2, floor(width / 110))"}},
                },
                "tooltip": [{"field": name} for name in ("spec", "pass", "time", "again", "whole")],
            },
        },
        {
            "transform": first,
            "mark": {
                "type": "tick",
                "color": INK_NOW,
                "thickness": 3,
                "bandSize": 20,
                "stroke": PAPER_NOW,
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
                "color": INK_NOW,
                "fontSize": 11,
            },
            "encoding": {"y": y, "x": {"datum": 0}, "text": {"field": "spec"}},
        },
    ]
    made = chart_of(f"Time of each pass in {section.title}, {where}", bars, layer, _BAR * len(shown) + 12)
    return {**made, "usermeta": {"row": _BAR}}  # from which a page that shows fewer takes its height


def default_size(section: Section) -> int | None:
    """The map size that a chart of one size shows: the middle one, or the lesser of two; None without maps."""
    sizes = sorted({one.map_size for one in section.timed if one.map_size})
    return sizes[(len(sizes) - 1) // 2] if sizes else None


def figure(chart: Chart, section: Section) -> Chart:
    """The chart as it stands alone in a paper: with a title, and a width; its legend is in it."""
    return titled(chart, section.title, f"{section.run.renderer}; {times_are(section.run)}", *section_notes(section))


def titled(chart: Chart, title: str, *below: str, width: int | None = 760) -> Chart:
    """The chart with a title, lines below that, and a width; None for one whose panels have theirs."""
    head = {"text": title, "subtitle": below, "anchor": "start", "offset": 10}
    sized = {} if width is None else {"width": width}
    return {**chart, **sized, "autosize": "pad", "padding": 12, "title": head}


_CHANGES = {
    "light": "when the light moves",
    "view": "when light or camera moves",
    "frame": "every frame",
}
# A wheel alone scrolls the page, and so does a finger; the page has buttons for both.
_ZOOM = {
    "name": "zoom",
    "bind": "scales",
    "select": {
        "type": "interval",
        "zoom": "wheel![event.ctrlKey || event.shiftKey]",
        "translate": "[pointerdown[event.pointerType !== 'touch'], window:pointerup] > window:pointermove!",
    },
}
# A page in the dark sets these two.
INK_NOW, PAPER_NOW = {"expr": "ink"}, {"expr": "paper"}
# A page hides specs that are beyond what its charts hold.
SHOWN = {"filter": "datum.shown !== false"}

LOOK: Chart = {
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
    """What every chart has: a description for those who do not see it, a width that follows the page, one look."""
    return {
        **LOOK,
        "description": about,
        "width": "container",
        "height": height,
        "autosize": {"type": "fit-x", "contains": "padding"},
        "params": PARAMS,
        "data": {"values": list(values)},
        "layer": list(layer),
    }
