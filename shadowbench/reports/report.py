"""Reports on run and sweep folders: an HTML page that needs no network, tables, a CSV of all cells, or figures."""

import gzip
import re
import shlex
import sys
from collections.abc import Iterable, Iterator, Sequence
from functools import cache
from pathlib import Path
from typing import Any

import pandas as pd
from jinja2 import Environment, FileSystemLoader, StrictUndefined
from markupsafe import Markup, escape

from shadowbench.errors import InputError
from shadowbench.extremes.model import NAMES
from shadowbench.files import check_outputs, make_folder, replace_file
from shadowbench.measure.columns import ROW_METRICS
from shadowbench.plugin.registry import preset_names
from shadowbench.reports import charts, stability, sweep_charts, texts
from shadowbench.reports.charts import Chart
from shadowbench.reports.films import sequences
from shadowbench.reports.gallery import breaking_cells, gallery, scored_cells
from shadowbench.reports.stability import Stability
from shadowbench.reports.texts import escaped, sentence
from shadowbench.results.frame import Run
from shadowbench.results.ranges import points_frame
from shadowbench.results.summary import (
    Answer,
    Setting,
    Summary,
    by_kind,
    known,
    over_scenes,
    specs_of,
    targets_of,
    title_of_all,
)
from shadowbench.scores.metrics import METRICS
from shadowbench.versions import VERSION

FIGURES = ("png", "svg", "pdf")
FORMATS = ("html", "md", "csv", "tex", *FIGURES)
_BOLD = "bold: on the Pareto front of error and cost"

Runs = Sequence[tuple[Run, Sequence[Summary]]]
"""Runs, each with the summaries of its scenes."""


def report_target(output: Path | None, form: str) -> Path:
    """The output of a report in one of FORMATS: a file, or for FIGURES a folder; by default `report` with a suffix.

    Raises InputError for other formats, and if the output cannot be written.
    """
    if form not in FORMATS:
        raise InputError(f"--format: found {form!r:.60}; allowed: {', '.join(FORMATS)}")
    target = output or Path("report" if form in FIGURES else f"report.{form}")
    if form not in FIGURES:
        check_outputs(f".{form}", target)
    elif target.exists() and not target.is_dir():
        raise InputError(f"{target}: found a file; allowed: a folder, for the figures")
    return target


def write_report(runs: Runs, sweeps: Sequence[Run], target: Path, form: str) -> int:
    """Write a report on runs and sweeps in one of FORMATS; returns the number of figures for FIGURES, else 0."""
    swept = [stability.analyse(sweep) for sweep in sweeps]
    if form in FIGURES:
        return _write_figures(target, runs, swept, form)
    if form == "csv":
        text = str(all_cells([run for run, _ in runs], swept).to_csv(index=False))
    elif form == "tex":
        text = latex_tables(runs)
    else:
        text = html_report(runs, swept) if form == "html" else markdown_report(runs, swept)
    with replace_file(target) as temporary:
        temporary.write_text(text, encoding="utf-8", errors="backslashreplace")
    return 0


# The page

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


