"""Reports on run and sweep folders: an HTML page, tables, a CSV of all cells, or figures."""

import re
from collections.abc import Callable, Iterable, Iterator, Sequence
from pathlib import Path

import pandas as pd

from shadowbench.errors import InputError
from shadowbench.extremes.model import NAMES
from shadowbench.files import check_outputs, make_folder, replace_file
from shadowbench.reports.charts import (
    Chart,
    bias_charts,
    default_size,
    front_chart,
    pass_chart,
    size_chart,
    styles_of,
    titled,
    write_chart,
)
from shadowbench.reports.page import html_report, panels_of
from shadowbench.reports.stability import Stability, analyse, range_text, tolerances
from shadowbench.reports.sweep_charts import axis_figure
from shadowbench.reports.texts import (
    COLUMNS,
    COST_HEADINGS,
    accuracy_text,
    answer_texts,
    cost_source,
    error_text,
    escaped,
    fault_lines,
    mask_warnings,
    notes_of,
    presets_of,
    run_facts,
    sentence,
    table,
    target_name,
    unscored,
    value_text,
    verdict,
)
from shadowbench.results.frame import Run, csv_of
from shadowbench.results.ranges import points_frame
from shadowbench.results.summary import Summary, known, specs_of, targets_of
from shadowbench.scores.metrics import METRICS

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
    swept = [analyse(sweep) for sweep in sweeps]
    if form in FIGURES:
        return _write_figures(target, runs, swept, form)
    texts: dict[str, Callable[[], str]] = {
        "html": lambda: html_report(runs, swept),
        "md": lambda: markdown_report(runs, swept),
        "csv": lambda: csv_of(all_cells([run for run, _ in runs], swept)),
        "tex": lambda: latex_tables(runs),
    }
    with replace_file(target) as temporary:
        temporary.write_text(texts[form](), encoding="utf-8", errors="backslashreplace")
    return 0


# Tables


def settings_table(summary: Summary, marked: Callable[[str, bool], str], headings: dict[str, str]) -> pd.DataFrame:
    """The settings of a scene with a score, best first, as texts.

    marked: makes a name's text, and whether it is on the front; headings: of further values, by name of the column.
    """
    columns = COLUMNS[summary.soft] | headings
    rows = [
        [marked(one.name, one.front), str(one.map_size or ""), error_text(summary, one)]
        + [value_text(one, name) if name != "map_size" else "–" for name in columns.values()]
        for one in summary.shown
    ]
    return pd.DataFrame(rows, columns=["spec", "map", summary.ranked_by.error_label, *columns])


def latex_tables(runs: Runs) -> str:
    """A LaTeX table for each scene, for the package booktabs: its settings, best first, bold on the front."""
    return "\n".join(
        ["% \\usepackage{booktabs}", *(_latex(one) for _, summaries in runs for one in summaries if one.shown)]
    )


def _latex(summary: Summary) -> str:
    costed = any(known(one.cost) for one in summary.shown)
    headings: dict[str, str] = {COST_HEADINGS[summary.cost]: summary.cost} if costed else {}
    headings |= {"× reference": "ratio"} if summary.timed else {}
    notes = [summary.title, *([cost_source(summary)] if costed else []), *notes_of(summary)]
    notes += [_BOLD] if any(one.front for one in summary.shown) else []

    def marked(name: str, front: bool) -> str:
        return rf"\textbf{{\texttt{{{name}}}}}" if front else rf"\texttt{{{name}}}"

    frame = settings_table(summary, marked, headings)
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
                blocks += [f"## {summary.title.capitalize()}{label}", *verdict(summary), *_costs(summary)]
    for title in dict.fromkeys(one.title for _, summaries in runs for one in summaries):
        blocks.append(f"## {title}")
        for run, summaries in runs:
            for summary in (one for one in summaries if one.title == title):
                if len(runs) > 1:
                    blocks.append(f"### {escaped(run.label)}: {escaped(run.renderer)}")
                blocks += [*_scene(summary), *_costs(summary), *_items(unscored(summary))]
                blocks += [f"- {escaped(line)}" for line in mask_warnings(summary)]
    for stability in swept:
        blocks += _stability(stability, f": {escaped(stability.sweep.label)}" if len(swept) > 1 else "")
    blocks.append("## How the results were measured")
    for folder in (*(run for run, _ in runs), *(stability.sweep for stability in swept)):
        facts = [(name, f"`{text}`" if name == "command" else escaped(text)) for name, text in run_facts(folder)]
        facts += [("assumed", escaped(note)) for note in folder.assumptions]
        blocks += [f"### {escaped(folder.label)}", "\n".join(f"- {name}: {text}" for name, text in facts)]
    specs = [*specs_of(run for run, _ in runs), *(spec for stability in swept for spec in stability.specs)]
    if presets := presets_of(specs):
        blocks += ["### Presets", "\n".join(f"- `{name}`: `{spec}`" for name, spec in presets)]
    return "\n\n".join(blocks) + "\n"


