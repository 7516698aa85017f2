"""`check`: compare a run with a baseline; `--update` makes the run the baseline, `--repeat` compares two equal runs."""

import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from shadowbench.commands import console, options
from shadowbench.errors import InputError, alternatives, counted
from shadowbench.options import option

if TYPE_CHECKING:
    from shadowbench.results.baseline import Change, Findings, Verdict

_LINES = 40  # of a table, one per cell
_LONGEST = 40  # characters of a status


@dataclass(frozen=True)
class CheckOptions:
    """What a run is compared with, and how strictly."""

    baseline: Path | None = option("The baseline, or another run folder, to compare with  [only of --repeat].", "DIR")
    time: bool = options.flag("Also fail if a cell is slower, on the same machine.")
    update: bool = options.flag("Make this run the baseline, and print the changes.")
    repeat: bool = options.flag(
        "Instead, fail if two runs of one study on one machine rank cells differently by time, or differ in work: DIR "
        "and the baseline, or the last two times of each cell in DIR (`run --time-again`)."
    )
    tolerance: list[str] = option(
        "Tolerance of a metric, instead of its default; repeatable  [see `shadowbench list metrics`].",
        "METRIC=X",
        default=(),
    )
    plugin: list[Path] = options.plugins()


@options.command(
    "\b\nFor example\n"
    "  shadowbench check results/latest --baseline results/baseline\n"
    "  shadowbench check results/latest --baseline results/baseline --update\n"
    "  shadowbench run -s demo --time-again && shadowbench check results/latest --repeat"
)
def check(
    folder: Annotated[Path, options.argument("DIR", "The run folder to check.")],
    asked: CheckOptions,
    json: options.Json = False,
    quiet: options.Quiet = False,
) -> int:
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
    from shadowbench.measure.plugin_output import subjects_with, techniques_with
    from shadowbench.reports.check_pictures import write_pictures
    from shadowbench.results.baseline import check as compared
    from shadowbench.results.baseline import write_baseline
    from shadowbench.studies.study_copy import copy_study

    techniques_with(asked.plugin)  # whose metrics are compared too
    if asked.repeat:
        if asked.update or asked.time or asked.tolerance:
            raise InputError("--repeat: found --update, --time or --tolerance; allowed: without")
        return _check_repeat(folder, asked.baseline, json, quiet)
    if asked.baseline is None:
        raise InputError("check: found no --baseline; allowed: --baseline DIR, or --repeat")
    found = compared(folder, asked.baseline, _tolerances(asked.tolerance), asked.time, asked.update)
    findings = found.findings
    pictures = [] if asked.update else write_pictures(found)
    if json:
        files = [file for file, _ in pictures]
        console.print_json({**findings.json, "notes": findings.notes, "pictures": files})
    else:
        _print(findings, asked.baseline, asked.time)
    last = None
    if asked.update:
        write_baseline(found.run.results, asked.baseline)
        study = copy_study(found.run, asked.baseline, subjects_with(()))
        cells = counted(len(found.run.results), "cell")
        copied = f"; study.toml is a copy of {study}" if study else ""
        last = f"{asked.baseline / 'rows.jsonl'}: {cells}, the baseline from now on{copied}"
    elif pictures:
        what = "before and after" if any(before for _, before in pictures) else "after"
        many = f"{counted(len(pictures), 'picture')}, {what}"
        last = f"{pictures[0][0].parent}: {many}: false shadow orange, false light blue"
    if not quiet:
        for note in findings.notes:
            console.print_error(f"note: {note}")
        if last and not json:
            console.print_line(last)
    failed = findings.of("regressed") or (asked.time and findings.of("slower"))
    return 1 if failed and not asked.update else 0


def _tolerances(texts: Sequence[str]) -> dict[str, float]:
    """METRIC=X by metric; raises InputError for an unknown metric or an invalid tolerance."""
    from shadowbench.measure.flips import ROW_METRICS

    found = {}
    for text in texts:
        name, _, value = text.partition("=")
        if name not in ROW_METRICS:
            known = alternatives(name, ROW_METRICS, "allowed: METRIC=X, METRIC one of")
            raise InputError(f"--tolerance: found {text!r:.60}{known}")
        try:
            found[name] = float(value)
        except ValueError:
            found[name] = math.nan
        if not 0 <= found[name] < math.inf:
            raise InputError(f"--tolerance {name}: found {value!r:.40}; allowed: a number, 0 or more")
    return found


