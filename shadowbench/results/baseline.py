"""Comparison of a run with a baseline: cells are matched by identity, metrics compared by their tolerances.

Scores are compared if both sides have them, work counts on the same renderer only, times on the same machine only.
"""

import json
import math
import shutil
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal, get_args

from shadowbench.errors import InputError, counted
from shadowbench.files import make_folder, replace_file
from shadowbench.measure.columns import ROW_METRICS
from shadowbench.measure.rows import SCHEMA, Record, Result, driver_of
from shadowbench.results.frame import IDENTITY, Run, identity, read_runs

EXACT = ("draws", "primitives", "gpu_bytes", "reads", "rays")  # work counts that are deterministic on a renderer
INVOCATIONS = 0.02  # relative tolerance of other counts: drivers differ in helper invocations of quads
TIME_FACTOR = 1.1  # smallest change of a time ratio that is reported
SIGNIFICANT = 3.0  # standard errors
MISSING = "missing"  # status of a cell that was not run

Verdict = Literal["regressed", "improved", "slower", "faster"]


@dataclass(frozen=True, slots=True)
class Change:
    """A value of a cell that changed by more than its tolerance.

    what: a metric, `status`, a work count, or `time`; excess: the change in units of the tolerance, by which changes
    are sorted; score: the cell's new score record, or the baseline's if the cell is missing.
    """

    score: Record
    what: str
    before: Any
    after: Any
    verdict: Verdict
    excess: float = math.inf


@dataclass(frozen=True)
class Findings:
    """Changes that a check saw, largest first.

    compared: number of cells in both runs; equal: those with the same mask and scores; timed: those with comparable
    times; notes: what could not be compared, and cells that the baseline lacks.
    """

    changes: tuple[Change, ...]
    compared: int
    equal: int
    timed: int
    notes: tuple[str, ...] = ()

    def of(self, verdict: Verdict) -> list[Change]:
        """Changes with a verdict: `slower` or `faster` in times, `regressed` or `improved` in anything else."""
        return [change for change in self.changes if change.verdict == verdict]

    def json(self, pictures: Mapping[str, Path]) -> dict[str, Any]:
        """JSON object of `check --json`; pictures: files by the key of a row, of changes that are regressions."""
        named = (*IDENTITY, "technique", "spec", "full_spec")
        values: dict[str, Any] = {"compared": self.compared, "equal_masks": self.equal, "timed": self.timed}
        for verdict in get_args(Verdict):
            values[verdict] = [
                {
                    **{name: change.score[name] for name in named},
                    "what": change.what,
                    "before": change.before,
                    "after": change.after,
                    "tolerances": None if math.isinf(change.excess) else change.excess,
                    **({"picture": pictures.get(change.score["key"])} if verdict == "regressed" else {}),
                }
                for change in self.of(verdict)
            ]
        return values | {"notes": self.notes, "pictures": list(pictures.values())}


def check(
    folder: Path, baseline: Path, tolerances: Mapping[str, float] = {}, time: bool = False, update: bool = False
) -> tuple[Findings, Run, Run | None]:
    """Compare the cells of a folder's last command with a baseline's; both are returned too, None for a new baseline.

    tolerances: overrides by metric name; time: whether times count; update: whether the run is to become the baseline,
    which may then be missing but not be a run folder. Raises InputError for a folder that is no run or baseline, and if
    they have no cell in common.
    """
    if update and (baseline / "run.json").exists():
        allowed = "a folder of its own (rows.jsonl, study.toml), also a new one"
        raise InputError(f"--update: {baseline} is a run folder, whose rows were measured; allowed: {allowed}")
    (whole,) = read_runs([folder])
    first = update and not (baseline / "rows.jsonl").exists()
    before = None if first else read_runs([baseline])[0]
    run = whole.last
    findings = compare(run.results, before.results if before else (), tolerances)
    if before and findings.compared == 0 and not update:
        raise InputError(
            f"{folder} and {baseline} have no cell in common: {_differing_fields(run, before)}; allowed: runs "
            "of the same scenes, specs, map sizes and view size"
        )
    notes = list(findings.notes)
    if time and not findings.timed:
        notes.append("no time was compared: the baseline has none of this machine, clock and reference")
    if whole.earlier:
        older = counted(len(whole.earlier), "cell")
        notes.append(f"{older} of earlier commands in {folder} left out; run.json lists those of the last")
    notes += [
        f"{one.folder / 'rows.jsonl'}: the last line is cut off and was ignored; its writer was stopped"
        for one in filter(None, (whole, before))
        if one.cut_off
    ]
    return replace(findings, notes=tuple(notes)), run, before