def _scene(summary: Summary) -> list[str]:
    blocks = verdict(summary)
    if any(one.cost == one.cost for one in summary.shown):  # not NaN
        blocks.append(f"*{sentence(cost_source(summary))}* {sentence(_BOLD)}")
    blocks += [escaped(sentence(line)) for line in notes_of(summary)]
    headings: dict[str, str] = {COST_HEADINGS[summary.cost]: summary.cost}
    headings |= {"camera moves, ms": "camera_ms", "× ref": "ratio"} if summary.cost == "frame_ms" else {}
    frame = settings_table(summary, lambda name, front: f"**`{name}`**" if front else f"`{name}`", headings)
    faults = [(one.label, "; ".join(lines)) for one in summary.shown if (lines := fault_lines(summary, one))]
    return [*blocks, *table([str(name) for name in frame], frame.to_numpy().tolist()), *_items(faults)]


def _costs(summary: Summary) -> list[str]:
    """The cost matrix; empty if nothing has a score."""
    targets = summary.targets if summary.soft else summary.targets + targets_of(METRICS["edge_px"])
    rows = []
    for technique, answers in summary.matrix(targets).items():
        texts = []
        for answer in answers:
            cost, label, note = answer_texts(summary, answer)
            described = ", ".join(filter(None, (accuracy_text(summary, answer), note)))
            texts.append(" ".join(filter(None, (cost, label and f"`{label}`", described))))
        rows.append([technique, *texts])
    return table(["cost of accuracy", *map(target_name, targets)], rows)


def _stability(stability: Stability, label: str) -> list[str]:
    tolerance = f"Tolerance: {tolerances()}. In brackets: the number of values in tolerance."
    blocks = [f"## Stability{label}", *stability.headline, tolerance]
    for spec in stability.specs:
        series = [one for one in stability.series if one[0] == spec]
        rows = [[axis.name, *map(range_text, ranges)] for axis, ranges in stability.table(series)]
        blocks += [f"### `{spec}`", *table(["axis", *(NAMES[kind] for _, kind in series)], rows)]
    return [*blocks, *_items(stability.without_picture)]


def _items(lines: Iterable[tuple[str, str]]) -> list[str]:
    return [f"- `{label}`: {escaped(text)}" for label, text in lines]


def all_cells(runs: Sequence[Run], swept: Sequence[Stability]) -> pd.DataFrame:
    """The cells of all folders: columns `run`, `processor`, `software`, then those of `table.csv`.

    Cells of a sweep also have `range`, the operating range along their axis.
    """
    tables = [(run, run.frame) for run in runs]
    for stability in swept:
        keys = [(row["home_spec"], row["axis"], row["light_kind"]) for row in stability.sweep.rows]
        ranges = [stability.range_at[key].text if key in stability.range_at else None for key in keys]
        points = points_frame(stability.sweep.rows).assign(range=pd.Series(ranges, dtype=object))
        tables.append((stability.sweep, points))
    frames = [
        frame.assign(run=one.label, processor=one.about.get("machine", {}).get("processor"), software=one.software)
        for one, frame in tables
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
        write_chart(folder / file, chart if form == "png" else chart | {"title": None})
        captions.append((file, ". ".join([chart["description"], *chart["title"]["subtitle"]]) + "."))
    with replace_file(folder / "captions.md") as temporary:
        temporary.write_text("".join(f"**{file}**: {escaped(text)}\n\n" for file, text in captions), encoding="utf-8")
    return len(captions)


def figures(runs: Runs, swept: Sequence[Stability]) -> Iterator[tuple[str, Chart]]:
    """Generate (name, chart) of every figure.

    Per scene: SCENE.VIEW-SIZE.KIND, where KIND is front, sizes, passes, or bias-1, … for bias sweeps; per sweep:
    stability and stability.AXIS. With several runs or sweeps, their label comes before the last part.
    """
    styles = styles_of(specs_of(run for run, _ in runs))
    for run, summaries in runs:
        for summary in summaries:
            stem = summary.file_stem + (f".{run.label}" if len(runs) > 1 else "")
            notes = (sentence(note).removesuffix(".") for note in notes_of(summary))
            about = f"{run.renderer}; {cost_source(summary)}", *notes
            for kind, chart in (
                ("front", front_chart(summary, styles)),
                ("sizes", size_chart(summary, styles)),
                ("passes", pass_chart(summary, default_size(summary))),
            ):
                if chart is not None:
                    yield f"{stem}.{kind}", titled(chart, summary.title, *about)
            for number, (spec, chart) in enumerate(bias_charts(summary).items(), start=1):
                yield f"{stem}.bias-{number}", titled(chart, summary.title, f"bias of {spec}, multiplied", *about)
    for stability in swept:
        stem = "stability" + (f".{stability.sweep.label}" if len(swept) > 1 else "")
        styles = styles_of(stability.specs)
        about = stability.sweep.renderer, f"tolerance: {tolerances()}"
        for axis in stability.axes:
            chart = axis_figure(stability, axis, styles)
            yield f"{stem}.{axis.name}", titled(chart, f"{axis.name}: {axis.about}", *about, width=None)
