"""What ranks specs: counted work, times, or the times that a law predicts from work for another device."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

from shadowbench.advice.law import Law, counts_of
from shadowbench.advice.search import Trial
from shadowbench.advice.space import Rule
from shadowbench.advice.target import Target
from shadowbench.errors import InputError
from shadowbench.measure.drawer import DeviceInfo
from shadowbench.measure.rows import Result
from shadowbench.plugin.spec import Spec
from shadowbench.results.submission import kind_of
from shadowbench.results.tables import cells_frame
from shadowbench.results.times import ReferenceTime, normalise_times
from shadowbench.scenes.model import View

ROUNDS = 9
Unit = Literal["work", "ms"]


@dataclass(frozen=True)
class Cost:
    """The cost of a spec; law: by which milliseconds are predicted, None if they are measured."""

    unit: Unit
    law: Law | None = None

    @property
    def rounds(self) -> int:
        """Rounds in which a cell is timed."""
        return ROUNDS if self.unit == "ms" and self.law is None else 0

    @property
    def price(self) -> float:
        """Cost of a unit of work, 0 if unknown."""
        return 1.0 if self.unit == "work" else 0.0

    def rules(self, space: Sequence[Spec]) -> list[Rule]:
        """What excludes specs whose cost is not known without being timed."""
        if self.law is not None:
            return [_law_rule(self.law)]
        return [_work_rule(space)] if self.unit == "work" else []

    def status(self, result: Result) -> str:
        """`ok`, or why a cell is no trial."""
        time = result.time
        if result.status == "ok" and self.rounds and (time is None or time["ratio"] is None):
            return f"failed: no ratio to the reference: {time and time['no_ratio']}"
        return result.status

    def trial(self, spec: Spec, result: Result, target: Target, view: View) -> Trial:
        """Trial of a measured spec; its cost is its work, predicted time, or ratio to the reference."""
        row, work = result.score, result.score["work"]
        cost = fixed = float(work.get("vertices", 0) + work.get("geometry", 0))
        if self.law is not None:
            counts = counts_of(row, len(view.scene.geometry.faces))
            name, texels = kind_of(spec.sizeless_text), dict.fromkeys(("fragments", "reads", "gpu_bytes"), 0)
            cost, fixed = self.law.milliseconds(name, counts), self.law.milliseconds(name, counts | texels)
        elif self.unit == "work":
            cost = float(work["cost"])
        else:
            assert result.time is not None
            cost = float(result.time["ratio"])
            fixed = cost * fixed / work["cost"] if "cost" in work else 0.0  # the vertices' share
        return Trial(spec, cost, fixed, int(row["gpu_bytes"]), target.error(row["metrics"]), result)

    def compared(self, trials: Sequence[Trial]) -> tuple[Sequence[Trial], ReferenceTime | None]:
        """Trials with costs in milliseconds in place of ratios, by one time of their reference; others as they are."""
        if not self.rounds or not trials:
            return trials, None
        _, reference = normalise_times(cells_frame([trial.result for trial in trials]))
        assert reference is not None
        ms = reference.ms
        return [replace(trial, cost=trial.cost * ms, fixed=trial.fixed * ms) for trial in trials], reference


def cost_of(target: Target, view: View, info: DeviceInfo, on_this_machine: bool, timed: bool, law: Law | None) -> Cost:
    """What ranks specs on a device; timed: whether it may be. Raises InputError for options that cannot be met."""
    if law is not None:
        if not info.software:
            raise InputError(
                "--device: times are predicted from the work that a software renderer counts, not on a GPU"
            )
        if view.light.soft:
            raise InputError(f"--device: found a light with a size; those of which {law.device} has times have none")
        if not info.pipeline_statistics:
            raise InputError(f"--device: {info.renderer} does not count work, from which times are predicted")
        return Cost("ms", law)
    if not timed and (target.budget_ms is not None or on_this_machine):
        option = "--on-this-machine" if on_this_machine else "--budget-ms"
        raise InputError(f"{option}: nothing is timed with --dask; allowed: with --time-on WORKER")
    if timed and (not info.software or on_this_machine):
        return Cost("ms")
    if target.budget_ms is not None:
        raise InputError(
            f"--budget-ms: {info.renderer} is a software renderer, whose times are not a GPU's; --on-this-machine "
            "ranks by them nevertheless, --device by predicted ones"
        )
    if not info.pipeline_statistics:
        raise InputError(f"{info.renderer} does not count work; allowed: --on-this-machine, which ranks by its times")
    return Cost("work")


def _law_rule(law: Law) -> Rule:
    """Excludes kinds of techniques of which a law gives no times."""

    def rule(spec: Spec) -> tuple[str, str] | None:
        kind = kind_of(spec.sizeless_text)
        if law.holds(kind):
            return None
        why = "its work does not tell its time" if kind in law.errors else "it was not timed"
        return kind, f"{why} on {law.device}"

    return rule


def _work_rule(space: Sequence[Spec]) -> Rule:
    """Excludes specs whose work is not counted as that of others; a technique by its name if all of its specs are."""
    reasons = {spec: spec.technique.extra_work(spec.params) for spec in space}
    counted = {spec.technique for spec, reason in reasons.items() if reason is None}

    def rule(spec: Spec) -> tuple[str, str] | None:
        reason, name = reasons[spec], spec.technique.name
        if reason is None:
            return None
        return (
            (spec.text, reason)
            if spec.technique in counted
            else (name, f"{reason}; `shadowbench run -t {name}` scores it")
        )

    return rule
