"""The report as Markdown tables, for READMEs and papers."""

import re
from collections.abc import Collection, Iterable, Sequence

from shadowbench.extremes.model import NAMES
from shadowbench.reports.html import Scenes
from shadowbench.reports.panels import Panel, panels_of
from shadowbench.reports.stability import Stability, range_text, tolerances
from shadowbench.reports.verdict import target_name, verdict
from shadowbench.reports.words import (
    COLUMNS,
    COST_HEADINGS,
    cost_source,
    digits,
    fault_lines,
    mask_warnings,
    presets_of,
    run_facts,
    section_notes,
    sentence,
    unscored,
)
from shadowbench.results.configurations import Section, specs_of
from shadowbench.results.folder import Folder, Run
from shadowbench.results.ranking import targets_of
from shadowbench.scores.metrics import METRICS

_MARKUP = re.compile(r"\||<(?=[A-Za-z/!?])|\](?=\()")
_TIMES = {"camera moves, ms": "camera_ms", "× ref": "ratio"}


def markdown_report(runs: Sequence[Run], scenes: Scenes, swept: Sequence[Stability]) -> str:
    """The Markdown text of a report: verdicts, configurations and costs, over all scenes and by scene; then ranges."""
    every = [section for parts in scenes.values() for section in parts]
    panels = [panel for index, run in enumerate(runs) for panel in panels_of(run, index, every)]
    alone = {panel.sections[0]: panel for panel in panels if len(panel.sections) == 1}
    blocks = [block for panel in panels if len(panel.sections) > 1 for block in _over_scenes(panel, runs)]
    for title, parts in scenes.items():
        blocks.append(f"## {title}")
        for section in parts:
            if len(runs) > 1:
                blocks.append(f"### {escaped(section.run.label)}: {escaped(section.run.renderer)}")
            blocks += [*_section(section), *_costs(alone[section]), *_items(unscored(section))]
            blocks += [f"- {escaped(line)}" for line in mask_warnings(section)]
    for found in swept:
        blocks += _stability(found, f": {escaped(found.sweep.label)}" if len(swept) > 1 else "")
    specs = [*specs_of(every), *(spec for found in swept for spec in found.specs)]
    blocks += _provenance([*runs, *(found.sweep for found in swept)], specs)
    return "\n\n".join(blocks) + "\n"


def _provenance(folders: Sequence[Folder], specs: Iterable[str]) -> list[str]:
    """How each folder was measured, and what the presets among the specs stand for."""
    blocks = ["## How the results were measured"]
    for one in folders:
        blocks += [f"### {escaped(one.label)}", _measured(one)]
    presets = presets_of(specs)
    return [*blocks, "### Presets", "\n".join(f"- `{name}`: `{spec}`" for name, spec in presets)] if presets else blocks


def _over_scenes(panel: Panel, runs: Sequence[Run]) -> list[str]:
    label = f": {escaped(runs[panel.run].label)}" if len(runs) > 1 else ""
    return [f"## {panel.title.capitalize()}{label}", *verdict(panel.sections), *_costs(panel)]


def _section(section: Section) -> list[str]:
    blocks = verdict([section])
    if section.ranked:
        blocks.append(f"*{sentence(cost_source(section))}* Bold: on the Pareto front of error and cost.")
    blocks += [escaped(sentence(line)) for line in section_notes(section)]
    columns = COLUMNS[section.soft] | {COST_HEADINGS[section.cost_name]: section.cost_name}
    columns |= _TIMES if section.cost_name == "frame_ms" else {}
    best, rows = section.front, []
    for one in section.scored:
        name = f"**`{one.name}`**" if one in best else f"`{one.name}`"
        values = [one.text(column, digits) for column in columns.values()]
        rows.append([name, str(one.map_size or ""), one.error_text(digits), *values])
    faults = [(one.label, "; ".join(lines)) for one in section.scored if (lines := fault_lines(one))]
    return [*blocks, *table(["spec", "map", section.ranked_by.error_label, *columns], rows), *_items(faults)]


def _costs(panel: Panel) -> list[str]:
    """The cost matrix; empty if nothing has a score."""
    targets = panel.targets if panel.soft else panel.targets + targets_of(METRICS["edge_px"])
    rows = []
    for technique, cells in panel.matrix(targets):
        texts = []
        for cell in cells:
            label = cell["label"] and f"`{cell['label']}`"
            described = ", ".join(filter(None, (cell["accuracy"], cell["note"])))
            texts.append(" ".join(filter(None, (cell["cost"], label, described))))
        rows.append([technique, *texts])
    return table(["cost of accuracy", *map(target_name, targets)], rows)


def _stability(found: Stability, label: str) -> list[str]:
    tolerance = f"Tolerance: {tolerances()}. In brackets: the number of values in tolerance."
    blocks = [f"## Stability{label}", *found.headline, tolerance]
    for spec in found.specs:
        series = [one for one in found.series if one[0] == spec]
        rows = [[axis.name, *map(range_text, ranges)] for axis, ranges in found.table(series)]
        blocks += [f"### `{spec}`", *table(["axis", *(NAMES[kind] for _, kind in series)], rows)]
    return [*blocks, *_items(found.without_picture)]


def _measured(one: Folder) -> str:
    facts = [(name, f"`{value}`" if name == "command" else escaped(value)) for name, value in run_facts(one)]
    return "\n".join(
        f"- {name}: {value}" for name, value in [*facts, *(("assumed", escaped(note)) for note in one.assumptions)]
    )


def _items(found: Iterable[tuple[str, str]]) -> list[str]:
    return [f"- `{label}`: {escaped(text)}" for label, text in found]


def table(headings: Sequence[str], rows: Sequence[Sequence[str]], texts: Collection[str] = ()) -> list[str]:
    """A table, numbers to the right; empty without rows. texts: headings of other columns than the first."""
    rules = ["---" if name in texts or not at else "---:" for at, name in enumerate(headings)]
    lines = [headings, rules, *rows]
    return ["\n".join(f"| {' | '.join(map(escaped, line))} |" for line in lines)] if rows else []


def escaped(text: str) -> str:
    """Text escaped for a cell of a table: on one line, without separators, tags of HTML and links."""
    return " ".join(_MARKUP.sub(r"\\\g<0>", text).split())
