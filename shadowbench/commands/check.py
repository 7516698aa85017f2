"""`check`: what got worse since a baseline, and `--update`, which makes this run the baseline."""

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rich.markup import escape
from rich.table import Table

from shadowbench.check.baseline import MISSING, Change, Findings, compare, identity
from shadowbench.check.blessing import bless, bless_study
from shadowbench.commands.console import err, number, out, print_json, print_table, techniques_with
from shadowbench.errors import InputError, alternatives
from shadowbench.measure.pictures import write_picture
from shadowbench.measure.rows import Record
from shadowbench.reports.folder import Run, read_runs
from shadowbench.reports.gallery import difference, read_view
from shadowbench.reports.words import counted
from shadowbench.scores.metrics import METRICS

_LINES = 40  # of a table, a cell each
_PICTURES = 8  # of the cells that are worst
_LONGEST = 40  # letters of a status
_FOREIGN = re.compile(r"[^\w.+=-]+")  # not every file system takes it
_GAP = 8  # white pixels between before and after


@dataclass(frozen=True)
class CheckOptions:
    """What the command line says. `time` makes slower cells count; `tolerances` are METRIC=X."""

    folder: Path
    baseline: Path
    time: bool
    update: bool
    tolerances: tuple[str, ...]


def check_command(options: CheckOptions, *, as_json: bool, quiet: bool) -> int:
    """Compare, print what changed, write pictures of the worst; 1 if something regressed and was not blessed."""
    tolerances = _tolerances(options.tolerances)
    whole = read_runs([options.folder])[0]
    run = replace(whole, rows=tuple(row for row in whole.rows if row["key"] not in whole.earlier))
    baseline = _baseline(options)
    findings = compare(run.results, baseline.results if baseline else (), tolerances)
    if findings.compared == 0 and not options.update:
        raise InputError(
            f"{options.folder} and {options.baseline} have no cell in common; allowed: runs of the same scenes, specs, "
            "map sizes and view size"
        )
    regressed = findings.of("regressed", times=False)
    failing = regressed + (findings.of("regressed", times=True) if options.time else [])
    pictures = _write_pictures(run, baseline, regressed) if baseline and not options.update else []
    notes = [*findings.notes, *_untimed(findings, options)]
    if whole.earlier:
        older = counted(len(whole.earlier), "cell")
        notes.append(f"{older} of earlier commands in {options.folder} left out; run.json lists those of the last")
    if as_json:
        print_json(_as_json(findings, notes, pictures))
    else:
        _print(findings, options)
    if not quiet:
        for note in notes:
            err.print(f"note: {note}", markup=False, soft_wrap=True)
    if options.update:
        said = _update(options, run)
        if not as_json and not quiet:
            out.print(said, markup=False, soft_wrap=True)
        return 0
    if pictures and not as_json and not quiet:
        what = "before and after" if any(before for _, before in pictures) else "after"
        many = f"{counted(len(pictures), 'picture')}, {what}"
        line = f"{pictures[0][0].parent}: {many}: false shadow orange, false light blue"
        out.print(line, markup=False, soft_wrap=True)
    return 1 if failing else 0


def _tolerances(texts: Sequence[str]) -> dict[str, float]:
    """METRIC=X by metric; raises InputError for a metric that is not in the table and for what is no tolerance."""
    found = {}
    for text in texts:
        name, _, value = text.partition("=")
        try:
            tolerance = float(value)
        except ValueError:
            tolerance = math.nan
        if name not in METRICS:
            known = alternatives(name, METRICS, "allowed: METRIC=X, METRIC one of")
            raise InputError(f"--tolerance: found {text!r:.60}{known}")
        if not 0 <= tolerance < math.inf:
            raise InputError(f"--tolerance {name}: found {value!r:.40}; allowed: a number, 0 or more")
        found[name] = tolerance
    return found


def _baseline(options: CheckOptions) -> Run | None:
    """The baseline; None for the first that is blessed. Raises InputError for one that may not be overwritten."""
    if options.update:
        if (options.baseline / "run.json").exists():
            allowed = "a folder of its own (rows.jsonl, study.toml), also a new one"
            raise InputError(
                f"--update: {options.baseline} is a run folder, whose rows were measured; allowed: {allowed}"
            )
        if not (options.baseline / "rows.jsonl").exists():
            return None
    return read_runs([options.baseline])[0]


def _untimed(findings: Findings, options: CheckOptions) -> list[str]:
    if not options.time or findings.timed:
        return []
    return ["no time was compared: the baseline has none of this machine, clock and reference"]


def _print(findings: Findings, options: CheckOptions) -> None:
    times = "; ratios to the reference" + ("" if options.time else ", warnings only (--time makes them count)")
    for title, changes in (
        ("regressed, worst first", findings.of("regressed", times=False)),
        (f"slower{times}", findings.of("regressed", times=True)),
        ("improved, most first", findings.of("improved", times=False)),
        (f"faster{times}", findings.of("improved", times=True)),
    ):
        if changes:
            _print_changes(title, changes)
    if findings.compared or findings.changes:
        out.print(_summary(findings, options.baseline), markup=False, soft_wrap=True)


