"""Configurations as points, and logarithmic axes that hold them all, those without any error too."""

from collections.abc import Sequence
from typing import Any

from shadowbench.reports.analysis import Configuration, Section
from shadowbench.reports.words import digits

Chart = dict[str, Any]


def point_of(section: Section, one: Configuration) -> Chart:
    """A configuration that has a score as the data of a chart: numbers to place it, texts to tell what it is."""
    error = one.error
    assert error is not None  # only what has a score is drawn
    ms, iqr, ratio = (one.value(name) for name in ("frame_ms", "frame_iqr_ms", "ratio"))
    rough = "; rough" if one.row.wide else ""
    return {
        **texts_of(one),
        "full spec": one.full_spec,
        "size": one.map_size,
        "error": error.median,
        "drawn": max(error.median, section.floor),
        "low": max(error.median if error.low is None else error.low, section.floor),
        "high": max(error.median if error.high is None else error.high, section.floor),
        "ms": ms,
        "time": "not timed"
        if ms is None
        else f"{digits(ms)} ms, IQR {'unknown' if iqr is None else f'{digits(iqr)} ms'}{rough}",
        "× reference": "–" if ratio is None else digits(ratio),
        "cells": one.row.cells,
        "phases": one.row.phases,
    }


def texts_of(one: Configuration) -> Chart:
    """What is said of a configuration that has a score, wherever it is a point."""
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


def label(points: Sequence[Chart]) -> None:
    """Give the points of a front their labels, but where one would lie on the last."""
    last: Chart | None = None
    for point in sorted(points, key=lambda point: point["ms"]):
        near = last is not None and point["ms"] < 1.2 * last["ms"] and point["drawn"] > 0.6 * last["drawn"]
        point["label"] = "" if near else point["map"]
        last = last if near else point


def _text(one: Configuration, name: str) -> str:
    value = one.value(name)
    return "–" if value is None else digits(value)


def error_axis(values: Sequence[float]) -> Chart:
    """The y channel of charts of errors, `values` being all that is drawn."""
    return {
        "field": "drawn",
        "type": "quantitative",
        "title": "1 − IoU: share of the shadow that is wrong",
        **log_axis("y", values),
    }


def log_axis(channel: str, values: Sequence[float]) -> Chart:
    """Scale and axis with some air around the values; over many decades only powers of ten are labelled."""
    decades = f"log(domain('{channel}')[1] / domain('{channel}')[0]) / LN10"
    leading = "round(datum.value / pow(10, floor(log(datum.value) / LN10 + 1e-9)))"
    wanted = f"{leading} == 1 || {decades} < 2.2 && indexof([2, 5], {leading}) >= 0 || {decades} < 0.8"
    return {
        "scale": {
            "type": "log",
            "domain": [min(values) / (1.3 if channel == "x" else 2.4), max(values) * 1.8],
            "nice": False,
        },
        "axis": {
            "grid": True,
            "gridOpacity": {"condition": {"test": wanted, "value": 1}, "value": 0},
            "labelExpr": f"{wanted} ? format(datum.value, '.6~r') : ''",
            "labelOverlap": True,
        },
    }


def zero_rule(section: Section, points: Sequence[Chart]) -> list[Chart]:
    """Where no error is drawn, and words that say so; nothing if there is no such point."""
    if all(point["error"] > 0 for point in points):
        return []
    y = {"datum": section.floor, "type": "quantitative"}
    words = f"no wrong pixel: drawn at half a pixel ({digits(section.floor)})"
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
            "encoding": {"x": {"value": 0}, "y": y, "text": {"value": words}},
        },
    ]
