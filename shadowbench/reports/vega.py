"""What the Vega-Lite charts have in common: layers, channels, logarithmic axes, and the colours and shapes of specs."""

import json
from collections.abc import Iterable, Sequence
from typing import Any

from shadowbench.plugin.registry import preset_names
from shadowbench.reports.words import COLUMNS, digits
from shadowbench.results.configurations import Configuration, Section
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
TOLD = {"tooltip": {"field": "told"}, "description": {"field": "spec"}}
"""Channels of a mark whose data have texts to tell, by name, in `told`."""
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


def chart_point(section: Section, one: Configuration) -> Chart:
    """The chart data of a scored configuration: coordinates, and the texts of its tooltip."""
    error = one.error
    assert error is not None  # only scored configurations are drawn
    iou, cost = one.value("iou"), one.cost and (one.cost / 1e6 if one.cost_name == "work_cost" else one.cost)
    ends = {"drawn": error.median, "low": error.low, "high": error.high}
    told = {
        "spec": one.spec,
        "full spec": one.full_spec,
        "map": str(one.map_size) if one.map_size else one.technique,
        one.ranked_by.error_label: one.error_text(digits),
        "IoU": "–" if iou is None else f"{iou:.6g}",
        **{title: one.text(name, digits) for title, name in COLUMNS[one.soft].items() if name != "iou"},
        **_cost_told(one),
        "cells": one.cells,
        "phases": one.phases,
    }
    place = {
        "spec": one.spec,
        "name": one.name,
        "size": one.map_size,
        "error": error.median,
        "cost": cost,
        "told": told,
    }
    return place | {name: max(error.median if end is None else end, section.least_error) for name, end in ends.items()}


def _cost_told(one: Configuration) -> dict[str, str]:
    """Texts of a configuration's cost; of a measured time also its spread, and its ratio to the reference."""
    if one.cost_name != "frame_ms" or one.cost is None:
        return {"cost": one.cost_text(digits) if one.cost_name != "map_size" else "not timed"}
    iqr, ratio = one.value("frame_iqr_ms"), one.value("ratio")
    spread = f"IQR {'unknown' if iqr is None else f'{digits(iqr)} ms'}{'; rough' if one.rough else ''}"
    return {"time": f"{digits(one.cost)} ms, {spread}", "× reference": "–" if ratio is None else digits(ratio)}


def styles_of(specs: Iterable[str]) -> Styles:
    """Looks of specs, in the order of the legend: first one of each technique, then the others, `unshadowed` last."""
    every = list(dict.fromkeys(specs))
    first = {spec.partition(":")[0]: spec for spec in reversed(every)}.values()
    order = sorted(every, key=lambda spec: (spec == Unshadowed.name, spec not in first))
    return {
        spec: (
            COLORS[index % len(COLORS)],
            SHAPES[(index + index // len(COLORS)) % len(SHAPES)],
        )  # where colours repeat
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
