"""The report as Markdown tables, for READMEs and papers."""

from collections.abc import Iterable, Mapping, Sequence

from shadowbench.reports.analysis import Section, front
from shadowbench.reports.stability import Stability
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
from shadowbench.studies.folder import Run, Sweep

_COLUMNS = {
    "SSIM": "ssim",
    "edge px": "edge_px",
    "acne": "acne",
    "leak": "leak",
    "ms": "frame_ms",
    "camera moves, ms": "camera_ms",
    "× ref": "ratio",
}


def markdown_report(runs: Sequence[Run], scenes: Mapping[str, Sequence[Section]], swept: Sequence[Stability]) -> str:
    """By scene: headlines, configurations (the Pareto front bold), time to accuracy. Then ranges, and origins."""
    blocks: list[str] = []
    for title, parts in scenes.items():
        blocks.append(f"## {title}")
        for section in parts:
            if len(runs) > 1:
                blocks.append(f"### {_cell(section.run.label)}: {_cell(section.run.renderer)}")
            blocks += _section(section)
    for found in swept:
        blocks.append("## Stability" + (f": {_cell(found.sweep.label)}" if len(swept) > 1 else ""))
        blocks += _stability(found)
    blocks.append("## How it was made")
    everything: list[Run | Sweep] = [*runs, *(found.sweep for found in swept)]
    for run in everything:
        blocks.append(f"### {_cell(run.label)}")
        times = [("times are", times_are(run))] if isinstance(run, Run) else []
        facts = [*machine_facts(run), *times, *(("assumed", note) for note in run.assumptions)]
        blocks.append("\n".join(f"- {name}: {_fact(name, value)}" for name, value in facts))
    return "\n\n".join(blocks) + "\n"


def _section(section: Section) -> list[str]:
    blocks = [*headline(section)]
    if section.timed:
        blocks.append(f"*{sentence(times_are(section.run))}* Bold: on the Pareto front of error and time.")
    blocks += [_cell(sentence(line)) for line in section_notes(section)]
    best = front(section)
    rows = [
        [_bold(f"`{one.spec}`", one in best), str(one.map_size or ""), error.text(digits)]
        + [value_of(one, name) for name in _COLUMNS.values()]
        for one in section.held
        if (error := one.error)
    ]
    if rows:
        blocks.append(_table(["spec", "map", "1 − IoU", *_COLUMNS], rows))
    for title, steps, techniques in reach_tables(section):
        lines = [
            [
                technique,
                *(" ".join(filter(None, (ms, _told(what), extra and f"({extra})"))) for ms, what, extra in cells),
            ]
            for technique, reaches, top in techniques
            for cells in [[reach_text(reach, top) for reach in reaches]]
        ]
        if lines:
            blocks.append(_table(["time to accuracy", *(f"{title} {step}" for step in steps)], lines))
    blocks += [f"- `{label}`: {_cell(status)}" for label, status in refusals(section)]
    blocks += [f"- {_cell(line)}" for line in warned(section)]
    return blocks


def _stability(found: Stability) -> list[str]:
    blocks = [*stability_headline(found), f"Tolerance: {tolerances()}. In brackets: values that hold, of those swept."]
    for spec, lights, rows in range_tables(found):
        blocks.append(f"### `{spec}`")
        lines = [[axis, *("" if one is None else range_text(one) for one in ranges)] for axis, ranges in rows]
        blocks.append(_table(["axis", *lights], lines))
    return [*blocks, *(f"- `{label}`: {_cell(status)}" for label, status in ended(found))]


def _table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    lines = [head, ["---"] + ["---:"] * (len(head) - 1), *rows]
    return "\n".join(f"| {' | '.join(_cell(cell) for cell in line)} |" for line in lines)


def _cell(text: str) -> str:
    """Text that cannot end a table's cell or line."""
    return " ".join(text.replace("|", "\\|").split())


def _fact(name: str, value: str) -> str:
    return f"`{value}`" if name == "command" else _cell(value)


def _told(what: str) -> str:
    return what if what.startswith("best: ") else f"`{what}`"


def _bold(text: str, wanted: bool) -> str:
    return f"**{text}**" if wanted else text
