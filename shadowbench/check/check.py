"""Computation behind `check`: comparison of a run folder with a baseline, difference pictures, and a new baseline."""

import json
import math
import re
import shlex
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from shadowbench.engines.difference import with_legend
from shadowbench.errors import InputError
from shadowbench.files import replace_file
from shadowbench.measure.flips import ROW_METRICS
from shadowbench.measure.pictures import write_picture
from shadowbench.measure.plugin_output import techniques_with
from shadowbench.measure.rows import SCHEMA, Record, Result, RunFile
from shadowbench.reports.gallery import difference, read_view
from shadowbench.reports.words import counted
from shadowbench.results.baseline import COMPARED, Change, Findings, compare
from shadowbench.results.folder import IDENTITY, Run, identity, read_runs
from shadowbench.scores.metrics import is_soft
from shadowbench.studies.crossing import Techniques
from shadowbench.studies.study import find_study, read_study


def write_baseline(results: Sequence[Result], folder: Path) -> None:
    """Write a baseline's `rows.jsonl` atomically: score records, then time records.

    Raises InputError if there is no cell, if a cell failed, and if the folder cannot be written.
    """
    if not results:
        raise InputError("--update: found no cell; allowed: a run whose last command measured one or more")
    failed = [result for result in results if result.status.startswith("failed")]
    if failed:
        first = f"{failed[0].score['scene']} {failed[0].score['spec']}: {failed[0].status}"
        raise InputError(
            f"--update: found {len(failed)} cells that failed, the first {first}; allowed: a run without failed cells"
        )
    # The command line is left out: it may name local paths, and comparisons do not use it.
    scores = [{name: value for name, value in result.score.items() if name != "command"} for result in results]
    records = [*scores, *(result.time for result in results if result.time)]
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"{folder}: cannot be created ({error.strerror or error})") from None
    with replace_file(folder / "rows.jsonl") as temporary:
        lines = (json.dumps({"schema": SCHEMA, **record}, allow_nan=False) + "\n" for record in records)
        temporary.write_text("".join(lines), encoding="utf-8")


def copy_study(about: RunFile, results: Sequence[Result], folder: Path, techniques: Techniques) -> Path | None:
    """Copy the study file named by a run's command to `study.toml` in a folder; about: the run's `run.json`.

    Returns the copied file; None if the command names none, if it is gone or copied already, or if the copy would not
    produce the run's cells, because of relative scene paths or other options of the command.
    """
    try:
        words = shlex.split(about.get("command", "").replace("--study=", "--study "))
    except ValueError:  # an unbalanced quote: not a command line of ours
        return None
    named = [value for option, value in pairwise(words) if option in ("-s", "--study")]
    if not named:
        return None
    file, kept = find_study(named[-1]), folder / "study.toml"
    if not file.is_file() or (kept.exists() and kept.samefile(file)) or not _makes(file, folder, results, techniques):
        return None
    with replace_file(kept) as temporary:
        temporary.write_bytes(file.read_bytes())
    return file


def _makes(file: Path, folder: Path, results: Sequence[Result], techniques: Techniques) -> bool:
    try:
        study, moved = read_study(file, techniques), read_study(file, techniques, folder)
    except InputError:  # changed since, or needs a plug-in
        return False
    rows = [result.score for result in results]
    soft = any(is_soft(row.get("metrics", {})) for row in rows)
    cells = {(cell.spec.full_text, cell.phase) for cell in moved.cells(soft)}
    return (
        moved.scenes == study.scenes
        and len(moved.scenes) == len({row["scene"] for row in rows})
        and cells == {(row["full_spec"], row["phase"]) for row in rows}
        and {moved.view_size} == {row["view_size"] for row in rows}
        and {moved.step} >= {row.get("step") for row in rows if row["status"] == "ok"}
    )


_PICTURES = 8  # most difference pictures
_UNSAFE = re.compile(r"[^\w.+=-]+")  # not allowed in file names everywhere
_GAP = 8  # white pixels between before and after


@dataclass(frozen=True, eq=False)
class CheckResult:
    """Result of comparing a run with a baseline.

    run: the cells of the folder's last command; baseline: None if there is none yet; failing: regressions, including
    slower cells if times count; notes: what could not be compared.
    """

    run: Run
    baseline: Run | None
    findings: Findings
    failing: tuple[Change, ...]
    notes: tuple[str, ...]


def check(
    folder: Path,
    baseline: Path,
    *,
    tolerances: Mapping[str, float] = {},
    time: bool = False,
    update: bool = False,
) -> CheckResult:
    """Compare the cells of a folder's last command with those of a baseline.

    tolerances: overrides by metric name; time: whether slower cells fail; update: whether the run is to become the
    baseline, which may then be missing but not be a run folder. Raises InputError for a folder that is no run or
    baseline, and if they have no cell in common.
    """
    (whole,) = read_runs([folder], None if update else COMPARED)
    run = whole.last
    reference_run = _baseline(baseline, update)
    findings = compare(run.results, reference_run.results if reference_run else (), tolerances)
    if findings.compared == 0 and not update:
        raise InputError(
            f"{folder} and {baseline} have no cell in common: {_differing_fields(run, reference_run)}; allowed: runs "
            "of the same scenes, specs, map sizes and view size"
        )
    failing = findings.with_verdict("regressed", times=False) + (
        findings.with_verdict("regressed", times=True) if time else []
    )
    notes = list(findings.notes)
    if time and not findings.timed:
        notes.append("no time was compared: the baseline has none of this machine, clock and reference")
    if whole.earlier:
        older = counted(len(whole.earlier), "cell")
        notes.append(f"{older} of earlier commands in {folder} left out; run.json lists those of the last")
    for one in (whole, reference_run):
        if one is not None and one.cut_off:
            notes.append(
                f"{one.folder / 'rows.jsonl'}: the last line is cut off and was ignored; its writer was stopped"
            )
    return CheckResult(run, reference_run, findings, tuple(failing), tuple(notes))