def _differing_fields(*runs: Run) -> str:
    """The fields of a cell's identity in which no cell of a run agrees with any of the other, with some values."""
    fields = []
    for name in ("full_spec", *IDENTITY):
        here, there = (sorted({str(row[name]) for row in run.rows}) for run in runs)
        if set(here).isdisjoint(there):
            fields.append(f"{name.removeprefix('full_')} is {', '.join(here[:3])} against {', '.join(there[:3])}")
    return "; ".join(fields) or "each field has values in common, but no cell agrees in all of them"


def compare(results: Sequence[Result], baseline: Sequence[Result], tolerances: Mapping[str, float] = {}) -> Findings:
    """Compare every cell of the baseline with the cell of the same identity; tolerances: overrides by metric name."""
    now, then = ({identity(result.score): result for result in side} for side in (results, baseline))
    left_out, notes = _not_compared(results, baseline)
    allowed = {name: tolerances.get(name, one.tolerance) for name, one in ROW_METRICS.items() if name not in left_out}
    pairs = [(old, now[key]) for key, old in then.items() if key in now]
    changes = [
        Change(old.score, "status", old.status, MISSING, "regressed") for key, old in then.items() if key not in now
    ]
    changes += [change for old, new in pairs for change in _changes(old, new, allowed)]
    changes.sort(key=lambda change: (-change.excess, change.what != "status"))
    if extra := len(now.keys() - then.keys()):
        notes.append(f"{counted(extra, 'cell')} {'is' if extra == 1 else 'are'} not in the baseline")
    drawn = [(old, new) for old, new in pairs if old.score["status"] == new.score["status"] == "ok"]
    equal = sum(_same_mask(old.score, new.score, allowed) for old, new in drawn)
    timed = sum(comparable(old, new) for old, new in drawn)
    return Findings(tuple(changes), len(pairs), equal, timed, tuple(notes))


def _changes(old: Result, new: Result, allowed: Mapping[str, float]) -> Iterator[Change]:
    """Changes of a cell. A different reason of failure is none."""
    before, after = old.score["status"], new.score["status"]
    if before == after == "ok":
        yield from _metrics(old.score, new.score, allowed)
        yield from _work(old, new)
        yield from _time(old, new)
    elif "ok" in (before, after):
        yield Change(new.score, "status", before, after, "regressed" if before == "ok" else "improved")


def _not_compared(*sides: Sequence[Result]) -> tuple[set[str], list[str]]:
    """Names of metrics that are not compared, and notes on them, and on work."""
    metrics = [set().union(*(result.score.get("metrics", {}) for result in side)) for side in sides]
    lacking = [name for name in ROW_METRICS if name in metrics[0] ^ metrics[1]] if all(metrics) else []
    unknown = sorted(set().union(*metrics).difference(ROW_METRICS))
    drivers = sorted({_driver(result) for side in sides for result in side})
    reasons = (
        (len(drivers) > 1, f"work is not compared across renderers: {' · '.join(drivers)}"),
        (lacking, f"not compared, since one side lacks them: {', '.join(lacking)}"),
        (unknown, f"not compared, since their plug-in is not loaded: {', '.join(unknown)}"),
    )
    return set(lacking), [note for holds, note in reasons if holds]


def _driver(result: Result) -> str:
    """The renderer without its arithmetic, which changes single fragments only."""
    return driver_of(str(result.score.get("renderer")))


def _same_mask(old: Record, new: Record, names: Iterable[str]) -> bool:
    """Whether masks and common scores are equal; an equal mask may have been scored against another truth."""
    if old.get("mask_sha256") is None or old["mask_sha256"] != new.get("mask_sha256"):
        return False
    before, after = old["metrics"], new["metrics"]
    return before == after or all(before[name] == after.get(name) for name in names if name in before)