def _check_repeat(folder: Path, other: Path | None, json: bool, quiet: bool) -> int:
    """Compare two runs of a study, the other one first, and print the result; the exit code."""
    from shadowbench.results.repeat import LEAST_RATIO, LEAST_TAU, compare_folders

    found = compare_folders(folder) if other is None else compare_folders(other, folder)
    code = 0 if found.agrees else 1
    if json:
        rankings = [asdict(ranking) | {"tau": ranking.tau} for ranking in found.rankings]
        console.print_json({**asdict(found), "rankings": rankings, "holds": found.agrees})
        return code
    block, numbers = "scene, view, light, phase", ("cells", "pairs", "swapped", "τ", "τ of all pairs")
    rows = [
        (one.block, str(one.cells), str(one.sharp), str(one.swapped), *map(console.number, (one.tau, one.tau_of_all)))
        for one in found.rankings
    ]
    console.print_table("", (block, *numbers), rows, numbers=numbers, whole=(block,))
    for name in found.unequal:
        console.print_line(f"  work differs: {name}")
    if not quiet:
        agree = "at least" if found.rankings_agree else "not everywhere at least"
        console.print_line(
            f"τ: Kendall's tau over the pairs whose times differ by more than {100 * (LEAST_RATIO - 1):.0f}%, with "
            f"interquartile ranges that do not overlap, in both runs; {agree} {LEAST_TAU}"
        )
        equal = found.counted - len(found.unequal)
        console.print_line(f"work: exactly the same in {equal} of {found.counted} cells")
    return code


def _print(findings: "Findings", baseline: Path, time: bool) -> None:
    """A table of changes of each kind, and a summary."""
    from shadowbench.results.baseline import MISSING

    times = "; ratios to the reference" + ("" if time else "; a warning only (--time makes it fail)")
    titles: dict[Verdict, str] = {
        "regressed": "regressed, worst first",
        "slower": f"slower{times}",
        "improved": "improved, largest change first",
        "faster": f"faster{times}",
    }
    cells = {kind: _by_cell(findings.of(kind)) for kind in titles}
    for kind, title in titles.items():
        if cells[kind]:
            _print_changes(title, cells[kind])
    missing = sum(change.after == MISSING for change in findings.changes)
    if findings.compared or findings.changes:
        counts = {
            "regressed": len(cells["regressed"]) - missing,
            "missing": missing,
            "improved": len(cells["improved"]),
            "slower": len(cells["slower"]),
        }
        parts = [f"{count} {what}" for what, count in counts.items() if count or what in ("regressed", "improved")]
        same = f", {findings.equal} of them identical" if findings.equal else ""
        compared = f"{counted(findings.compared, 'cell')} compared with {baseline}{same}"
        console.print_line(f"{compared}: {', '.join(parts)}")


def _by_cell(changes: "Sequence[Change]") -> "list[list[Change]]":
    cells: dict[int, list[Change]] = {}  # by the record, which the changes of a cell share
    for change in changes:
        cells.setdefault(id(change.score), []).append(change)
    return list(cells.values())


def _print_changes(title: str, cells: "list[list[Change]]") -> None:
    """One line per cell: the largest change, and the names of the other changed values."""
    rows = []
    for worst, *others in cells[:_LINES]:
        score = worst.score
        phase = f" phase {score['phase']}" if score["phase"] else ""
        place = f"{score['scene']} {score['view']} {score['light']}{phase}"
        excess = "" if math.isinf(worst.excess) else f"{worst.excess:.1f}"
        also = " ".join(change.what for change in others)
        before, after = _value(worst.before), _value(worst.after)
        map_size = str(score["map_size"] or "")
        rows.append((place, score["spec"], map_size, worst.what, before, "→", after, excess, also))
    columns = ("scene, view, light", "spec", "map", "what", "before", "", "after", "× tolerance", "also")
    numbers = ("map", "before", "", "after", "× tolerance")
    console.print_table(title, columns, rows, numbers=numbers, whole=("what",))
    if len(cells) > _LINES:
        console.print_line(f"  and {len(cells) - _LINES} more; --json lists all")
    console.print_text("")


def _value(value: Any) -> str:
    if value is None:
        return "none"
    if isinstance(value, str):
        return value if len(value) <= _LONGEST else f"{value[: _LONGEST - 1]}…"
    return str(value) if isinstance(value, int) else console.number(value)
