"""The report as one HTML file, which opens without a network."""

import itertools
import re
import shlex
import sys
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from functools import cache
from pathlib import Path
from typing import Any

import vl_convert
from jinja2 import Environment, FileSystemLoader, StrictUndefined
from markupsafe import Markup, escape

from shadowbench import __version__
from shadowbench.extremes.axes.model import NAMES
from shadowbench.extremes.ranges import OperatingRange
from shadowbench.measure.flips import ROW_METRICS
from shadowbench.reports.along_axes import LIMITS, axis_chart, metrics_along
from shadowbench.reports.analysis import Section, specs_of
from shadowbench.reports.gallery import gallery, no_pictures, shots_of_breaks, shots_of_section, side
from shadowbench.reports.heat_map import NOTHING, is_dark, shade
from shadowbench.reports.matrix import IOU_TARGETS
from shadowbench.reports.parts import DEFAULT_COLUMNS, Part, part_of, parts_of
from shadowbench.reports.stability import Stability
from shadowbench.reports.styles import COLORS, MOST, OUTLINES, SHAPES, Styles, styles_of
from shadowbench.reports.verdict import target_name
from shadowbench.reports.words import (
    ended,
    machine_facts,
    range_cells,
    sentence,
    stability_headline,
    times_are,
    tolerances,
)
from shadowbench.studies.folder import Run, Sweep

_PAGE = Path(__file__).parent / "page"
_GLOBALS = "window.vegaEmbed = vegaEmbed;"
_SCRIPTS = ("charts.js", "table.js", "viewer.js", "report.js")


def html_report(runs: Sequence[Run], scenes: Mapping[str, Sequence[Section]], swept: Sequence[Stability]) -> str:
    """The page. `scenes`: the sections of each scene, by its title."""
    every = [section for parts in scenes.values() for section in parts]
    styles = styles_of([*specs_of(every), *(spec for found in swept for spec in found.specs)], legend=False)
    shots = [shots_of_section(section) for section in every] + [shots_of_breaks(found) for found in swept]
    most = side(itertools.chain.from_iterable(shots))
    parts = [part for run in runs for part in parts_of(run, runs.index(run), every)]
    sweeps = [found.sweep for found in swept]
    environment = Environment(
        loader=FileSystemLoader(_PAGE), autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True
    )
    environment.policies["json.dumps_kwargs"] = {"sort_keys": False}  # places stand in their order
    environment.filters |= {"breaks": _breaks, "marked": _marked, "sentence": sentence}
    return environment.get_template("report.html.j2").render(
        title=f"shadowbench: {', '.join(one.label for one in (*runs, *sweeps))}",
        runs=[_run(run) for run in runs],
        sweeps=[_run(sweep) for sweep in sweeps],
        parts=parts,
        page=_page(parts, styles.specs),
        targets=[target_name(target) for target in IOU_TARGETS],
        data={part.id: part_of(part, styles, most) for part in parts},
        stabilities=[_stability(found, styles, most, f"stability-{at}") for at, found in enumerate(swept)],
        tolerances=tolerances(),
        metrics=[
            (metric.name, f"{metric.help} {metric.better.capitalize()} is better.") for metric in ROW_METRICS.values()
        ],
        command=shlex.join(["shadowbench", *sys.argv[1:]]),
        version=__version__,
        style=(_PAGE / "report.css").read_text(encoding="utf-8"),
        scripts=[(_PAGE / name).read_text(encoding="utf-8") for name in _SCRIPTS],
        bundle=_bundle(),
    )


@cache
def _bundle() -> str:
    """Vega and what the page calls of it; it takes two seconds to make."""
    return vl_convert.javascript_bundle(snippet=_GLOBALS)


def _page(parts: Sequence[Part], specs: Sequence[str]) -> dict[str, Any]:
    """What the scripts know of the page before any part is read."""
    return {
        "parts": [
            {"id": one.id, "run": one.run, "title": one.title, "scenes": len(one.sections) > 1, "start": one.start}
            for one in parts
        ],
        "specs": specs,
        "colors": COLORS[:MOST],
        "shapes": SHAPES,
        "outlines": OUTLINES,
        "columns": DEFAULT_COLUMNS,
    }


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


def _stability(found: Stability, styles: Styles, most: int, name: str) -> dict[str, Any]:
    pictures = gallery(found.sweep.folder, shots_of_breaks(found), most)
    return {
        "id": name,
        "label": found.sweep.label,
        "renderer": found.sweep.renderer,
        "headline": stability_headline(found),
        "specs": found.specs,
        "lights": [light for light in NAMES.values() if any(light == NAMES[kind] for _, kind in found.lines)],
        "lines": [(spec, NAMES[kind]) for spec, kind in found.lines],
        "heads": [(spec, sum(one == spec for one, _ in found.lines)) for spec in found.specs],
        "table": [
            (axis, [(text, _range_style(one)) for one, text in zip(ranges, texts, strict=True)])
            for axis, ranges, texts in range_cells(found)
        ],
        "axes": [(axis, metrics_along(found, axis), axis_chart(found, axis, styles)) for axis in found.axes],
        "metrics": list(LIMITS),
        "ended": ended(found),
        "gallery": None if pictures is None else asdict(pictures),
        "no_gallery": no_pictures(found.sweep) if any(found.breaking_points()) else "Nothing breaks.",
    }


def _range_style(one: OperatingRange | None) -> str:
    if one is None:
        return ""
    if one.share is None:
        return f"background: {NOTHING}"
    return f"background: {shade(one.share)}{'; color: #fff' if is_dark(one.share) else ''}"
