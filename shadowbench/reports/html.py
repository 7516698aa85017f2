"""The report as one HTML file, which opens without a network."""

import dataclasses
import itertools
import re
import shlex
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import vl_convert
from jinja2 import Environment, FileSystemLoader, StrictUndefined
from markupsafe import Markup, escape

from shadowbench import __version__
from shadowbench.extremes.axes.model import NAMES
from shadowbench.extremes.ranges import OperatingRange
from shadowbench.reports.along_axes import LIMITS, axis_chart, metrics_along
from shadowbench.reports.analysis import Configuration, Reach, Section, front, specs_of
from shadowbench.reports.axes import Chart
from shadowbench.reports.bias_curve import bias_charts
from shadowbench.reports.charts import default_size, front_chart, pass_chart, size_chart
from shadowbench.reports.gallery import gallery, shots_of_breaks, shots_of_section, side, start_of_section
from shadowbench.reports.heat_map import NOTHING, heat_map, is_dark, shade
from shadowbench.reports.stability import Stability
from shadowbench.reports.styles import Styles, styles_of
from shadowbench.reports.words import (
    digits,
    ended,
    headline,
    machine_facts,
    range_tables,
    range_text,
    reach_tables,
    reach_text,
    refusals,
    section_notes,
    sentence,
    stability_headline,
    times_are,
    tolerances,
    value_of,
    warned,
)
from shadowbench.scores.metrics import METRICS
from shadowbench.studies.folder import Folder, Run, Sweep

_PAGE = Path(__file__).parent / "page"
_GLOBALS = "window.vegaEmbed = vegaEmbed;"
# The outlines of Vega's point shapes, within ±6.
_SYMBOLS = {
    "circle": "M6,0A6,6 0 1 1 -6,0A6,6 0 1 1 6,0",
    "square": "M-5,-5H5V5H-5Z",
    "triangle-up": "M0,-6L6,5H-6Z",
    "diamond": "M0,-6.5L5,0L0,6.5L-5,0Z",
    "cross": "M-6,-2H-2V-6H2V-2H6V2H2V6H-2V2H-6Z",
    "triangle-down": "M0,6L6,-5H-6Z",
}


def html_report(runs: Sequence[Run], scenes: Mapping[str, Sequence[Section]], swept: Sequence[Stability]) -> str:
    """The page. `scenes`: the sections of each scene, by its title."""
    every = [section for parts in scenes.values() for section in parts]
    specs = [*specs_of(every), *(spec for found in swept for spec in found.specs)]
    styles = styles_of(specs, legend=False)
    shots = [shots_of_section(section) for section in every] + [shots_of_breaks(found) for found in swept]
    most = side(itertools.chain.from_iterable(shots))
    sweeps = [found.sweep for found in swept]
    environment = Environment(
        loader=FileSystemLoader(_PAGE), autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True
    )
    environment.filters |= {"breaks": _breaks, "marked": _marked, "sentence": sentence}
    return environment.get_template("report.html.j2").render(
        title=f"shadowbench: {', '.join(one.label for one in (*runs, *sweeps))}",
        runs=[_run(run) for run in runs],
        sweeps=[_run(sweep) for sweep in sweeps],
        scenes=[
            {
                "id": f"scene-{number}",
                "title": title,
                "parts": [_part(section, styles, most, f"part-{number}-{at}") for at, section in enumerate(parts)],
            }
            for number, (title, parts) in enumerate(scenes.items())
        ],
        stabilities=[_stability(found, styles, most, f"stability-{at}") for at, found in enumerate(swept)],
        tolerances=tolerances(),
        metrics=[
            (metric.name, f"{metric.help} {metric.better.capitalize()} is better.") for metric in METRICS.values()
        ],
        command=shlex.join(["shadowbench", *sys.argv[1:]]),
        version=__version__,
        style=(_PAGE / "report.css").read_text(encoding="utf-8"),
        script=(_PAGE / "report.js").read_text(encoding="utf-8"),
        bundle=vl_convert.javascript_bundle(snippet=_GLOBALS),
    )


def _breaks(text: str) -> Markup:
    """A spec that may be broken between its parameters."""
    return Markup(re.sub(r"([,:(])", r"\1<wbr>", str(escape(text))))


def _marked(text: str) -> Markup:
    """Words in which `…` is code."""
    return Markup(re.sub(r"`([^`]*)`", lambda found: f"<code>{_breaks(Markup(found[1]))}</code>", str(escape(text))))


def _run(run: Run | Sweep) -> dict[str, Any]:
    return {
        "label": run.label,
        "cells": len(run.rows),
        "renderer": run.renderer,
        "processor": run.about.get("machine", {}).get("processor"),
        "finished": str(run.about.get("finished", ""))[:10],
        "software": run.software,
        "times": times_are(run) if isinstance(run, Run) else None,
        "facts": machine_facts(run),
        "assumptions": run.assumptions,
    }


