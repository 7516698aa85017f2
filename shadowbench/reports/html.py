"""The report as an HTML file that needs no network, alone or with data files beside it."""

import re
import shlex
import sys
from collections.abc import Mapping, Sequence
from functools import cache
from pathlib import Path

from jinja2 import Environment, FileSystemLoader, StrictUndefined
from markupsafe import Markup, escape

from shadowbench.extremes.model import NAMES
from shadowbench.measure.flips import ROW_METRICS
from shadowbench.plugin.registry import preset_names
from shadowbench.reports import stability, sweep_charts, verdict, words
from shadowbench.reports.gallery import Place, breaking_cells, gallery
from shadowbench.reports.panels import panel_data, panels_of
from shadowbench.reports.stability import Stability
from shadowbench.reports.vega import COLORS, MAX_SHOWN, OUTLINES, SHAPES, styles_of
from shadowbench.results.configurations import Section, specs_of
from shadowbench.results.folder import Run
from shadowbench.versions import VERSION

PAGE = Path(__file__).parent / "page"
_SCRIPTS = ("page.js", "charts.js", "table.js", "viewer.js", "report.js")
Scenes = Mapping[str, Sequence[Section]]


def html_report(
    runs: Sequence[Run],
    scenes: Scenes,
    swept: Sequence[Stability],
    place: Place,
    beside: str | None = None,
    nav: str = "",
) -> str:
    """The HTML text of a report; scenes: sections by title.

    place: puts each part of the data into the page, or into a file of the folder of the name `beside`; nav: HTML of
    links to the other pages of a site.
    """
    every = [section for parts in scenes.values() for section in parts]
    panels = [panel for index, run in enumerate(runs) for panel in panels_of(run, index, every)]
    data = {panel.id: panel_data(panel, place) for panel in panels}
    for index, found in enumerate(swept):
        charts = {axis.name: sweep_charts.axis_chart(found, axis) for axis in found.axes}
        shown = gallery(found.sweep.folder, breaking_cells(found), place)
        data[f"stability-{index}"] = {"charts": charts, "gallery": shown, "specs": found.specs}
    specs = list(styles_of([*specs_of(every), *(spec for found in swept for spec in found.specs)]))
    page = {
        "panels": [
            {"id": one.id, "run": one.run, "title": one.title, "scenes": len(one.sections) > 1, "start": one.start}
            for one in panels
        ],
        "specs": specs,
        "names": preset_names(),
        "colors": COLORS[:MAX_SHOWN],
        "shapes": SHAPES,
        "outlines": OUTLINES,
        "site": bool(nav),
        "data": {name: place(f"data {name}", value) for name, value in data.items()},
    }
    return (
        environment()
        .get_template("report.html.j2")
        .render(
            stability=stability,
            sweep_charts=sweep_charts,
            verdict=verdict,
            words=words,
            runs=runs,
            panels=panels,
            page=page,
            split=beside,
            stabilities=swept,
            galleries=[data[f"stability-{index}"]["gallery"] for index in range(len(swept))],
            light_names=NAMES,
            metrics=ROW_METRICS.values(),
            presets=words.presets_of(specs),
            nav=nav,
            command="make site" if nav else shlex.join(["shadowbench", *sys.argv[1:]]),
            version=VERSION,
            style=(PAGE / "report.css").read_text(encoding="utf-8"),
            scripts=[(PAGE / name).read_text(encoding="utf-8") for name in _SCRIPTS],
            bundle=_bundle(),
        )
    )


@cache
def environment() -> Environment:
    """The templates of pages."""
    made = Environment(
        loader=FileSystemLoader(PAGE), autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True
    )
    made.policies["json.dumps_kwargs"] = {"sort_keys": False}  # views stay in order
    made.filters |= {"breakable": _breakable, "code_spans": _code_spans}
    return made


@cache
def _bundle() -> str:
    """Vega and the functions of it that the page calls; it takes two seconds to make."""
    import vl_convert  # not on every platform

    return vl_convert.javascript_bundle(snippet="window.vegaEmbed = vegaEmbed;")


def _breakable(text: str) -> Markup:
    """A spec with line breaks allowed between its parameters."""
    return Markup(re.sub(r"([,:(])", r"\1<wbr>", str(escape(text))))


def _code_spans(text: str) -> Markup:
    """Text with backticks turned into code elements."""
    return Markup(re.sub(r"`([^`]*)`", lambda found: f"<code>{_breakable(Markup(found[1]))}</code>", str(escape(text))))
