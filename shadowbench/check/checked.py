"""What `check` computes: a run folder held against a baseline, pictures of what got worse, and a new baseline."""

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from shadowbench.check.baseline import Change, Findings, compare
from shadowbench.check.blessing import bless, bless_study
from shadowbench.errors import InputError
from shadowbench.measure.pictures import write_picture
from shadowbench.measure.plugin_output import techniques_with
from shadowbench.measure.rows import Record
from shadowbench.reports.gallery import difference, read_view
from shadowbench.reports.words import counted
from shadowbench.scores.metrics import METRICS
from shadowbench.studies.folder import Run, identity, read_runs

_PICTURES = 8  # of the cells that are worst
_FOREIGN = re.compile(r"[^\w.+=-]+")  # not every file system takes it
_GAP = 8  # white pixels between before and after


@dataclass(frozen=True, eq=False)
class Checked:
    """A run held against a baseline.

    run: the cells of the folder's last command; baseline: None for the first that is blessed; failing: what regressed,
    slower cells among it where times count; notes: what could not be compared.
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
) -> Checked:
    """Compare the cells of a folder's last command with those of a baseline.

    tolerances: by metric, in place of the metrics' own; time: whether slower cells fail too; update: whether the run is
    to become the baseline, which may then be new, and no folder of a run. Raises InputError for what is no run or
    baseline, and for two without a cell in common.
    """
    whole = read_runs([folder])[0]
    run = replace(whole, rows=tuple(row for row in whole.rows if row["key"] not in whole.earlier))
    then = _baseline(baseline, update)
    findings = compare(run.results, then.results if then else (), tolerances)
    if findings.compared == 0 and not update:
        raise InputError(
            f"{folder} and {baseline} have no cell in common; allowed: runs of the same scenes, specs, "
            "map sizes and view size"
        )
    failing = findings.of("regressed", times=False) + (findings.of("regressed", times=True) if time else [])
    notes = list(findings.notes)
    if time and not findings.timed:
        notes.append("no time was compared: the baseline has none of this machine, clock and reference")
    if whole.earlier:
        older = counted(len(whole.earlier), "cell")
        notes.append(f"{older} of earlier commands in {folder} left out; run.json lists those of the last")
    return Checked(run, then, findings, tuple(failing), tuple(notes))


def _baseline(folder: Path, update: bool) -> Run | None:
    """The baseline; None for the first that is blessed. Raises InputError for one that may not be overwritten."""
    if update:
        if (folder / "run.json").exists():
            allowed = "a folder of its own (rows.jsonl, study.toml), also a new one"
            raise InputError(f"--update: {folder} is a run folder, whose rows were measured; allowed: {allowed}")
        if not (folder / "rows.jsonl").exists():
            return None
    return read_runs([folder])[0]


def write_pictures(checked: Checked) -> list[tuple[Path, bool]]:
    """Signed differences of the worst cells that have masks, in the run's folder `check`.

    Returns each file, and whether it shows the difference of before too.
    """
    run, baseline = checked.run, checked.baseline
    if baseline is None:
        return []
    folder = run.folder / "check"
    for stale in folder.glob("*.png"):
        stale.unlink()
    before = {identity(result.score): result.score for result in baseline.results}
    regressed = checked.findings.of("regressed", times=False)
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


def make_baseline(run: Run, folder: Path) -> Path | None:
    """Make a run the baseline, and return the study file that went with it, None for none; InputError as `bless`."""
    bless(run.results, folder)
    return bless_study(run.about, run.results, folder, techniques_with(()))


def values(findings: Findings) -> dict[str, Any]:
    """What a check found, as JSON has it."""
    return {
        "compared": findings.compared,
        "equal_masks": findings.equal,
        "timed": findings.timed,
        "regressed": _values(findings.of("regressed", times=False)),
        "improved": _values(findings.of("improved", times=False)),
        "slower": _values(findings.of("regressed", times=True)),
        "faster": _values(findings.of("improved", times=True)),
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
