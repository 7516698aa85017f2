"""Comparison of a run with a baseline: cells are matched by identity, metrics compared by their tolerances.

Scores are compared if both sides have them, work counts on the same renderer only, times on the same machine only.
"""

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal

from shadowbench.measure.flips import FLIPS, ROW_METRICS, row_metrics
from shadowbench.measure.rows import Record, Result, driver_of
from shadowbench.results.folder import identity

EXACT = ("draws", "primitives", "gpu_bytes", "reads", "rays")  # work counts that are deterministic on a renderer
INVOCATIONS = 0.02  # relative tolerance of other counts: drivers differ in helper invocations of quads
TIME_FACTOR = 1.1  # smallest change of a time ratio that is reported
SIGNIFICANT = 3.0  # standard errors

COMPARED = frozenset(
    {
        *("technique", "flips", "step", "work", "gpu_bytes", "mask_sha256"),
        *("clock", "reference", "ratio", "ratio_iqr", "n"),
    }
)
"""Fields of score and time records that are compared or printed, besides those that any reader of a folder keeps."""

MISSING = "missing"  # status of a cell that was not run

Verdict = Literal["regressed", "improved"]


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
    excess: float


@dataclass(frozen=True)
class Findings:
    """Changes found by a check, largest first.

    compared: number of cells in both runs; equal: those with the same mask and scores; timed: those with comparable
    times; notes: what could not be compared, and cells that the baseline lacks.
    """

    changes: tuple[Change, ...]
    compared: int
    equal: int
    timed: int
    notes: tuple[str, ...] = field(default=())

    def with_verdict(self, verdict: Verdict, times: bool) -> list[Change]:
        """Changes with a verdict, either in times or in anything else."""
        return [change for change in self.changes if change.verdict == verdict and (change.what == "time") == times]


def compare(found: Sequence[Result], baseline: Sequence[Result], tolerances: Mapping[str, float] = {}) -> Findings:
    """Compare every cell of the baseline with the cell of the same identity; tolerances: overrides by metric name."""
    now, then = ({identity(result.score): result for result in side} for side in (found, baseline))
    metrics, notes = _compared_metrics(found, baseline)
    allowed = {name: tolerances.get(name, ROW_METRICS[name].tolerance) for name in metrics}
    pairs = [(old, now[key]) for key, old in then.items() if key in now]
    drawn = [(old, new) for old, new in pairs if old.score["status"] == new.score["status"] == "ok"]
    timed = [(old, new) for old, new in drawn if _comparable(old, new)]
    changes = [
        Change(old.score, "status", old.status, MISSING, "regressed", math.inf)
        for key, old in then.items()
        if key not in now
    ]
    for old, new in pairs:
        changes += _status(old, new)
    for old, new in drawn:
        changes += _metrics(old.score, new.score, allowed)
        changes += _work(old, new)
        changes += _lost_time(old, new)
    for old, new in timed:
        changes += _time(old, new)
    equal = sum(_same_mask(old.score, new.score, allowed) for old, new in drawn)
    extra = len(now.keys() - then.keys())
    if extra:
        notes.append("1 cell is not in the baseline" if extra == 1 else f"{extra} cells are not in the baseline")
    changes.sort(key=lambda change: -change.excess)
    return Findings(tuple(changes), len(pairs), equal, len(timed), tuple(notes))


def _compared_metrics(found: Sequence[Result], baseline: Sequence[Result]) -> tuple[list[str], list[str]]:
    """Names of the metrics that both sides have, and notes on what is not compared."""
    sides = [{name for result in side for name in row_metrics(result.score)} for side in (found, baseline)]
    lacking = [name for name in ROW_METRICS if all(sides) and sum(name in side for side in sides) == 1]
    steps = [{result.score.get("step") for result in side if FLIPS.name in result.score} for side in (found, baseline)]
    names, notes = [name for name in ROW_METRICS if name not in lacking], []
    if all(steps) and steps[0] != steps[1]:
        names.remove(FLIPS.name)
        notes.append("flips are not compared: one side has them after a step of the camera, the other of the light")
    drivers = {_driver(result) for result in (*found, *baseline)}
    if len(drivers) > 1:
        notes.append(f"work is not compared across renderers: {' · '.join(sorted(drivers))}")
    if lacking:
        notes.append(f"not compared, since one side lacks them: {', '.join(lacking)}")
    if unknown := sorted(set().union(*sides) - set(ROW_METRICS)):
        notes.append(f"not compared, since their plug-in is not loaded: {', '.join(unknown)}")
    return names, notes