def _summary(findings: Findings, baseline: Path) -> str:
    missing = [change for change in findings.changes if change.after == MISSING]
    regressed = _cells(findings.of("regressed", times=False)) - len(missing)
    counts = {
        "regressed": regressed,
        "missing": len(missing),
        "improved": _cells(findings.of("improved", times=False)),
        "slower": _cells(findings.of("regressed", times=True)),
    }
    said = [f"{count} {what}" for what, count in counts.items() if count or what in ("regressed", "improved")]
    same = f", {findings.equal} of them by equal masks" if findings.equal else ""
    return f"{counted(findings.compared, 'cell')} compared with {baseline}{same}: {', '.join(said)}"


def _print_changes(title: str, changes: list[Change]) -> None:
    """A line for each cell: what changed most, and the names of what else did."""
    cells: dict[tuple[Any, ...], list[Change]] = {}
    for change in changes:
        cells.setdefault(identity(change.score), []).append(change)
    table = Table(title=title, title_justify="left", box=None, pad_edge=False)
    table.add_column("scene, view, light")
    table.add_column("spec")
    table.add_column("map", justify="right", no_wrap=True)
    table.add_column("what", no_wrap=True)
    for heading in ("before", "", "after", "× tolerance"):
        table.add_column(heading, justify="right", no_wrap=True)
    table.add_column("also")
    for worst, *others in list(cells.values())[:_LINES]:
        score = worst.score
        place = f"{score['scene']} {score['view']} {score['light']}"
        table.add_row(
            f"{place} phase {score['phase']}" if score["phase"] else place,
            escape(score["spec"]),
            str(score["map_size"] or ""),
            worst.what,
            escape(_value(worst.before)),
            "→",
            escape(_value(worst.after)),
            "" if math.isinf(worst.excess) else f"{worst.excess:.1f}",
            " ".join(change.what for change in others),
        )
    print_table(table)
    if len(cells) > _LINES:
        out.print(f"  and {len(cells) - _LINES} more; --json has all", soft_wrap=True)
    out.print()


def _value(value: Any) -> str:
    if value is None:
        return "none"
    if isinstance(value, str):
        return value if len(value) <= _LONGEST else f"{value[: _LONGEST - 1]}…"
    return str(value) if isinstance(value, int) else number(value)


def _cells(changes: Sequence[Change]) -> int:
    return len({identity(change.score) for change in changes})


def _as_json(findings: Findings, notes: Sequence[str], pictures: Sequence[tuple[Path, bool]]) -> dict[str, Any]:
    return {
        "compared": findings.compared,
        "equal_masks": findings.equal,
        "timed": findings.timed,
        "regressed": [_change_as_json(change) for change in findings.of("regressed", times=False)],
        "improved": [_change_as_json(change) for change in findings.of("improved", times=False)],
        "slower": [_change_as_json(change) for change in findings.of("regressed", times=True)],
        "faster": [_change_as_json(change) for change in findings.of("improved", times=True)],
        "notes": list(notes),
        "pictures": [str(file) for file, _ in pictures],
    }


def _change_as_json(change: Change) -> dict[str, Any]:
    named = ("scene", "view", "light", "phase", "technique", "spec", "full_spec", "map_size", "view_size")
    return {
        **{name: change.score[name] for name in named},
        "what": change.what,
        "before": change.before,
        "after": change.after,
        "tolerances": None if math.isinf(change.excess) else change.excess,
    }


def _write_pictures(run: Run, baseline: Run, regressed: Sequence[Change]) -> list[tuple[Path, bool]]:
    """DIR/check/: the signed differences of the worst cells that have masks; whether each shows the one before too."""
    folder = run.folder / "check"
    for stale in folder.glob("*.png"):
        stale.unlink()
    before = {identity(result.score): result.score for result in baseline.results}
    worst = {identity(change.score): change.score for change in regressed if change.what in METRICS}
    written: list[tuple[Path, bool]] = []
    for key, score in worst.items():
        after = _difference(run, score, run)
        if after is None or len(written) == _PICTURES:
            continue
        old = _difference(baseline, before[key], run)
        beside = old is not None and old.shape == after.shape
        parts = [old, np.full((len(after), _GAP, 3), 255, np.uint8), after] if beside and old is not None else [after]
        folder.mkdir(exist_ok=True)
        named = [str(len(written) + 1), *(str(score[part]) for part in ("scene", "spec", "map_size") if score[part])]
        file = folder / f"{_FOREIGN.sub('_', '.'.join(named)):.120}.png"
        write_picture(file, np.hstack(parts))
        written.append((file, beside))
    return written


def _difference(run: Run, score: Record, traced: Run) -> NDArray[np.uint8] | None:
    """A cell's mask against the truth of a run; None where a file is lacking."""
    view = ".".join(str(score[name]) for name in ("scene", "view", "light", "view_size"))
    mask, truth = run.folder / "masks" / f"{score['key']}.png", traced.folder / "truth" / f"{view}.png"
    undecided = truth.with_suffix(".undecided.png")
    if not (mask.exists() and truth.exists() and undecided.exists()):
        return None
    after, traced_view, doubtful = (read_view(file, score["view_size"]) for file in (mask, truth, undecided))
    return difference(after, traced_view, doubtful >= 0.5)


def _update(options: CheckOptions, run: Run) -> str:
    """Make the run the baseline; says what was written."""
    bless(run.results, options.baseline)
    line = f"{options.baseline / 'rows.jsonl'}: {counted(len(run.results), 'cell')}, the baseline from now on"
    study = bless_study(run.about, run.results, options.baseline, techniques_with(()))
    return f"{line}; study.toml is {study}" if study else line
