"""The report as an HTML file that needs no network."""

import re
import shlex
import sys
from collections.abc import Sequence
from functools import cache
from pathlib import Path
from typing import Any

from jinja2 import Environment, FileSystemLoader, StrictUndefined
from markupsafe import Markup, escape

from shadowbench.extremes.model import NAMES
from shadowbench.measure.flips import ROW_METRICS
from shadowbench.plugin.registry import preset_names
from shadowbench.reports import stability, sweep_charts, texts
from shadowbench.reports.charts import (
    COLORS,
    MAX_SHOWN,
    OUTLINES,
    SHAPES,
    default_size,
    front_chart,
    pass_chart,
    size_chart,
    styles_of,
)
from shadowbench.reports.gallery import breaking_cells, gallery, scored_cells
from shadowbench.reports.stability import Stability
from shadowbench.results.frame import Run
from shadowbench.results.summary import (
    Answer,
    Setting,
    Summary,
    by_kind,
    known,
    over_scenes,
    specs_of,
    title_of_all,
)
from shadowbench.versions import VERSION

_PAGE = Path(__file__).parent / "page"
_SCRIPTS = ("charts.js", "viewer.js", "report.js")
_TIMES = {
    "IQR, ms": "frame_iqr_ms",
    "all still, ms": "still_ms",
    "camera moves, ms": "camera_ms",
    "light moves, ms": "light_ms",
    "× reference": "ratio",
}

Data = dict[str, Any]


def panels_of(summaries: Sequence[Summary]) -> list[Summary]:
    """What a page shows of one run, in its order: all its hard or soft scenes if there are several, then each scene.

    Scenes without any score come last.
    """
    kinds = by_kind(summaries)
    overall = [over_scenes(kind, title_of_all(kind, len(kinds))) for kind in kinds if len(kind) > 1]
    return [*overall, *sorted(summaries, key=lambda one: not one.shown)]


def html_report(runs: Sequence[tuple[Run, Sequence[Summary]]], swept: Sequence[Stability]) -> str:
    """The HTML text of a report; runs: each with the summaries of its scenes."""
    panels, data = [], {}
    for index, (_, summaries) in enumerate(runs):
        shown = panels_of(summaries)
        ids = {summary.title: f"{index}-{at}" for at, summary in enumerate(shown)}
        for summary in shown:
            panels.append(_panel(summary, index, ids))
            data[ids[summary.title]] = _panel_data(summary, ids)
    for index, one in enumerate(swept):
        charts = {axis.name: sweep_charts.axis_chart(one, axis) for axis in one.axes}
        pictures = gallery(one.sweep.folder, breaking_cells(one))
        data[f"stability-{index}"] = {"charts": charts, "gallery": pictures, "specs": one.specs}
    specs = list(styles_of([*specs_of(run for run, _ in runs), *(spec for one in swept for spec in one.specs)]))
    page = {
        "panels": [{name: panel[name] for name in ("id", "title", "scenes", "start")} for panel in panels],
        "specs": specs,
        "names": preset_names(),
        "colors": COLORS[:MAX_SHOWN],
        "shapes": SHAPES,
        "outlines": OUTLINES,
        "data": data,
    }
    text: str = _template().render(
        stability=stability,
        sweep_charts=sweep_charts,
        texts=texts,
        runs=[run for run, _ in runs],
        panels=panels,
        page=page,
        stabilities=swept,
        galleries=[data[f"stability-{index}"]["gallery"] for index in range(len(swept))],
        light_names=NAMES,
        metrics=ROW_METRICS.values(),
        presets=texts.presets_of(specs),
        command=shlex.join(["shadowbench", *sys.argv[1:]]),
        version=VERSION,
        style=(_PAGE / "report.css").read_text(encoding="utf-8"),
        scripts=[(_PAGE / name).read_text(encoding="utf-8") for name in _SCRIPTS],
        bundle=_bundle(),
    )
    return text


def _panel(summary: Summary, run: int, ids: dict[str, str]) -> Data:
    """What the template shows of a summary: its matrices, and the picture that is shown first, that of the verdict."""
    best = texts.verdict_setting(summary)
    techniques = summary.matrix(summary.targets).items()
    each = [(part.scene, part, part.answers(part.real_time, part.targets)) for part in summary.scenes]
    return {
        "id": ids[summary.title],
        "run": run,
        "title": summary.title,
        "scenes": bool(summary.scenes),
        "start": None if best is None else _picture_of(summary, best, ids),
        "summary": summary,
        "matrix": [(name, [_cell(summary, one, ids) for one in answers]) for name, answers in techniques],
        "by_scene": [(scene, [_cell(part, one, ids) for one in answers]) for scene, part, answers in each],
    }


