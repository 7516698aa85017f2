"""`check`: compare a run with a baseline; `--update` makes the run the baseline, `--repeat` compares two equal runs."""

import dataclasses
import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from shadowbench.commands import completion, console
from shadowbench.commands.options import Json, Plugins, Quiet
from shadowbench.errors import InputError, alternatives, counted

if TYPE_CHECKING:
    from shadowbench.results.baseline import Change, Findings
    from shadowbench.results.folder import Run
    from shadowbench.results.repeat import RepeatResult

_LINES = 40  # of a table, one per cell
_LONGEST = 40  # characters of a status

app = typer.Typer()


@app.command(
    epilog="\b\nFor example\n"
    "  shadowbench check results/latest --baseline results/baseline\n"
    "  shadowbench check results/latest --baseline results/baseline --update\n"
    "  shadowbench run -s demo --time-again && shadowbench check results/latest --repeat"
)
def check(
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="The run folder to check.")],
    baseline: Annotated[
        Path | None,
        typer.Option(metavar="DIR", help="The baseline, or another run folder, to compare with  [only of --repeat]."),
    ] = None,
    time: Annotated[bool, typer.Option("--time", help="Also fail if a cell is slower, on the same machine.")] = False,
    update: Annotated[
        bool, typer.Option("--update", help="Make this run the baseline, and print the changes.")
    ] = False,
    repeat: Annotated[
        bool,
        typer.Option(
            "--repeat",
            help="Instead, fail if two runs of one study on one machine rank cells differently by time, or differ in "
            "work: DIR and the baseline, or the last two times of each cell in DIR (`run --time-again`).",
        ),
    ] = False,
    tolerance: Annotated[
        list[str] | None,
        typer.Option(
            metavar="METRIC=X",
            autocompletion=completion.tolerance,
            help="Tolerance of a metric, instead of its default; repeatable  [see `shadowbench list metrics`].",
        ),
    ] = None,
    plugin: Plugins = None,
    json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Fail if a run is worse than a baseline.

    Compares metrics, work and status of each cell with the baseline's cell of the same scene, view, light, phase, spec,
    map size and view size. Exit code 1 if a cell regressed or is missing, 2 if run and baseline share no cell.
    Difference pictures of the worst cells are written to DIR/check. Work is compared on the same renderer only: draws,
    primitives, texture reads, rays and GPU memory exactly, shader invocations within 2%. Times are compared on the same
    machine only, as ratios to the reference.

    With --repeat, exit code 1 if Kendall's tau of any ranking is below 0.95, or if work differs.

    \b
    Columns
      what         the metric, work counter or `status` that changed most
      × tolerance  the change as a multiple of the tolerance
      also         the other values of the cell that changed

    \b
    Columns of --repeat
      cells           cells with a time in both runs
      pairs           pairs of cells whose times differ significantly in both runs
      swapped         pairs that the two runs order differently
      τ               Kendall's tau over these pairs; 1 is the same order
      τ of all pairs  Kendall's tau over all pairs, noise included
    """
    from shadowbench.measure.plugin_output import techniques_with

    techniques_with(plugin or ())  # whose metrics are compared too
    if repeat:
        if update or time or tolerance:
            raise InputError("--repeat: found --update, --time or --tolerance; allowed: without")
        raise typer.Exit(_repeated(folder, baseline, json, quiet))
    if baseline is None:
        raise InputError("check: found no --baseline; allowed: --baseline DIR, or --repeat")
    from shadowbench.reports.check_pictures import write_pictures
    from shadowbench.results.baseline import check as compared

    found = compared(folder, baseline, _tolerances(tolerance or ()), time, update)
    findings = found.findings
    pictures = [] if update else write_pictures(found)
    if json:
        files = [str(file) for file, _ in pictures]
        console.print_json({**findings.json, "notes": list(findings.notes), "pictures": files})
    else:
        _print(findings, baseline, time)
    for note in () if quiet else findings.notes:
        console.print_error(f"note: {note}")
    last = _update(found.run, baseline) if update else _pictures_line(pictures)
    if last and not json and not quiet:
        console.print_line(last)
    failed = findings.of("regressed") or (time and findings.of("slower"))
    raise typer.Exit(1 if failed and not update else 0)


def _update(run: "Run", baseline: Path) -> str:
    """Make a run the baseline; returns the line that says so."""
    from shadowbench.measure.plugin_output import techniques_with
    from shadowbench.results.baseline import write_baseline
    from shadowbench.studies.study_copy import copy_study

    write_baseline(run.results, baseline)
    study = copy_study(run, baseline, techniques_with(()))
    line = f"{baseline / 'rows.jsonl'}: {counted(len(run.results), 'cell')}, the baseline from now on"
    return f"{line}; study.toml is a copy of {study}" if study else line


def _pictures_line(pictures: Sequence[tuple[Path, bool]]) -> str | None:
    if not pictures:
        return None
    what = "before and after" if any(before for _, before in pictures) else "after"
    many = f"{counted(len(pictures), 'picture')}, {what}"
    return f"{pictures[0][0].parent}: {many}: false shadow orange, false light blue"


def _repeated(folder: Path, other: Path | None, json: bool, quiet: bool) -> int:
    """Compare two runs of a study, the other one first; the exit code."""
    from shadowbench.results.repeat import compare_folders

    found = compare_folders(folder) if other is None else compare_folders(other, folder)
    if json:
        rankings = [dataclasses.asdict(ranking) | {"tau": ranking.tau} for ranking in found.rankings]
        console.print_json({**dataclasses.asdict(found), "rankings": rankings, "holds": found.agrees})
    else:
        _print_repeated(found, quiet)
    return 0 if found.agrees else 1


def _print_repeated(found: "RepeatResult", quiet: bool) -> None:
    from shadowbench.results.repeat import LEAST_RATIO, LEAST_TAU

    block, numbers = "scene, view, light, phase", ("cells", "pairs", "swapped", "τ", "τ of all pairs")
    rows = []
    for one in found.rankings:
        taus = (console.number(tau) for tau in (one.tau, one.tau_of_all))
        rows.append((one.block, str(one.cells), str(one.sharp), str(one.swapped), *taus))
    console.print_table("", (block, *numbers), rows, numbers=numbers, whole=(block,))
    for name in found.unequal:
        console.print_line(f"  work differs: {name}")
    if quiet:
        return
    apart = f"{100 * (LEAST_RATIO - 1):.0f}%"
    console.print_line(
        f"τ: Kendall's tau over the pairs whose times differ by more than {apart}, with interquartile ranges that do "
        f"not overlap, in both runs; {'at least' if found.rankings_agree else 'not everywhere at least'} {LEAST_TAU}"
    )
    console.out().print(f"work: exactly the same in {found.counted - len(found.unequal)} of {found.counted} cells")


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
        ("regressed, worst first", findings.of("regressed")),
        (f"slower{times}", findings.of("slower")),
        ("improved, largest change first", findings.of("improved")),
        (f"faster{times}", findings.of("faster")),
    ):
        if changes:
            _print_changes(title, changes)
    if findings.compared or findings.changes:
        console.print_line(_summary(findings, baseline))


def _summary(findings: "Findings", baseline: Path) -> str:
    from shadowbench.results.baseline import MISSING

    missing = [change for change in findings.changes if change.after == MISSING]
    counts = {
        "regressed": len(_by_cell(findings.of("regressed"))) - len(missing),
        "missing": len(missing),
        "improved": len(_by_cell(findings.of("improved"))),
        "slower": len(_by_cell(findings.of("slower"))),
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
