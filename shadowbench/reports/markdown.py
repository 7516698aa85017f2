"""The report as Markdown tables, for READMEs and papers."""

from collections.abc import Iterable, Mapping, Sequence

from shadowbench.reports.stability import Stability
from shadowbench.reports.verdict import accuracy_text, cell_texts, target_name, verdict
from shadowbench.reports.words import (
    breaks_without_picture,
    digits,
    faults_of,
    mask_warnings,
    presets_of,
    range_tables,
    range_text,
    run_facts,
    section_notes,
    sentence,
    stability_headline,
    time_source,
    tolerances,
    unscored,
    value_of,
)
from shadowbench.results.configurations import Section, by_kind, specs_of
from shadowbench.results.folder import Run, Sweep
from shadowbench.results.ranking import candidates, cost_matrix, targets_of, title_of_all
from shadowbench.scores.metrics import METRICS

_TIMES = {"ms": "frame_ms", "camera moves, ms": "camera_ms", "× ref": "ratio"}
_COLUMNS = {"SSIM": "ssim", "edge px": "edge_px", "acne": "acne", "leak": "leak", **_TIMES}
_SOFT_COLUMNS = {
    "RMSE pen": "rmse_pen",
    "IoU": "iou",
    "SSIM": "ssim",
    "bleed": "bleed",
    "noise": "noise",
    "width": "width",
    "hardening": "hardening",
    **_TIMES,
}


def markdown_report(runs: Sequence[Run], scenes: Mapping[str, Sequence[Section]], swept: Sequence[Stability]) -> str:
    """The Markdown text of a report: verdicts, configurations and costs, over all scenes and by scene; then ranges."""
    every = [section for parts in scenes.values() for section in parts]
    blocks = [line for run in runs for line in _over_scenes(run, every, len(runs) > 1)]
    for title, parts in scenes.items():
        blocks.append(f"## {title}")
        for section in parts:
            if len(runs) > 1:
                blocks.append(f"### {_cell(section.run.label)}: {_cell(section.run.renderer)}")
            blocks += _section(section)
    for found in swept:
        blocks.append("## Stability" + (f": {_cell(found.sweep.label)}" if len(swept) > 1 else ""))
        blocks += _stability(found)
    blocks.append("## How the results were measured")
    everything: list[Run | Sweep] = [*runs, *(found.sweep for found in swept)]
    for one in everything:
        blocks += [f"### {_cell(one.label)}", _measured(one)]
    presets = presets_of([*specs_of(every), *(spec for found in swept for spec in found.specs)])
    if presets:
        blocks += ["### Presets", "\n".join(f"- `{name}`: `{spec}`" for name, spec in presets)]
    return "\n\n".join(blocks) + "\n"


def _over_scenes(run: Run, every: Sequence[Section], several: bool) -> list[str]:
    """Verdict and costs over all scenes of a run of each kind; several: whether its label is needed."""
    kinds, blocks = by_kind([section for section in every if section.run is run]), []
    for kind in kinds:
        if len(kind) > 1:
            title = title_of_all(kind, len(kinds)).capitalize()
            blocks += [f"## {title}{f': {_cell(run.label)}' if several else ''}", *verdict(kind), *_costs(kind)]
    return blocks


def _measured(one: Run | Sweep) -> str:
    times = [("times", time_source(one))] if isinstance(one, Run) else []
    facts = [*run_facts(one), *times, *(("assumed", note) for note in one.assumptions)]
    return "\n".join(f"- {name}: {_fact(name, value)}" for name, value in facts)


def _section(section: Section) -> list[str]:
    blocks = verdict([section])
    if section.timed:
        blocks.append(f"*{sentence(time_source(section.run))}* Bold: on the Pareto front of error and time.")
    blocks += [_cell(sentence(line)) for line in section_notes(section)]
    best = section.front
    columns = _SOFT_COLUMNS if section.soft else _COLUMNS
    rows = [
        [_bold(f"`{one.name}`", one in best), str(one.map_size or ""), one.error_text(digits)]
        + [value_of(one, name) for name in columns.values()]
        for one in section.scored
    ]
    if rows:
        blocks.append(_table(["spec", "map", section.ranked_by.error_label, *columns], rows))
    blocks += [f"- `{label}`: {_cell(line)}" for label, line in faults_of(section)]
    blocks += _costs([section])
    blocks += [f"- `{label}`: {_cell(status)}" for label, status in unscored(section)]
    blocks += [f"- {_cell(line)}" for line in mask_warnings(section)]
    return blocks


def _costs(sections: Sequence[Section]) -> list[str]:
    """The cost matrix; empty if nothing has a score."""
    targets = targets_of(sections[0].ranked_by)
    if not sections[0].soft:
        targets += targets_of(METRICS["edge_px"])
    names = {one.title: one.scene for one in sections}
    lines = [
        [technique, *(_cost(*cell_texts(cell, len(sections)), accuracy_text(cell, names)) for cell in cells)]
        for technique, cells in cost_matrix(candidates(sections), targets).items()
    ]
    return [_table(["cost of accuracy", *map(target_name, targets)], lines)] if lines else []


def _cost(cost: str, label: str, note: str, accuracy: str) -> str:
    described = ", ".join(filter(None, (accuracy, note)))
    return " ".join(filter(None, (cost, label and f"`{label}`", described)))


def _stability(found: Stability) -> list[str]:
    blocks = [*stability_headline(found), f"Tolerance: {tolerances()}. In brackets: the number of values in tolerance."]
    for spec, lights, rows in range_tables(found):
        blocks.append(f"### `{spec}`")
        lines = [[axis, *("" if one is None else range_text(one) for one in ranges)] for axis, ranges in rows]
        blocks.append(_table(["axis", *lights], lines))
    return [*blocks, *(f"- `{label}`: {_cell(status)}" for label, status in breaks_without_picture(found))]


def _table(headings: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    lines = [headings, ["---"] + ["---:"] * (len(headings) - 1), *rows]
    return "\n".join(f"| {' | '.join(_cell(cell) for cell in line)} |" for line in lines)


def _cell(text: str) -> str:
    """Text escaped for a table cell: on one line, and without cell separators."""
    return " ".join(text.replace("|", "\\|").split())


def _fact(name: str, value: str) -> str:
    return f"`{value}`" if name == "command" else _cell(value)


def _bold(text: str, bold: bool) -> str:
    return f"**{text}**" if bold else text