def _metrics(old: Record, new: Record, allowed: Mapping[str, float]) -> Iterator[Change]:
    then, now = old["metrics"], new["metrics"]
    for name, tolerance in allowed.items():
        before, after = then.get(name), now.get(name)
        if before is not None and after is not None:
            worse = ROW_METRICS[name].worse(before, after)
            if abs(worse) > tolerance:
                verdict: Verdict = "regressed" if worse > 0 else "improved"
                yield Change(new, name, before, after, verdict, abs(worse) / max(tolerance, 1e-12))
        elif name in then and before is not after:  # the truth changed, a mask lost all its edges, or a row is broken
            yield Change(new, name, before, after, "regressed")


def _work(old: Result, new: Result) -> Iterator[Change]:
    """Changes of work counts, on the same renderer."""
    if _driver(old) != _driver(new):
        return
    before, after = ({**one.score.get("work", {}), "gpu_bytes": one.score.get("gpu_bytes")} for one in (old, new))
    for name in before.keys() & after.keys() - {"cost"}:  # the sum of others
        one, other = before[name], after[name]
        if one is not None and other is not None and abs(other - one) > (0 if name in EXACT else INVOCATIONS * one):
            verdict: Verdict = "regressed" if other > one else "improved"
            yield Change(new.score, name, one, other, verdict, abs(other - one) / max(INVOCATIONS * one, 1.0))


def comparable(old: Result, new: Result) -> bool:
    """Whether both have a ratio to the same reference on the same machine and clock."""
    before, after = old.time or {}, new.time or {}
    same = ("machine", "clock", "reference")
    return bool(before.get("ratio") and after.get("ratio")) and all(before[name] == after[name] for name in same)


def _time(old: Result, new: Result) -> Iterator[Change]:
    """Change of the ratio to the reference, if both large enough and significant; or that timing failed."""
    before, after = old.time or {}, new.time or {}
    if before.get("ratio") and new.status != "ok":
        yield Change(new.score, "time", before["ratio"], new.status, "slower")
    if not comparable(old, new):
        return
    factor = after["ratio"] / before["ratio"]
    errors = [_standard_error(side) / side["ratio"] for side in (before, after)]
    z = abs(math.log(factor)) / max(math.hypot(*errors), 1e-12)
    if max(factor, 1 / factor) > TIME_FACTOR and z > SIGNIFICANT:
        verdict: Verdict = "slower" if factor > 1 else "faster"
        yield Change(new.score, "time", before["ratio"], after["ratio"], verdict, z / SIGNIFICANT)


def _standard_error(time: Record) -> float:
    """Standard error of the median ratio, √(π/2)·σ/√n with σ = IQR/1.349, for a normal distribution."""
    iqr, n = float(time["ratio_iqr"]), int(time["n"])
    return math.sqrt(math.pi / 2) * iqr / 1.349 / math.sqrt(n)


def write_baseline(results: Sequence[Result], folder: Path, masks: Path | None = None) -> None:
    """Write a baseline's `rows.jsonl`, and copy its cells' masks from a folder, in place of earlier ones.

    If it is killed, the baseline is the old one or the new one, with its masks, and perhaps with those of the other.
    Raises InputError without a cell, and if one failed.
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
    make_folder(folder)
    kept = folder / "masks"
    copied = set[str]()
    if masks is not None:
        make_folder(kept)
        for file in (masks / f"{result.score['key']}.png" for result in results):
            if file.exists():
                copied.add(file.name)
                with replace_file(kept / file.name) as temporary:
                    shutil.copyfile(file, temporary)
    with replace_file(folder / "rows.jsonl") as temporary:
        lines = [json.dumps({"schema": SCHEMA, **row}, allow_nan=False, separators=(",", ":")) for row in records]
        temporary.write_text("".join(f"{line}\n" for line in lines), encoding="utf-8")
    for file in kept.glob("*.png"):
        if file.name not in copied:
            file.unlink()
