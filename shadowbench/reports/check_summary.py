"""What a check found, as tables: for the terminal, as Markdown, and as annotations of a CI's log."""

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from shadowbench.errors import counted, number
from shadowbench.measure.flips import ROW_METRICS
from shadowbench.measure.rows import Record
from shadowbench.reports.words import table
from shadowbench.results.baseline import MISSING, Change, Findings, Verdict
from shadowbench.scores.metrics import leading_error

COLUMNS = ("scene, view, light", "spec", "map", "what", "before", "", "after", "× tolerance", "also")
LINES = 40
"""Of a table, one per cell."""
_LONGEST = 40  # characters of a status
_ANNOTATIONS = 10  # that GitHub shows of a step
_TITLES: Mapping[Verdict, str] = {
    "regressed": "regressed, worst first",
    "slower": "slower; ratios to the reference",
    "improved": "improved, largest change first",
    "faster": "faster; ratios to the reference",
}


def by_cell(changes: Iterable[Change]) -> list[list[Change]]:
    """The changes of each cell, the largest first, but the kind of error that leads them before all others."""
    cells: dict[int, list[Change]] = {}  # by the record, which the changes of a cell share
    for change in changes:
        cells.setdefault(id(change.score), []).append(change)
    leading = [leading_error(cell[0].score.get("metrics", {}), {one.what for one in cell}) for cell in cells.values()]
    return [
        sorted(cell, key=lambda one: one.what != first) for cell, first in zip(cells.values(), leading, strict=True)
    ]


def tables(findings: Findings, time: bool) -> Iterator[tuple[str, list[tuple[str, ...]]]]:
    """The title of each verdict's table, and a row for each cell: the largest change, and the names of the others.

    time: whether slower cells make the check fail.
    """
    for verdict, title in _TITLES.items():
        if cells := by_cell(findings.of(verdict)):
            warning = "; a warning only (--time makes it fail)" if verdict == "slower" and not time else ""
            yield title + warning, [_row(*cell) for cell in cells]


def _row(worst: Change, *others: Change) -> tuple[str, ...]:
    excess = "" if math.isinf(worst.excess) else f"{worst.excess:.1f}"
    values = (worst.what, value_text(worst.before), "→", value_text(worst.after), excess)
    score = worst.score
    return (_place(score), score["spec"], str(score["map_size"] or ""), *values, " ".join(one.what for one in others))


def _place(score: Record) -> str:
    phase = f" phase {score['phase']}" if score["phase"] else ""
    return f"{score['scene']} {score['view']} {score['light']}{phase}"


def cell_name(score: Record) -> str:
    """A cell for a reader: its spec and map size, and where."""
    size = f" at {score['map_size']}" if score["map_size"] else ""
    return f"{score['spec']}{size} in {_place(score)}"


def value_text(value: Any) -> str:
    """A value of a change: a number, a status, or None."""
    if value is None:
        return "none"
    if isinstance(value, str):
        return value if len(value) <= _LONGEST else f"{value[: _LONGEST - 1]}…"
    return str(value) if isinstance(value, int) else number(value)


def counts(findings: Findings, baseline: Path) -> str:
    """How many cells were compared, and how many of each verdict were found."""
    cells = {verdict: len(by_cell(findings.of(verdict))) for verdict in _TITLES}
    missing = sum(change.after == MISSING for change in findings.changes)
    cells["regressed"] -= missing
    numbers = {"regressed": cells["regressed"], "missing": missing, "improved": cells["improved"]}
    numbers |= {"slower": cells["slower"]}
    parts = [f"{count} {what}" for what, count in numbers.items() if count or what in ("regressed", "improved")]
    same = f", {findings.equal} of them identical" if findings.equal else ""
    return f"{counted(findings.compared, 'cell')} compared with {baseline}{same}: {', '.join(parts)}"


def markdown(findings: Findings, baseline: Path, folder: Path, pictures: Mapping[str, Path], time: bool) -> str:
    """A summary of a run folder's check: a table of each verdict, every value of the worst cells, and what to do next.

    pictures: files by the key of a row.
    """
    failed = bool(findings.of("regressed") or (time and findings.of("slower")))
    blocks = [f"## Shadows {'got worse' if failed else 'are as good as they were'}", counts(findings, baseline) + "."]
    for title, rows in tables(findings, time):
        lines = table(COLUMNS, [[row[0], f"`{row[1]}`", *row[2:]] for row in rows[:LINES]], ("spec", "what", "also"))
        more = [f"and {len(rows) - LINES} more"] if len(rows) > LINES else []
        blocks += [f"### {title[:1].upper()}{title[1:]}", *lines, *more]
    regressed = [cell for cell in by_cell(findings.of("regressed")) if cell[0].score["key"] in pictures]
    for cell in regressed:
        blocks += _details(cell, pictures[cell[0].score["key"]].relative_to(folder))
    blocks += [f"- {note}" for note in findings.notes]
    if failed:
        masks = " --masks" if (baseline / "masks").exists() else ""
        accept = f"shadowbench check {folder} --baseline {baseline} --update{masks}"
        blocks.append(f"If this is meant to be: `{accept}` makes these results the baseline.")
    return "\n\n".join(blocks) + "\n"


def _details(cell: Sequence[Change], picture: Path) -> list[str]:
    """Every value of a cell that became worse, with what it means, and the name of its picture."""
    rows = [
        [
            change.what,
            value_text(change.before),
            value_text(change.after),
            "" if math.isinf(change.excess) else f"{change.excess:.1f}",
            ROW_METRICS[change.what].help if change.what in ROW_METRICS else "",
        ]
        for change in cell
    ]
    lines = table(["what", "before", "after", "× tolerance", "what it is"], rows, ["what it is"])
    return [f"### {cell_name(cell[0].score)}", f"Picture: `{picture}`", *lines]


def annotations(findings: Findings, pictures: Mapping[str, Path], time: bool) -> list[str]:
    """Workflow commands of GitHub's log: an error for each of the worst cells, a warning for slower ones."""
    kinds: dict[Verdict, str] = {"regressed": "error", "slower": "error" if time else "warning"}
    lines = [(kind, cell) for verdict, kind in kinds.items() for cell in by_cell(findings.of(verdict))]
    return [_annotation(kind, cell, pictures.get(cell[0].score["key"])) for kind, cell in lines[:_ANNOTATIONS]]


def _annotation(kind: str, cell: Sequence[Change], picture: Path | None) -> str:
    worst, *others = cell
    parts = [f"{worst.what} {value_text(worst.before)} → {value_text(worst.after)}"]
    parts += [f"{worst.excess:.1f} times its tolerance"] if not math.isinf(worst.excess) else []
    parts += [f"also {' '.join(one.what for one in others)}"] if others else []
    parts += [f"picture {picture}"] if picture else []
    title = _escaped(cell_name(worst.score)).replace(":", "%3A").replace(",", "%2C")
    return f"::{kind} title={title}::{_escaped('; '.join(parts))}"


def _escaped(text: str) -> str:
    return text.replace("%", "%25").replace("\r", "%0D").replace("\n", "%0A")