def _part(section: Section, styles: Styles, most: int, name: str) -> dict[str, Any]:
    best = front(section)
    specs = list(dict.fromkeys(one.spec for one in section.held))
    passes = _pass_charts(section)
    shots = shots_of_section(section)
    pictures = gallery(section.run.folder, shots, most, start_of_section(section, shots))
    return {
        "id": name,
        "label": section.run.label,
        "renderer": section.run.renderer,
        "software": section.run.software,
        "times": times_are(section.run),
        "timed": bool(section.timed),
        "cells": section.cells,
        "headline": headline(section),
        "notes": section_notes(section),
        "refusals": refusals(section),
        "warned": warned(section),
        "legend": _legend(styles, specs),
        "front": front_chart(section, styles),
        "sizes": size_chart(section, styles),
        "biases": bias_charts(section),
        "reaches": [
            (title, steps, [(technique, _reach_cells(row, top), top) for technique, row, top in rows])
            for title, steps, rows in reach_tables(section)
        ],
        "passes": passes,
        "pass_size": default_size(section),
        "gallery": None if pictures is None else dataclasses.asdict(pictures),
        "no_gallery": _no_gallery(section.run),
        "columns": ["spec", "map", "1 − IoU", *_COLUMNS, *_TIMES, "cells"],
        "rows": [
            {"spec": one.spec, "full_spec": one.full_spec, "front": one in best, "texts": table_row(one)}
            for one in section.held
        ],
    }


def _stability(found: Stability, styles: Styles, most: int, name: str) -> dict[str, Any]:
    pictures = gallery(found.sweep.folder, shots_of_breaks(found), most)
    return {
        "id": name,
        "label": found.sweep.label,
        "renderer": found.sweep.renderer,
        "headline": stability_headline(found),
        "legend": _legend(styles, found.specs),
        "heat": heat_map(found) if found.ranges else None,
        "heat_narrow": heat_map(found, compact=True) if found.ranges else None,
        "axes": [
            (axis.name, axis.invariant, metrics_along(found, axis), axis_chart(found, axis, styles))
            for axis in found.axes
        ],
        "metrics": list(LIMITS),
        "lights": [light for light in NAMES.values() if any(light == NAMES[kind] for _, kind in found.lines)],
        "tables": [
            (spec, lights, [(axis, [_range_cell(one) for one in ranges]) for axis, ranges in rows])
            for spec, lights, rows in range_tables(found)
        ],
        "ended": ended(found),
        "gallery": None if pictures is None else dataclasses.asdict(pictures),
        "no_gallery": _no_gallery(found.sweep) if any(found.breaking_points()) else "Nothing breaks.",
    }


def _range_cell(one: OperatingRange | None) -> tuple[str, str]:
    """Text and style of a range in a table; the colours are the heat map's."""
    if one is None:
        return "", ""
    if one.share is None:
        return range_text(one), f"background: {NOTHING}"
    return range_text(one), f"background: {shade(one.share)}{'; color: #fff' if is_dark(one.share) else ''}"


def _legend(styles: Styles, specs: Sequence[str]) -> list[tuple[str, str, str]]:
    """Spec, colour and outline of its mark."""
    marks = [(spec, *styles.mark(spec)) for spec in styles.specs if spec in specs]
    return [(spec, color, _SYMBOLS[shape]) for spec, color, shape in marks]


def _no_gallery(folder: Folder) -> str:
    return f"No pictures: {folder.folder.name} holds neither pictures/ nor masks/ of these cells."


_COLUMNS = [name for name in METRICS if name != "iou"]
_TIMES = {
    "ms": "frame_ms",
    "IQR ms": "frame_iqr_ms",
    "all still, ms": "still_ms",
    "camera moves, ms": "camera_ms",
    "light moves, ms": "light_ms",
    "× reference": "ratio",
}


def table_row(one: Configuration) -> list[str]:
    """Map size, error, the other metrics, times, cells: the values of a configuration, as text."""
    error = one.error
    return [
        str(one.map_size or ""),
        "–" if error is None else error.text(digits),
        *(value_of(one, name) for name in (*_COLUMNS, *_TIMES.values())),
        str(one.row.cells),
    ]


def _reach_cells(reaches: Sequence[Reach], best: str) -> list[tuple[str, str, str]]:
    """A text for each step; none at all where no step is reached."""
    return [reach_text(reach, best) for reach in reaches] if any(reach.cheapest for reach in reaches) else []


def _pass_charts(section: Section) -> list[tuple[int | None, Chart]]:
    sizes: list[int | None] = [*sorted({one.map_size for one in section.timed if one.map_size})]
    charts = [(size, pass_chart(section, size)) for size in sizes or [None]]
    return [(size, chart) for size, chart in charts if chart is not None]
