"""Chart data of configurations, and logarithmic axes for errors and times, on which an error of 0 has a place."""

from collections.abc import Sequence
from typing import Any

from shadowbench.reports.words import digits
from shadowbench.results.configurations import Configuration, Section

Chart = dict[str, Any]
_SCORES = {"edge px": "edge_px", "SSIM": "ssim", "acne": "acne", "leak": "leak", "contact": "contact"}
_SOFT_SCORES = {"RMSE pen": "rmse_pen", "SSIM": "ssim"} | {
    name: name for name in ("bleed", "noise", "width", "hardening")
}


def mark(kind: str, encoding: Chart, *where: Chart, **style: Any) -> Chart:
    """A layer of marks of one kind and style; where: transforms that choose its data."""
    return {**({"transform": list(where)} if where else {}), "mark": {"type": kind, **style}, "encoding": encoding}


def quantity(field: str, title: str | Sequence[str] | None, **more: Any) -> Chart:
    """A channel of numbers."""
    return {"field": field, "type": "quantitative", "title": title, **more}


def chart_point(section: Section, one: Configuration) -> Chart:
    """The chart data of a scored configuration: coordinates, and texts for its tooltip."""
    error = one.error
    assert error is not None  # only scored configurations are drawn
    ms, iqr, ratio = (one.value(name) for name in ("frame_ms", "frame_iqr_ms", "ratio"))
    rough = "; rough" if one.rough else ""
    return {
        **tooltip_texts(one),
        "full spec": one.full_spec,
        "size": one.map_size,
        "error": error.median,
        "drawn": max(error.median, section.least_error),
        "low": max(error.median if error.low is None else error.low, section.least_error),
        "high": max(error.median if error.high is None else error.high, section.least_error),
        "ms": ms,
        "time": "not timed"
        if ms is None
        else f"{digits(ms)} ms, IQR {'unknown' if iqr is None else f'{digits(iqr)} ms'}{rough}",
        "× reference": "–" if ratio is None else digits(ratio),
        "cells": one.cells,
        "phases": one.phases,
    }


def tooltip_texts(one: Configuration) -> Chart:
    """The tooltip texts of a scored configuration that all charts share."""
    iou = one.value("iou")
    return {
        "spec": one.spec,
        "map": str(one.map_size) if one.map_size else one.technique,
        one.ranked_by.error_label: one.error_text(digits),
        "IoU": "–" if iou is None else f"{iou:.6g}",
        **{title: one.text(name, digits) for title, name in _scores(one.soft).items()},
    }


def tooltip(section: Section) -> list[Chart]:
    """The fields of the tooltip of a `chart_point`."""
    scores = [name for name in _scores(section.soft) if name != "contact"]
    names = ["spec", "full spec", "map", section.ranked_by.error_label, "IoU", *scores]
    return [{"field": name} for name in (*names, "time", "× reference", "cells", "phases")]


def _scores(soft: bool) -> dict[str, str]:
    return _SOFT_SCORES if soft else _SCORES


def label_points(points: Sequence[Chart]) -> None:
    """Add labels to the points of a Pareto front, except where one would overlap the previous label."""
    last: Chart | None = None
    for point in sorted(points, key=lambda point: point["ms"]):
        near = last is not None and point["ms"] < 1.2 * last["ms"] and point["drawn"] > 0.6 * last["drawn"]
        point["label"] = "" if near else point["map"]
        last = last if near else point


def error_axis(section: Section, values: Sequence[float]) -> Chart:
    """The y channel of an error chart; values: all errors drawn."""
    about = "root mean square error of visibility" if section.soft else "share of the shadow that is wrong"
    return quantity("drawn", f"{section.ranked_by.error_label}: {about}", **log_axis("y", values))


def log_axis(channel: str, values: Sequence[float]) -> Chart:
    """A logarithmic scale and axis with a margin; over many decades only powers of ten are labelled."""
    decades = f"log(domain('{channel}')[1] / domain('{channel}')[0]) / LN10"
    leading = "round(datum.value / pow(10, floor(log(datum.value) / LN10 + 1e-9)))"
    labelled = f"{leading} == 1 || {decades} < 2.2 && indexof([2, 5], {leading}) >= 0 || {decades} < 0.8"
    lowest = min(values) / (1.3 if channel == "x" else 2.4)
    return {
        "scale": {"type": "log", "domain": [lowest, max(values) * 1.8], "nice": False},
        "axis": {
            "grid": True,
            "gridOpacity": {"condition": {"test": labelled, "value": 1}, "value": 0},
            "labelExpr": f"{labelled} ? format(datum.value, '.6~r') : ''",
            "labelOverlap": True,
        },
    }


def zero_error_rule(section: Section, points: Sequence[Chart]) -> list[Chart]:
    """The labelled line at which an error of 0, or one below the truth's own, is drawn; empty if no point has one."""
    least = section.least_error
    if not any(point["error"] < least if section.soft else point["error"] == 0 for point in points):
        return []
    y = {"datum": least, "type": "quantitative"}
    what = "below the truth's own error, drawn at it" if section.soft else "no wrong pixel: drawn at half a pixel"
    text = f"{what} ({digits(least)})"
    style = {"align": "left", "dx": 4, "dy": 9, "fontSize": 11, "color": {"expr": "ink"}, "opacity": 0.75, "clip": True}
    layers = [
        mark("rule", {"y": y}, color="#767676", strokeDash=[2, 3], clip=True),
        mark("text", {"x": {"value": 0}, "y": y, "text": {"value": text}}, **style),
    ]
    return [{"data": {"values": [{}]}, **layer} for layer in layers]