def html_report(runs: Runs, swept: Sequence[Stability]) -> str:
    """The HTML text of a report."""
    panels, data = [], {}
    for index, (_, summaries) in enumerate(runs):
        shown = panels_of(summaries)
        ids = {summary.title: f"{index}-{at}" for at, summary in enumerate(shown)}
        for summary in shown:
            panels.append(_panel(summary, index, ids))
            data[ids[summary.title]] = _panel_data(summary, ids)
    for index, one in enumerate(swept):
        data[f"stability-{index}"] = {
            "charts": {axis.name: sweep_charts.axis_chart(one, axis) for axis in one.axes},
            "gallery": gallery(one.sweep.folder, breaking_cells(one)),
            "specs": one.specs,
        }
    moving = any("sequences" in part for part in data.values())
    specs = list(charts.styles_of([*specs_of(run for run, _ in runs), *(spec for one in swept for spec in one.specs)]))
    page = {
        "panels": [{name: panel[name] for name in ("id", "title", "scenes", "start")} for panel in panels],
        "specs": specs,
        "names": preset_names(),
        "colors": charts.COLORS[: charts.MAX_SHOWN],
        "shapes": charts.SHAPES,
        "outlines": charts.OUTLINES,
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
        moving=moving,
        style="".join(map(_read, ("report.css", "films.css") if moving else ("report.css",))),
        scripts=[_read(name) for name in (*_SCRIPTS, *(["films.js"] if moving else []))],
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
    pictures = [] if several else scored_cells(summary)
    moving = sequences(summary.run.folder, pictures)
    return {
        "charts": {
            "front": charts.front_chart(summary, None),
            "sizes": charts.size_chart(summary, None),
            "passes": charts.pass_chart(summary),
        },
        "columns": [*first, *(["worst scene", "scenes"] if several else []), *values, "cells"],
        "rows": [_row(summary, one, cost, values, ids) for one in summary.candidates],
        "gallery": None if several else gallery(summary.run.folder, pictures),
        **({"sequences": moving} if moving else {}),
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
    names = {"spec": one.spec, "label": one.name, "map": one.map_size, "full": one.full_spec}
    return {**names, "front": bool(one.front), "scene": ids[title], "values": columns}


def _read(name: str) -> str:
    return (_PAGE / name).read_text(encoding="utf-8")


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
    """Vega, Vega-Lite and vega-embed, with their licences."""
    return gzip.decompress((_PAGE / "vega.js.gz").read_bytes()).decode()


def _breakable(text: str) -> Markup:
    """A spec with line breaks allowed between its parameters."""
    return Markup(re.sub(r"([,:(])", r"\1<wbr>", str(escape(text))))


def _code_spans(text: str) -> Markup:
    """Text with backticks turned into code elements."""
    return Markup(re.sub(r"`([^`]*)`", lambda span: f"<code>{_breakable(Markup(span[1]))}</code>", str(escape(text))))


# Tables


def settings_table(summary: Summary, style: str, front_style: str, headings: dict[str, str]) -> pd.DataFrame:
    """The settings of a scene with a score, best first, as texts.

    style, front_style: of a name, and of one on the front, with {} in its place; headings: of further values, by name
    of the column.
    """
    columns = texts.COLUMNS[summary.soft] | headings
    rows = [
        [
            (front_style if one.front else style).format(one.name),
            str(one.map_size or ""),
            texts.error_text(summary, one),
        ]
        + [texts.value_text(one, name) if name != "map_size" else "–" for name in columns.values()]
        for one in summary.shown
    ]
    return pd.DataFrame(rows, columns=["spec", "map", summary.ranked_by.error_label, *columns])


def latex_tables(runs: Runs) -> str:
    """A LaTeX table for each scene, for the package booktabs: its settings, best first, bold on the front."""
    tables = [_latex(one) for _, summaries in runs for one in summaries if one.shown]
    return "\n".join([r"% \usepackage{booktabs}", *tables])


def _latex(summary: Summary) -> str:
    costed = any(known(one.cost) for one in summary.shown)
    headings: dict[str, str] = {texts.COST_HEADINGS[summary.cost]: summary.cost} if costed else {}
    headings |= {"× reference": "ratio"} if summary.timed else {}
    notes = [summary.title, *([texts.cost_source(summary)] if costed else []), *texts.notes_of(summary)]
    notes += [_BOLD] if any(one.front for one in summary.shown) else []
    frame = settings_table(summary, r"\texttt{{{}}}", r"\textbf{{\texttt{{{}}}}}", headings)
    label = re.sub(r"[^a-z0-9]+", "-", f"{summary.run.label}-{summary.title}".lower()).strip("-")
    return frame.map(_latex_text).to_latex(
        index=False,
        header=[_latex_text(str(name)) for name in frame],
        column_format="ll" + "r" * (len(frame.columns) - 2),
        caption=" ".join(_latex_text(sentence(note)) for note in notes),
        label=f"tab:{label}",
    )


_LATEX = {character: f"\\{character}" for character in "&%$#_"} | {"²": "$^2$", "½": r"$\frac12$", "¼": r"$\frac14$"}
_LATEX |= {"~": r"\textasciitilde{}", "^": r"\textasciicircum{}", "×": r"$\times$", "≥": r"$\geq$", "≤": r"$\leq$"}
_LATEX |= {"–": "--", "−": "$-$", "<": "$<$", ">": "$>$", "…": r"\ldots{}", "|": "$|$"}


def _latex_text(text: str) -> str:
    """Text whose characters mean nothing of their own to LaTeX, apart from commands."""
    return "".join(_LATEX.get(character, character) for character in text)


def markdown_report(runs: Runs, swept: Sequence[Stability]) -> str:
    """The Markdown text of a report: verdicts, settings and costs, over all scenes and by scene; then ranges."""
    blocks: list[str] = []
    for run, summaries in runs:
        for summary in panels_of(summaries):
            if summary.scenes:
                label = f": {escaped(run.label)}" if len(runs) > 1 else ""
                blocks += [f"## {summary.title.capitalize()}{label}", *texts.verdict(summary), *_costs(summary)]
    for title in dict.fromkeys(one.title for _, summaries in runs for one in summaries):
        blocks.append(f"## {title}")
        for run, summaries in runs:
            for summary in (one for one in summaries if one.title == title):
                if len(runs) > 1:
                    blocks.append(f"### {escaped(run.label)}: {escaped(run.renderer)}")
                blocks += [*_scene(summary), *_costs(summary), *_items(texts.unscored(summary))]
                blocks += [f"- {escaped(line)}" for line in texts.mask_warnings(summary)]
    for one in swept:
        blocks += _ranges(one, f": {escaped(one.sweep.label)}" if len(swept) > 1 else "")
    blocks.append("## How the results were measured")
    for folder in (*(run for run, _ in runs), *(one.sweep for one in swept)):
        facts = [(name, f"`{text}`" if name == "command" else escaped(text)) for name, text in texts.run_facts(folder)]
        facts += [("assumed", escaped(note)) for note in folder.assumptions]
        blocks += [f"### {escaped(folder.label)}", "\n".join(f"- {name}: {text}" for name, text in facts)]
    specs = [*specs_of(run for run, _ in runs), *(spec for one in swept for spec in one.specs)]
    if presets := texts.presets_of(specs):
        blocks += ["### Presets", "\n".join(f"- `{name}`: `{spec}`" for name, spec in presets)]
    return "\n\n".join(blocks) + "\n"


def _scene(summary: Summary) -> list[str]:
    blocks = texts.verdict(summary)
    if any(one.cost == one.cost for one in summary.shown):  # not NaN
        blocks.append(f"*{sentence(texts.cost_source(summary))}* {sentence(_BOLD)}")
    blocks += [escaped(sentence(line)) for line in texts.notes_of(summary)]
    headings: dict[str, str] = {texts.COST_HEADINGS[summary.cost]: summary.cost}
    headings |= {"camera moves, ms": "camera_ms", "× ref": "ratio"} if summary.cost == "frame_ms" else {}
    frame = settings_table(summary, "`{}`", "**`{}`**", headings)
    faults = [(one.label, "; ".join(lines)) for one in summary.shown if (lines := texts.fault_lines(summary, one))]
    return [*blocks, *texts.table([str(name) for name in frame], frame.to_numpy().tolist()), *_items(faults)]


def _costs(summary: Summary) -> list[str]:
    """The cost matrix; empty if nothing has a score."""
    targets = summary.targets if summary.soft else summary.targets + targets_of(METRICS["edge_px"])
    rows = []
    for technique, answers in summary.matrix(targets).items():
        cells = []
        for answer in answers:
            cost, label, note = texts.answer_texts(summary, answer)
            described = ", ".join(filter(None, (texts.accuracy_text(summary, answer), note)))
            cells.append(" ".join(filter(None, (cost, label and f"`{label}`", described))))
        rows.append([technique, *cells])
    return texts.table(["cost of accuracy", *map(texts.target_name, targets)], rows)


def _ranges(swept: Stability, label: str) -> list[str]:
    tolerance = f"Tolerance: {stability.tolerances()}."
    blocks = [f"## Stability{label}", *swept.headline, tolerance]
    for spec in swept.specs:
        series = [one for one in swept.series if one[0] == spec]
        rows = [[axis.name, *(one.text if one else "" for one in ranges)] for axis, ranges in swept.table(series)]
        blocks += [f"### `{spec}`", *texts.table(["axis", *(NAMES[kind] for _, kind in series)], rows)]
    return [*blocks, *_items(swept.without_picture)]


def _items(lines: Iterable[tuple[str, str]]) -> list[str]:
    return [f"- `{label}`: {escaped(text)}" for label, text in lines]


def all_cells(runs: Sequence[Run], swept: Sequence[Stability]) -> pd.DataFrame:
    """The cells of all folders: columns `run`, `processor`, `software`, then those of `table.csv`.

    Cells of a sweep also have `range`, the operating range along their axis.
    """
    tables = [(run, run.frame) for run in runs]
    for one in swept:
        keys = [(row["home_spec"], row["axis"], row["light_kind"]) for row in one.sweep.rows]
        ranges = [one.range_at[key].text if key in one.range_at else None for key in keys]
        tables.append((one.sweep, points_frame(one.sweep.rows).assign(range=pd.Series(ranges, dtype=object))))
    frames = [
        frame.assign(run=run.label, processor=run.about.get("machine", {}).get("processor"), software=run.software)
        for run, frame in tables
    ]
    first = ["run", "processor", "software"]
    columns = dict.fromkeys([*first, *(name for frame in frames for name in frame)])
    return pd.concat(frames)[list(columns)]


# Figures


def _write_figures(folder: Path, runs: Runs, swept: Sequence[Stability], form: str) -> int:
    """Write charts in one of FIGURES, with their titles in png alone, and `captions.md`."""
    make_folder(folder)
    captions = []
    for name, chart in figures(runs, swept):
        file = re.sub(r"[^\w.-]+", "_", name).strip("_") + f".{form}"
        charts.write_chart(folder / file, chart if form == "png" else chart | {"title": None})
        captions.append((file, ". ".join([chart["description"], *chart["title"]["subtitle"]]) + "."))
    with replace_file(folder / "captions.md") as temporary:
        temporary.write_text("".join(f"**{file}**: {escaped(text)}\n\n" for file, text in captions), encoding="utf-8")
    return len(captions)


def figures(runs: Runs, swept: Sequence[Stability]) -> Iterator[tuple[str, Chart]]:
    """Generate (name, chart) of every figure.

    Per scene: SCENE.VIEW-SIZE.KIND, where KIND is front, sizes or passes; per sweep: stability.AXIS. With
    several runs or sweeps, their label comes before the last part.
    """
    styles = charts.styles_of(specs_of(run for run, _ in runs))
    for run, summaries in runs:
        for summary in summaries:
            stem = summary.file_stem + (f".{run.label}" if len(runs) > 1 else "")
            notes = (sentence(note).removesuffix(".") for note in texts.notes_of(summary))
            about = f"{run.renderer}; {texts.cost_source(summary)}", *notes
            for kind, chart in (
                ("front", charts.front_chart(summary, styles)),
                ("sizes", charts.size_chart(summary, styles)),
                ("passes", charts.pass_chart(summary)),
            ):
                if chart is not None:
                    yield f"{stem}.{kind}", charts.titled(chart, summary.title, *about)
    for one in swept:
        stem = "stability" + (f".{one.sweep.label}" if len(swept) > 1 else "")
        styles = charts.styles_of(one.specs)
        subtitle = one.sweep.renderer, f"tolerance: {stability.tolerances()}"
        for axis in one.axes:
            chart = sweep_charts.axis_figure(one, axis, styles)
            yield f"{stem}.{axis.name}", charts.titled(chart, f"{axis.name}: {axis.about}", *subtitle, width=None)