def _picture_of(summary: Summary, one: Setting, ids: dict[str, str]) -> Data:
    """Spec, map size and scene of a setting's picture; of several scenes, the one in which it is worst."""
    scene = ids[summary.worst_scene(one, summary.ranked_by.name)]
    return {"spec": one.spec, "size": one.map_size, "scene": scene}


def _cell(summary: Summary, answer: Answer, ids: dict[str, str]) -> Data:
    cost, label, note = texts.answer_texts(summary, answer)
    best = answer.cheapest
    about = [note] if best is None else [best.full_spec]
    if answer.ties:
        about.append(f"as cheap, within the noise: {', '.join(one.label for one in answer.ties)}")
    return {
        "cost": cost,
        "accuracy": texts.accuracy_text(summary, answer),
        "label": label,
        "note": note,
        "about": "; ".join(about),
        "state": "none" if best is None else "all" if best.scored == len(summary.parts) else "some",
        **_picture_of(summary, best or answer.closest, ids),
    }


def _panel_data(summary: Summary, ids: dict[str, str]) -> Data:
    """The JSON data of a panel: charts, table, and for a single scene pictures."""
    several, heading = bool(summary.scenes), texts.COST_HEADINGS[summary.cost]
    cost = f"cost, {heading}" if heading == "ms" else heading
    metrics = dict.fromkeys([*texts.COLUMNS[summary.soft].values(), *ROW_METRICS])
    values = {name: name for name in metrics if name != summary.ranked_by.name}
    values |= (_TIMES if summary.cost == "frame_ms" else {}) | {"GPU bytes": "gpu_bytes"}
    first = [cost, "map", summary.ranked_by.error_label]
    return {
        "charts": {
            "front": front_chart(summary, None),
            "sizes": size_chart(summary, None),
            "passes": pass_chart(summary, default_size(summary)),
        },
        "columns": [*first, *(["worst scene", "scenes"] if several else []), *values, "cells"],
        "rows": [_row(summary, one, cost, values, ids) for one in summary.candidates],
        "gallery": None if several else gallery(summary.run.folder, scored_cells(summary)),
    }


def _row(summary: Summary, one: Setting, cost: str, values: dict[str, str], ids: dict[str, str]) -> Data:
    """A row of the table; values: by column, (sort key, text)."""
    title = summary.worst_scene(one, summary.ranked_by.name)
    worst = summary.by_scene(one)[title]
    (part,) = [part for part in summary.parts if part.title == title]

    def value(name: str) -> tuple[float | None, str]:
        number = getattr(one, name) if name != "map_size" else float("nan")
        return (number, texts.value_text(one, name)) if known(number) else (None, "–")

    columns: dict[str, tuple[float | None, str]] = {
        cost: value(summary.cost),
        "map": (one.map_size, str(one.map_size or "")),
        summary.ranked_by.error_label: (one.error, texts.error_text(summary, one)),
        "worst scene": (worst.error, f"{texts.error_text(part, worst, bounds=False)} in {part.scene}"),
        "scenes": (one.scored, f"{one.scored} of {len(summary.parts)}"),
        **{heading: value(name) for heading, name in values.items()},
        "cells": (one.cells, str(one.cells)),
    }
    names = {
        "spec": one.spec,
        "label": one.name,
        "map": one.map_size,
        "full": one.full_spec,
    }
    return {**names, "front": bool(one.front), "scene": ids[title], "values": columns}


@cache
def _template() -> Any:
    environment = Environment(
        loader=FileSystemLoader(_PAGE), autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True
    )
    environment.policies["json.dumps_kwargs"] = {"sort_keys": False}  # views stay in order
    environment.filters |= {"breakable": _breakable, "code_spans": _code_spans}
    return environment.get_template("report.html.j2")


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
    return Markup(re.sub(r"`([^`]*)`", lambda span: f"<code>{_breakable(Markup(span[1]))}</code>", str(escape(text))))
