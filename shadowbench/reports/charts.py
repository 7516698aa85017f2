"""Charts of a section, for the interactive page and for PNG figures."""

from collections.abc import Sequence
from itertools import pairwise

from shadowbench.reports.vega import (
    COLORS,
    INK,
    MAX_SHOWN,
    PAPER,
    SHOWN_ONLY,
    TOLD,
    Chart,
    Styles,
    chart_of,
    chart_point,
    log_axis,
    looks,
    mark,
    quantity,
)
from shadowbench.reports.words import digits
from shadowbench.results.configurations import Section
from shadowbench.results.curves import curves

_BAR = 36  # height in pixels
_PASS_TIMES = [
    "ms; passes are timed separately,",
    "each finished before the next,",
    "so that their sum may exceed the frame;",
    "tick: the whole frame, timed separately",
]
_LEAST_SHARE = 1e-3  # axes of shares are linear below, so as to include 0, and logarithmic above
_SHARES = (0.0, _LEAST_SHARE, 0.003, 0.01, 0.03, 0.1, 0.3, 1.0)
_CHANGES = {"light": "when the light moves", "view": "when light or camera moves", "frame": "every frame"}
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
# A label at the right edge goes below its point and to the left, where a Pareto front has no other.
_NO_ROOM = "scale('x', datum.cost) + 8 + 6.5 * length(datum.label) > width"


def front_chart(section: Section, styles: Styles | None) -> Chart | None:
    """Error against cost of all configurations, with the Pareto front emphasised; None without costs.

    Its axis has no zero, so that `unshadowed`, whose predicted time is none, is left out.
    """
    front = section.front
    points = [{**chart_point(section, one), "front": one in front} for one in section.ranked if one.cost]
    if not points:
        return None
    _label(sorted((point for point in points if point["front"]), key=lambda point: point["cost"]))
    titles = {"predicted_ms": f"ms predicted for {section.device}", "work_cost": "work, M"}
    title = titles.get(section.cost_name, f"frame time, ms{' (software renderer)' if section.run.software else ''}")
    x = quantity("cost", title, **log_axis("x", [point["cost"] for point in points]))
    at = {"x": x, "y": _error_axis(section, [point["drawn"] for point in points])}
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
        *_zero_error_rule(section, points),
        mark("line", {**at, "order": {"field": "cost"}}, on_front, **line),
        mark("point", at | TOLD, hidden, filled=True, color=INK, size=25, clip=True),
        {"params": [_ZOOM], **mark("point", at | look | TOLD, SHOWN_ONLY, **point)},
        mark("text", named, on_front, SHOWN_ONLY, **label, fontSize=11, color=INK, clip=True),
    ]
    return chart_of(f"Error against cost in {section.title}; the line is the Pareto front", points, layer, 430)


def _label(front: Sequence[Chart]) -> None:
    """Label the points of a Pareto front, by increasing cost, except where one would overlap the previous label."""
    last: Chart | None = None
    for point in front:
        near = last is not None and point["cost"] < 1.2 * last["cost"] and point["drawn"] > 0.6 * last["drawn"]
        point["label"] = "" if near else point["told"]["map"]
        last = last if near else point


def _error_axis(section: Section, values: Sequence[float]) -> Chart:
    """The y channel of an error chart; values: all errors drawn."""
    about = "root mean square error of visibility" if section.soft else "share of the shadow that is wrong"
    return quantity("drawn", f"{section.ranked_by.error_label}: {about}", **log_axis("y", values))


def _zero_error_rule(section: Section, points: Sequence[Chart]) -> list[Chart]:
    """The labelled line at which an error of 0, or one below the truth's own, is drawn; empty if no point has one."""
    least = section.least_error
    if not any(point["error"] < least if section.soft else point["error"] == 0 for point in points):
        return []
    y = {"datum": least, "type": "quantitative"}
    what = "below the truth's own error, drawn at it" if section.soft else "no wrong pixel: drawn at half a pixel"
    label = {"x": {"value": 0}, "y": y, "text": {"value": f"{what} ({digits(least)})"}}
    layers = [
        mark("rule", {"y": y}, color="#767676", strokeDash=[2, 3], clip=True),
        mark("text", label, align="left", dx=4, dy=9, fontSize=11, color=INK, opacity=0.75, clip=True),
    ]
    return [{"data": {"values": [{}]}, **layer} for layer in layers]


def size_chart(section: Section, styles: Styles | None) -> Chart | None:
    """Error against map size, a line per spec, with confidence intervals over its cells; None without maps."""
    points = [chart_point(section, one) for one in section.scored]
    sizes = sorted({point["size"] for point in points if point["size"]})
    if not sizes:
        return None
    for index, point in enumerate(points):
        point["rank"] = sum(one["drawn"] == point["drawn"] for one in points[:index] if not one["size"])
    y = _error_axis(section, [point[end] for point in points for end in ("drawn", "low", "high")])
    scale = {"type": "log", "base": 2, "domain": [sizes[0] / 1.15, sizes[-1] * 1.15], "nice": False}
    x = quantity("size", "map size, texels a side", scale=scale, axis={"values": sizes, "format": "d"})
    look = looks(styles, (point["spec"] for point in points))
    color, at = {"color": look["color"]}, {"x": x, "y": y}
    mapped, unmapped = ({"filter": "datum.size"}, SHOWN_ONLY), ({"filter": "!datum.size"}, SHOWN_ONLY)
    interval = {"x": x, "y": {**y, "field": "low"}, "y2": {"field": "high"}}
    name = {"x": {"value": {"expr": "width"}}, "y": y, "text": {"field": "name"}}
    aside = {"expr": "-4 - 96 * datum.rank"}
    layer: list[Chart] = [
        *_zero_error_rule(section, points),
        mark("rule", {"y": y} | color | TOLD, *unmapped, strokeDash=[6, 4], strokeWidth=2),
        mark("text", name | color, *unmapped, align="right", dx=aside, dy=-7, fontSize=11),
        mark("line", at | color | {"detail": {"field": "spec"}}, *mapped, strokeWidth=1.8),
        mark("rule", interval | color, *mapped, strokeWidth=1.5),
        mark("point", at | look | TOLD, *mapped, filled=True, size=70),
    ]
    return chart_of(f"Error against map size in {section.title}", points, layer, 400)


