"""The report as an HTML file that needs no network, alone or with data files beside it."""

import re
import shlex
import sys
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from functools import cache
from pathlib import Path
from typing import Any

from jinja2 import Environment, FileSystemLoader, StrictUndefined, Template
from markupsafe import Markup, escape

from shadowbench.extremes.model import NAMES
from shadowbench.measure.flips import ROW_METRICS
from shadowbench.plugin.registry import preset_names
from shadowbench.reports.along_axes import LIMITS, axis_chart, metrics_along
from shadowbench.reports.data_files import DataFiles
from shadowbench.reports.gallery import GalleryCell, breaking_cells, gallery, no_pictures, scored_cells, size_limit
from shadowbench.reports.heat_map import UNSUPPORTED_COLOR, is_dark, share_color
from shadowbench.reports.panels import Panel, panel_data, panels_of
from shadowbench.reports.stability import Stability
from shadowbench.reports.styles import COLORS, MAX_SHOWN, OUTLINES, SHAPES, Styles, styles_of
from shadowbench.reports.words import (
    breaks_without_picture,
    presets_of,
    range_cells,
    run_facts,
    sentence,
    stability_headline,
    time_source,
    tolerances,
)
from shadowbench.results.configurations import Section, specs_of
from shadowbench.results.folder import Run, Sweep
from shadowbench.results.ranges import OperatingRange
from shadowbench.versions import VERSION

_PAGE = Path(__file__).parent / "page"
_GLOBALS = "window.vegaEmbed = vegaEmbed;"
_SCRIPTS = ("files.js", "charts.js", "table.js", "viewer.js", "report.js")


def html_report(
    runs: Sequence[Run],
    scenes: Mapping[str, Sequence[Section]],
    swept: Sequence[Stability],
    beside: DataFiles | None = None,
) -> str:
    """The HTML text of a report; scenes: sections by title; beside: receives the data, None for data in the page."""
    every = [section for parts in scenes.values() for section in parts]
    styles = styles_of([*specs_of(every), *(spec for found in swept for spec in found.specs)], legend=False)
    scored = {section: scored_cells(section) for section in every}
    breaking = [breaking_cells(found) for found in swept]
    max_size = size_limit(cell for cells in (*scored.values(), *breaking) for cell in cells)
    panels = [panel for index, run in enumerate(runs) for panel in panels_of(run, index, every)]
    data: dict[str, Any] = {}
    for panel in panels:
        values = panel_data(panel, styles, scored, max_size, beside)
        data[panel.id] = values if beside is None else beside.write(f"panel {panel.id}", values)
    stabilities = [
        _stability(found, styles, cells, max_size, f"stability-{index}", beside)
        for index, (found, cells) in enumerate(zip(swept, breaking, strict=True))
    ]
    sweeps = [found.sweep for found in swept]
    return _template().render(
        title=f"shadowbench: {', '.join(one.label for one in (*runs, *sweeps))}",
        runs=list(map(_run, runs)),
        sweeps=list(map(_run, sweeps)),
        panels=panels,
        page=_page_data(panels, styles.specs) | ({} if beside is None else {"data": data}),
        data=data,
        split=None if beside is None else beside.name,
        stabilities=stabilities,
        tolerances=tolerances(),
        metrics=ROW_METRICS.values(),
        presets=presets_of(styles.specs),
        command=shlex.join(["shadowbench", *sys.argv[1:]]),
        version=VERSION,
        style=(_PAGE / "report.css").read_text(encoding="utf-8"),
        scripts=[(_PAGE / name).read_text(encoding="utf-8") for name in _SCRIPTS],
        bundle=_bundle(),
    )


def _template() -> Template:
    environment = Environment(
        loader=FileSystemLoader(_PAGE), autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True
    )
    environment.policies["json.dumps_kwargs"] = {"sort_keys": False}  # views stay in order
    environment.filters |= {"breakable": _breakable, "code_spans": _code_spans, "sentence": sentence}
    return environment.get_template("report.html.j2")


@cache
def _bundle() -> str:
    """Vega and the functions of it that the page calls; it takes two seconds to make."""
    import vl_convert  # not on every platform

    return vl_convert.javascript_bundle(snippet=_GLOBALS)


def _page_data(panels: Sequence[Panel], specs: Sequence[str]) -> dict[str, Any]:
    """The data of the page's scripts besides that of each panel."""
    return {
        "panels": [
            {"id": one.id, "run": one.run, "title": one.title, "scenes": len(one.sections) > 1, "start": one.start}
            for one in panels
        ],
        "specs": specs,
        "names": preset_names(),
        "colors": COLORS[:MAX_SHOWN],
        "shapes": SHAPES,
        "outlines": OUTLINES,
    }


def _breakable(text: str) -> Markup:
    """A spec with line breaks allowed between its parameters."""
    return Markup(re.sub(r"([,:(])", r"\1<wbr>", str(escape(text))))


def _code_spans(text: str) -> Markup:
    """Text with backticks turned into code elements."""
    return Markup(re.sub(r"`([^`]*)`", lambda found: f"<code>{_breakable(Markup(found[1]))}</code>", str(escape(text))))


def _run(run: Run | Sweep) -> dict[str, Any]:
    return {
        "label": run.label,
        "cells": len(run.rows),
        "renderer": run.renderer,
        "processor": run.about.get("machine", {}).get("processor"),
        "finished": str(run.about.get("finished", ""))[:10],
        "software": run.software,
        "times": time_source(run) if isinstance(run, Run) else None,
        "facts": run_facts(run),
        "assumptions": run.assumptions,
    }


def _stability(
    found: Stability,
    styles: Styles,
    cells: Sequence[GalleryCell],
    max_size: int,
    html_id: str,
    beside: DataFiles | None,
) -> dict[str, Any]:
    pictures = gallery(found.sweep.folder, cells, max_size, beside)
    return {
        "id": html_id,
        "label": found.sweep.label,
        "renderer": found.sweep.renderer,
        "headline": stability_headline(found),
        "specs": found.specs,
        "lights": [light for light in NAMES.values() if any(light == NAMES[kind] for _, kind in found.series)],
        "series": [(spec, NAMES[kind]) for spec, kind in found.series],
        "headings": [(spec, sum(one == spec for one, _ in found.series)) for spec in found.specs],
        "table": [
            (axis, [(text, _range_style(one)) for one, text in zip(ranges, texts, strict=True)])
            for axis, ranges, texts in range_cells(found)
        ],
        "axes": [(axis, metrics_along(found, axis), axis_chart(found, axis, styles)) for axis in found.axes],
        "metrics": list(LIMITS),
        "without_picture": breaks_without_picture(found),
        "gallery": None if pictures is None else asdict(pictures),
        "no_gallery": no_pictures(found.sweep) if any(found.breaking_points()) else "There are no breaking points.",
    }


def _range_style(one: OperatingRange | None) -> str:
    if one is None:
        return ""
    if one.share is None:
        return f"background: {UNSUPPORTED_COLOR}"
    return f"background: {share_color(one.share)}{'; color: #fff' if is_dark(one.share) else ''}"