def _differing_fields(run: Run, baseline: Run | None) -> str:
    """Text on the identity fields in which no cell of a run agrees with any of the baseline."""
    sides = [zip(*(identity(row) for row in side.rows), strict=True) for side in (run, baseline) if side]
    fields = []
    for name, here, there in zip(("spec", *IDENTITY), *(map(set, side) for side in sides), strict=True):
        if here.isdisjoint(there):
            fields.append(f"{name} is {_values_of(here)} against {_values_of(there)}")
    return "; ".join(fields) or "each field has values in common, but no cell agrees in all of them"


def _values_of(found: set[Any]) -> str:
    texts = sorted(f"{one[0]}:{','.join(one[1:])}" if isinstance(one, tuple) else str(one) for one in found)
    return ", ".join(f"{text:.60}" for text in texts[:3]) + (", …" if len(texts) > 3 else "")


def _baseline(folder: Path, update: bool) -> Run | None:
    """Read the baseline; None if there is none yet. Raises InputError if `update` must not overwrite it."""
    if update:
        if (folder / "run.json").exists():
            allowed = "a folder of its own (rows.jsonl, study.toml), also a new one"
            raise InputError(f"--update: {folder} is a run folder, whose rows were measured; allowed: {allowed}")
        if not (folder / "rows.jsonl").exists():
            return None
    return read_runs([folder], COMPARED)[0]


def write_pictures(result: CheckResult) -> list[tuple[Path, bool]]:
    """Write difference pictures of the worst cells that have masks into the run's folder `check`.

    Returns each file, and whether it shows the baseline's difference beside the new one.
    """
    run, baseline = result.run, result.baseline
    if baseline is None:
        return []
    folder = run.folder / "check"
    for stale in folder.glob("*.png"):
        stale.unlink()
    before = {identity(result.score): result.score for result in baseline.results}
    regressed = result.findings.with_verdict("regressed", times=False)
    worst = {id(change.score): change.score for change in regressed if change.what in ROW_METRICS}.values()
    written: list[tuple[Path, bool]] = []
    for score in worst:
        if len(written) == _PICTURES:
            break
        after = _difference(run, score, run)
        if after is None:
            continue
        old = _difference(baseline, before[identity(score)], run)
        beside = old is not None and old.shape == after.shape
        parts = [old, np.full((len(after), _GAP, 3), 255, np.uint8), after] if beside and old is not None else [after]
        folder.mkdir(exist_ok=True)
        named = [str(len(written) + 1), *(str(score[part]) for part in ("scene", "spec", "map_size") if score[part])]
        file = folder / f"{_UNSAFE.sub('_', '.'.join(named)):.120}.png"
        picture = np.hstack(parts)
        write_picture(file, with_legend(picture) if is_soft(score["metrics"]) else picture)
        written.append((file, beside))
    return written


def _difference(run: Run, score: Record, traced: Run) -> NDArray[np.uint8] | None:
    """Difference picture of a cell's mask and the truth in a run folder; None if a file is missing."""
    view = ".".join(str(score[name]) for name in ("scene", "view", "light", "view_size"))
    mask, truth = run.folder / "masks" / f"{score['key']}.png", traced.folder / "truth" / f"{view}.png"
    undecided = truth.with_suffix(".undecided.png")
    if not (mask.exists() and truth.exists() and undecided.exists()):
        return None
    after, traced_view, doubtful = (read_view(file, score["view_size"]) for file in (mask, truth, undecided))
    return difference(after, traced_view, doubtful >= 0.5, is_soft(score["metrics"]))


def make_baseline(run: Run, folder: Path) -> Path | None:
    """Make a run the baseline. Returns the study file copied with it, if any. Raises InputError as `write_baseline`."""
    write_baseline(run.results, folder)
    return copy_study(run.about, run.results, folder, techniques_with(()))


def values(findings: Findings) -> dict[str, Any]:
    """JSON object of `check --json`."""
    return {
        "compared": findings.compared,
        "equal_masks": findings.equal,
        "timed": findings.timed,
        "regressed": _values(findings.with_verdict("regressed", times=False)),
        "improved": _values(findings.with_verdict("improved", times=False)),
        "slower": _values(findings.with_verdict("regressed", times=True)),
        "faster": _values(findings.with_verdict("improved", times=True)),
    }


def _values(changes: Sequence[Change]) -> list[dict[str, Any]]:
    named = ("scene", "view", "light", "phase", "technique", "spec", "full_spec", "map_size", "view_size")
    return [
        {
            **{name: change.score[name] for name in named},
            "what": change.what,
            "before": change.before,
            "after": change.after,
            "tolerances": None if math.isinf(change.excess) else change.excess,
        }
        for change in changes
    ]