def _driver(result: Result) -> str:
    """The renderer without its arithmetic, which changes single fragments only."""
    return driver_of(str(result.score.get("renderer")))


def _same_mask(old: Record, new: Record, names: Iterable[str]) -> bool:
    """Whether masks and common scores are equal; an equal mask may have been scored against another truth."""
    if old.get("mask_sha256") is None or old["mask_sha256"] != new.get("mask_sha256"):
        return False
    before, after = row_metrics(old), row_metrics(new)
    return before == after or all(before[name] == after.get(name) for name in names if name in before)


def _status(old: Result, new: Result) -> Iterator[Change]:
    """Change from success to failure or back; a different reason of failure is no change."""
    before, after = old.score["status"], new.score["status"]
    if (before == "ok") != (after == "ok"):
        verdict: Verdict = "regressed" if before == "ok" else "improved"
        yield Change(new.score, "status", before, after, verdict, math.inf)


def _metrics(old: Record, new: Record, allowed: Mapping[str, float]) -> Iterator[Change]:
    then, now = row_metrics(old), row_metrics(new)
    if then == now:
        return
    for name, tolerance in allowed.items():
        if name not in then:  # a row of an older version beside newer ones
            continue
        before, after = then[name], now.get(name)
        if before is None and after is None:
            continue
        if before is None or after is None:  # the truth changed, a mask lost all its edges, or a row is broken
            yield Change(new, name, before, after, "regressed", math.inf)
            continue
        worse = ROW_METRICS[name].worse(before, after)
        if abs(worse) > tolerance:
            verdict: Verdict = "regressed" if worse > 0 else "improved"
            yield Change(new, name, before, after, verdict, abs(worse) / max(tolerance, 1e-12))


def _work(old: Result, new: Result) -> Iterator[Change]:
    """Changes of work counts, on the same renderer."""
    if _driver(old) != _driver(new):
        return
    before, after = ({**one.score.get("work", {}), "gpu_bytes": one.score.get("gpu_bytes")} for one in (old, new))
    for name in before.keys() & after.keys() - {"cost"}:  # the sum of others
        one, other = before[name], after[name]
        if one is None or other is None:
            continue
        tolerance = 0.0 if name in EXACT else INVOCATIONS * one
        if abs(other - one) > tolerance:
            verdict: Verdict = "regressed" if other > one else "improved"
            yield Change(new.score, name, one, other, verdict, abs(other - one) / max(INVOCATIONS * one, 1.0))


def _lost_time(old: Result, new: Result) -> Iterator[Change]:
    if old.time is not None and old.time.get("ratio") and new.status != "ok":
        yield Change(new.score, "time", old.time["ratio"], new.status, "regressed", math.inf)


def _comparable(old: Result, new: Result) -> bool:
    """Whether both have a ratio to the same reference on the same machine and clock."""
    before, after = old.time or {}, new.time or {}
    same = ("machine", "clock", "reference")
    return bool(before.get("ratio") and after.get("ratio")) and all(before[name] == after[name] for name in same)


def _time(old: Result, new: Result) -> Iterator[Change]:
    """Change of the ratio to the reference, if both large enough and significant."""
    before, after = old.time or {}, new.time or {}
    factor = after["ratio"] / before["ratio"]
    errors = [_standard_error(side) / side["ratio"] for side in (before, after)]
    z = abs(math.log(factor)) / max(math.hypot(*errors), 1e-12)
    if max(factor, 1 / factor) > TIME_FACTOR and z > SIGNIFICANT:
        verdict: Verdict = "regressed" if factor > 1 else "improved"
        yield Change(new.score, "time", before["ratio"], after["ratio"], verdict, z / SIGNIFICANT)


def _standard_error(time: Record) -> float:
    """Standard error of the median ratio, √(π/2)·σ/√n with σ = IQR/1.349, for a normal distribution."""
    iqr, n = float(time["ratio_iqr"]), int(time["n"])
    return math.sqrt(math.pi / 2) * iqr / 1.349 / math.sqrt(n)
