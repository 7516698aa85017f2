"""`check`: compare a run with a baseline; `--update` makes the run the baseline."""

import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from shadowbench.commands import completion, console
from shadowbench.commands.options import Json, Quiet
from shadowbench.errors import InputError, alternatives

if TYPE_CHECKING:
    from shadowbench.check.baseline import Change, Findings

_LINES = 40  # of a table, one per cell
_LONGEST = 40  # characters of a status

app = typer.Typer()


@app.command(
    epilog="\b\nFor example\n"
    "  shadowbench check results/latest --baseline results/baseline\n"
    "  shadowbench check results/latest --baseline results/baseline --update"
)
def check(
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="The run folder to check.")],
    baseline: Annotated[
        Path, typer.Option(metavar="DIR", help="The baseline, or another run folder, to compare with.")
    ],
    time: Annotated[bool, typer.Option("--time", help="Also fail if a cell is slower, on the same machine.")] = False,
    update: Annotated[
        bool, typer.Option("--update", help="Make this run the baseline, and print the changes.")
    ] = False,
    tolerance: Annotated[
        list[str] | None,
        typer.Option(
            metavar="METRIC=X",
            autocompletion=completion.tolerance,
            help="Tolerance of a metric, instead of its default; repeatable  [see `shadowbench list metrics`].",
        ),
    ] = None,
    json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Fail if a run is worse than a baseline.

    Compares metrics, work and status of each cell with the baseline's cell of the same scene, view, light, phase, spec,
    map size and view size. Exit code 1 if a cell regressed or is missing, 2 if run and baseline share no cell.
    Difference pictures of the worst cells are written to DIR/check. Work is compared on the same renderer only: draws,
    primitives, texture reads, rays and GPU memory exactly, shader invocations within 2%. Times are compared on the same
    machine only, as ratios to the reference.

    \b
    Columns
      what         the metric, work counter or `status` that changed most
      × tolerance  the change as a multiple of the tolerance
      also         the other values of the cell that changed
    """
    from shadowbench.check.check import check as compared
    from shadowbench.check.check import make_baseline, values, write_pictures
    from shadowbench.reports.words import counted

    found = compared(folder, baseline, tolerances=_tolerances(tolerance or ()), time=time, update=update)
    pictures = [] if update else write_pictures(found)
    if json:
        files = [str(file) for file, _ in pictures]
        console.print_json({**values(found.findings), "notes": list(found.notes), "pictures": files})
    else:
        _print(found.findings, baseline, time)
    if not quiet:
        for note in found.notes:
            console.print_error(f"note: {note}")
    if update:
        study = make_baseline(found.run, baseline)
        if not json and not quiet:
            line = f"{baseline / 'rows.jsonl'}: {counted(len(found.run.results), 'cell')}, the baseline from now on"
            console.print_line(f"{line}; study.toml is a copy of {study}" if study else line)
        return
    if pictures and not json and not quiet:
        what = "before and after" if any(before for _, before in pictures) else "after"
        many = f"{counted(len(pictures), 'picture')}, {what}"
        console.print_line(f"{pictures[0][0].parent}: {many}: false shadow orange, false light blue")
    raise typer.Exit(1 if found.failing else 0)


def _tolerances(texts: Sequence[str]) -> dict[str, float]:
    """METRIC=X by metric; raises InputError for an unknown metric or an invalid tolerance."""
    from shadowbench.measure.flips import ROW_METRICS

    found = {}
    for text in texts:
        name, _, value = text.partition("=")
        try:
            tolerance = float(value)
        except ValueError:
            tolerance = math.nan
        if name not in ROW_METRICS:
            known = alternatives(name, ROW_METRICS, "allowed: METRIC=X, METRIC one of")
            raise InputError(f"--tolerance: found {text!r:.60}{known}")
        if not 0 <= tolerance < math.inf:
            raise InputError(f"--tolerance {name}: found {value!r:.40}; allowed: a number, 0 or more")
        found[name] = tolerance
    return found


def _print(findings: "Findings", baseline: Path, time: bool) -> None:
    times = "; ratios to the reference" + ("" if time else "; a warning only (--time makes it fail)")
    for title, changes in (
        ("regressed, worst first", findings.with_verdict("regressed", times=False)),
        (f"slower{times}", findings.with_verdict("regressed", times=True)),
        ("improved, largest change first", findings.with_verdict("improved", times=False)),
        (f"faster{times}", findings.with_verdict("improved", times=True)),
    ):
        if changes:
            _print_changes(title, changes)
    if findings.compared or findings.changes:
        console.print_line(_summary(findings, baseline))


def _summary(findings: "Findings", baseline: Path) -> str:
    from shadowbench.check.baseline import MISSING
    from shadowbench.reports.words import counted

    missing = [change for change in findings.changes if change.after == MISSING]
    counts = {
        "regressed": len(_by_cell(findings.with_verdict("regressed", times=False))) - len(missing),
        "missing": len(missing),
        "improved": len(_by_cell(findings.with_verdict("improved", times=False))),
        "slower": len(_by_cell(findings.with_verdict("regressed", times=True))),
    }
    parts = [f"{count} {what}" for what, count in counts.items() if count or what in ("regressed", "improved")]
    same = f", {findings.equal} of them identical" if findings.equal else ""
    return f"{counted(findings.compared, 'cell')} compared with {baseline}{same}: {', '.join(parts)}"


def _by_cell(changes: "Sequence[Change]") -> "list[list[Change]]":
    cells: dict[int, list[Change]] = {}  # by the record, which the changes of a cell share
    for change in changes:
        cells.setdefault(id(change.score), []).append(change)
    return list(cells.values())


def _print_changes(title: str, changes: "list[Change]") -> None:
    """One line per cell: the largest change, and the names of the other changed values."""
    cells = _by_cell(changes)
    columns = ("scene, view, light", "spec", "map", "what", "before", "", "after", "× tolerance", "also")
    rows = [_line(worst, others) for worst, *others in cells[:_LINES]]
    numbers = ("map", "before", "", "after", "× tolerance")
    console.print_table(title, columns, rows, numbers=numbers, whole=("what",))
    if len(cells) > _LINES:
        console.print_line(f"  and {len(cells) - _LINES} more; --json lists all")
    console.out().print()


def _line(worst: "Change", others: "list[Change]") -> list[str]:
    score = worst.score
    place = f"{score['scene']} {score['view']} {score['light']}"
    return [
        f"{place} phase {score['phase']}" if score["phase"] else place,
        score["spec"],
        str(score["map_size"] or ""),
        worst.what,
        _value(worst.before),
        "→",
        _value(worst.after),
        "" if math.isinf(worst.excess) else f"{worst.excess:.1f}",
        " ".join(change.what for change in others),
    ]


def _value(value: Any) -> str:
    if value is None:
        return "none"
    if isinstance(value, str):
        return value if len(value) <= _LONGEST else f"{value[: _LONGEST - 1]}…"
    return str(value) if isinstance(value, int) else console.number(value)