def bias_charts(section: Section) -> dict[str, Chart]:
    """Acne against contact over the factors of each bias sweep, by its spec; none for soft shadows."""
    points: dict[str, list[Chart]] = {}
    for curve in [] if section.soft else curves(section.scored, section.run.sweep_positions):
        for factor, one in curve.points:
            contact, acne = one.value("contact"), one.value("acne")
            if contact is None or acne is None:
                continue
            point = chart_point(section, one)
            told = {"spec": one.spec, "× bias": f"{factor:g}", "contact": digits(contact)} | point["told"]
            place = {"map": told["map"], "contact": contact, "acne": acne}
            point |= place | {"factor": factor, "label": f"×{factor:g}", "best": factor == curve.best, "told": told}
            drawn = points.setdefault(curve.base, [])
            if drawn and place.items() <= drawn[-1].items():  # one label where points coincide, as without acne
                point["label"], drawn[-1]["label"] = f"{drawn[-1]['label']}, {point['label']}", ""
            drawn.append(point)
    return {base: _bias_chart(f"Acne against contact of {base} in {section.title}", of) for base, of in points.items()}


def _bias_chart(about: str, points: Sequence[Chart]) -> Chart:
    """A line for each map size, and the factors beside its points."""
    maps = list(dict.fromkeys(point["map"] for point in points))
    color = {
        "field": "map",
        "title": "map size",
        "scale": {"domain": maps, "range": [COLORS[index % len(COLORS)] for index in range(len(maps))]},
        "legend": {"orient": "top"},
    }
    titles = {"x": ("contact", "contact shadow lost (peter-panning)"), "y": ("acne", "acne")}
    at = {channel: _share(points, *names) for channel, names in titles.items()}
    best = {"condition": {"test": "datum.best", "value": INK}, "value": None}
    layer: list[Chart] = [
        mark("line", {**at, "color": color, "order": {"field": "factor"}}, strokeWidth=1.5),
        mark("point", {**at, "color": color, "stroke": best} | TOLD, filled=True, size=70, strokeWidth=2),
        mark("text", {**at, "text": {"field": "label"}}, align="left", dx=7, dy=-7, fontSize=11, color=INK),
    ]
    return chart_of(about, points, layer, 320)


def _share(points: Sequence[Chart], field: str, title: str) -> Chart:
    """A channel of shares from 0 to the first label beyond all of them."""
    most = max(_LEAST_SHARE, *(point[field] for point in points))
    ticks = [0.0, *(tick for below, tick in pairwise(_SHARES) if below < most)]
    scale = {"type": "symlog", "constant": _LEAST_SHARE, "domain": [0, ticks[-1]], "nice": False}
    return quantity(field, title, scale=scale, axis={"values": ticks, "format": "~g", "grid": True})


def pass_chart(section: Section, size: int | None) -> Chart | None:
    """Stacked bars of the pass times of specs at one map size and of those without a map; None without times.

    Passes are stacked in the order in which they are drawn.
    """
    shown = sorted(
        (one for one in section.timed if one.passes and one.map_size in (None, size)),
        key=lambda one: one.value("frame_ms") or 0.0,
    )
    if not shown:
        return None
    bars = []
    for row, one in enumerate(shown):
        frame = one.value("frame_ms") or 0.0
        for rank, timed in enumerate(one.passes):
            told = {
                "spec": one.spec,
                "pass": timed.name,
                "time": f"{digits(timed.ms)} ms",
                "redrawn": _CHANGES.get(timed.changes, timed.changes),
                "whole frame": f"{digits(frame)} ms",
            }
            bar = {
                "spec": one.spec,
                "name": one.name,
                "pass": timed.name,
                "row": row,
                "rank": rank,
                "ms": timed.ms,
                "frame": frame,
            }
            bars.append({**bar, "told": told})
    names = list(dict.fromkeys(timed.name for one in section.timed for timed in one.passes))
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
    name = {"y": y, "x": {"datum": 0}, "text": {"field": "name"}}
    first = {"filter": "datum.rank == 0"}, SHOWN_ONLY
    above = {"align": "left", "baseline": "bottom", "yOffset": -10, "color": INK, "fontSize": 11}
    layer: list[Chart] = [
        mark("bar", stacked | TOLD, SHOWN_ONLY, stroke=PAPER, strokeWidth=0.8),
        mark("tick", whole, *first, color=INK, thickness=3, bandSize=20, stroke=PAPER, opacity=1),
        mark("text", name, *first, **above),
    ]
    at_size = f"map size {size}" if size else "no maps"
    return chart_of(f"Time of each pass in {section.title}, {at_size}", bars, layer, {"step": _BAR})


def default_size(section: Section) -> int | None:
    """The map size of charts that show one: the median size, rounded down; None without maps."""
    sizes = sorted({one.map_size for one in section.ranked if one.map_size})
    return sizes[(len(sizes) - 1) // 2] if sizes else None
