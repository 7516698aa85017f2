"""Chart data of configurations, and logarithmic axes for errors and times, on which an error of 0 has a place."""

from collections.abc import Sequence
from typing import Any

from shadowbench.reports.analysis import Configuration, Section
from shadowbench.reports.words import digits

Chart = dict[str, Any]


def chart_point(section: Section, one: Configuration) -> Chart:
    """The chart data of a scored configuration: coordinates, and texts for its tooltip."""
    error = one.error
    assert error is not None  # only scored configurations are drawn
    ms, iqr, ratio = (one.value(name) for name in ("frame_ms", "frame_iqr_ms", "ratio"))
    rough = "; rough" if one.row.rough else ""
    return {
        **tooltip_texts(one),
        "full spec": one.full_spec,
        "size": one.map_size,
        "error": error.median,
        "drawn": max(error.median, section.half_pixel),
        "low": max(error.median if error.low is None else error.low, section.half_pixel),
        "high": max(error.median if error.high is None else error.high, section.half_pixel),
        "ms": ms,
        "time": "not timed"
        if ms is None
        else f"{digits(ms)} ms, IQR {'unknown' if iqr is None else f'{digits(iqr)} ms'}{rough}",
        "× reference": "–" if ratio is None else digits(ratio),
        "cells": one.row.cells,
        "phases": one.row.phases,
    }


def tooltip_texts(one: Configuration) -> Chart:
    """The tooltip texts of a scored configuration that all charts share."""
    error = one.error
    assert error is not None
    return {
        "spec": one.spec,
        "map": str(one.map_size) if one.map_size else one.technique,
        "1 − IoU": error.text(digits),
        "IoU": f"{1 - error.median:.6g}",
        "edge px": _text(one, "edge_px"),
        "SSIM": _text(one, "ssim"),
        **{name: _text(one, name) for name in ("acne", "leak", "contact")},
    }


def label_points(points: Sequence[Chart]) -> None:
    """Add labels to the points of a Pareto front, except where one would overlap the previous label."""
    last: Chart | None = None
    for point in sorted(points, key=lambda point: point["ms"]):
        near = last is not None and point["ms"] < 1.2 * last["ms"] and point["drawn"] > 0.6 * last["drawn"]
        point["label"] = "" if near else point["map"]
        last = last if near else point


def _text(one: Configuration, name: str) -> str:
    value = one.value(name)
    return "–" if value is None else digits(value)


def error_axis(values: Sequence[float]) -> Chart:
    """The y channel of an error chart; values: all errors drawn."""
    return {
        "field": "drawn",
        "type": "quantitative",
        "title": "1 − IoU: share of the shadow that is wrong",
        **log_axis("y", values),
    }


def log_axis(channel: str, values: Sequence[float]) -> Chart:
    """A logarithmic scale and axis with a margin; over many decades only powers of ten are labelled."""
    decades = f"log(domain('{channel}')[1] / domain('{channel}')[0]) / LN10"
    leading = "round(datum.value / pow(10, floor(log(datum.value) / LN10 + 1e-9)))"
    labelled = f"{leading} == 1 || {decades} < 2.2 && indexof([2, 5], {leading}) >= 0 || {decades} < 0.8"
    return {
        "scale": {
            "type": "log",
            "domain": [min(values) / (1.3 if channel == "x" else 2.4), max(values) * 1.8],
            "nice": False,
        },
        "axis": {
            "grid": True,
            "gridOpacity": {"condition": {"test": labelled, "value": 1}, "value": 0},
            "labelExpr": f"{labelled} ? format(datum.value, '.6~r') : ''",
            "labelOverlap": True,
        },
    }


def zero_error_rule(section: Section, points: Sequence[Chart]) -> list[Chart]:
    """The labelled line at which an error of 0 is drawn; empty if no point has one."""
    if all(point["error"] > 0 for point in points):
        return []
    y = {"datum": section.half_pixel, "type": "quantitative"}
    text = f"no wrong pixel: drawn at half a pixel ({digits(section.half_pixel)})"
    return [
        {
            "data": {"values": [{}]},
            "mark": {"type": "rule", "color": "#767676", "strokeDash": [2, 3], "clip": True},
            "encoding": {"y": y},
        },
        {
            "data": {"values": [{}]},
            "mark": {
                "type": "text",
                "align": "left",
                "dx": 4,
                "dy": 9,
                "fontSize": 11,
                "color": {"expr": "ink"},
                "opacity": 0.75,
                "clip": True,
            },
            "encoding": {"x": {"value": 0}, "y": y, "text": {"value": text}},
        },
    ]
