"""What ranks specs: counted work, times, or the times that a law predicts from work for another device."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal, cast, get_args

from shadowbench.advice.search import Trial, reads_of
from shadowbench.advice.target import Target
from shadowbench.errors import InputError
from shadowbench.measure.drawer import DeviceInfo
from shadowbench.measure.rows import Result
from shadowbench.plugin.spec import Spec
from shadowbench.results.frame import cells_frame
from shadowbench.results.law import SHORTEST_MS, Law, counts_of, find_law, kind_of, law_on_record
from shadowbench.results.times import ReferenceTime, normalise_times
from shadowbench.scenes.model import View

ROUNDS = 9
Unit = Literal["work", "ms"]
By = Literal["work", "device", "time"]


@dataclass(frozen=True)
class Cost:
    """The cost of a spec; law: by which milliseconds are predicted, None if they are measured.

    without_law: where work ranks, why no law does, empty if work was asked for.
    """

    unit: Unit
    law: Law | None = None
    without_law: str = ""

    @property
    def rounds(self) -> int:
        """Rounds in which a cell is timed."""
        return ROUNDS if self.unit == "ms" and self.law is None else 0

    def base(self, spec: Spec, view: View) -> float:
        """The part of a spec's cost that is known before it is drawn; 0 where times are measured."""
        pixels, reads = view.size**2, reads_of(spec)
        if self.law is not None:
            counts = {
                "reads": pixels * reads,
                "triangles": view.scene.geometry.count,
                "gpu_bytes": _bytes(spec, view),
            }
            return self.law.share(kind_of(spec.sizeless_text), counts)
        return float(pixels * (1 + reads)) if self.unit == "work" else 0.0

    def unranked(self, spec: Spec) -> str | None:
        """Why the cost of a spec is not known; None if it is."""
        if self.law is None:
            return spec.technique.extra_work(spec.params) if self.unit == "work" else None
        kind = kind_of(spec.sizeless_text)
        if self.law.holds(kind):
            return None
        why = "its work does not tell its time" if kind in self.law.kinds else "it was not timed"
        return f"{why} on {self.law.device}"

    def status(self, result: Result) -> str:
        """`ok`, or why a cell is no trial."""
        time = result.time
        if result.status == "ok" and self.rounds and (time is None or time["ratio"] is None):
            return f"failed: no ratio to the reference: {time and time['no_ratio']}"
        return result.status

    def trial(self, spec: Spec, result: Result, target: Target, view: View) -> Trial:
        """Trial of a measured spec; its cost is its work, predicted time, or ratio to the reference.

        A predicted time is the law's sum, which may be shorter than can be told apart: see `compared`.
        """
        row, work = result.score, result.score["work"]
        cost = fixed = float(work.get("vertices", 0) + work.get("geometry", 0))
        if self.law is not None:
            counts = counts_of(row, view.scene.geometry.count)
            kind, vertices = kind_of(spec.sizeless_text), {"frames": 0, "vertices": counts["vertices"]}
            cost, fixed = self.law.share(kind, counts), self.law.share(kind, vertices)
        elif self.unit == "work":
            cost = float(work["cost"])
        else:
            assert result.time is not None
            cost = float(result.time["ratio"])
            fixed = cost * fixed / work["cost"] if "cost" in work else 0.0  # the vertices' share
        error = target.error(row["metrics"])
        return Trial(spec, cost, fixed, int(row["gpu_bytes"]), error, result, float(work.get("cost", 0)))

    def compared(self, trials: Sequence[Trial]) -> tuple[Sequence[Trial], ReferenceTime | None]:
        """Trials whose costs can be compared, and the reference time of ratios, by which they become milliseconds.

        Predicted times that cannot be told apart are equal: then less work comes first.
        """
        if self.law is not None:
            return [replace(one, cost=max(one.cost, SHORTEST_MS)) if one.cost else one for one in trials], None
        if not self.rounds or not trials:
            return trials, None
        _, reference = normalise_times(cells_frame([trial.result for trial in trials]))
        assert reference is not None
        ms = reference.ms
        return [replace(trial, cost=trial.cost * ms, fixed=trial.fixed * ms) for trial in trials], reference


def _bytes(spec: Spec, view: View) -> int:
    """Of the maps of a spec, one for each face or slice; 0 without a format of depths."""
    bits = int("".join(filter(str.isdigit, getattr(spec.params, "depth", "0"))))
    maps = 6 if view.light.hard_kind == "point" else spec.technique.view_slices(spec.params)
    return maps * (spec.map_size or 0) ** 2 * bits // 8


def by_of(name: str | None) -> By | None:
    """What ranks, by name. Raises InputError for another."""
    if name is None or name in get_args(By):
        return cast("By | None", name)
    raise InputError(f"--by: found {name!r:.60}; allowed: {', '.join(get_args(By))}")


def cost_of(
    target: Target, view: View, info: DeviceInfo, by: By | None = None, timed: bool = True, device: str | None = None
) -> Cost:
    """What ranks specs on a device, by default times: of a GPU that draws, else those predicted for another.

    by: what was asked for; timed: whether the device may be; device: its name. Raises InputError for
    options that cannot be met.
    """
    law = None if device is None else find_law(device)
    if law is not None and by not in (None, "device"):
        raise InputError(f"--device: found with --by {by}; allowed: --by device")
    if by == "time" and not timed:
        raise InputError("--by time: nothing is timed with --dask; allowed: without it")
    if by == "time" or (by is None and law is None and timed and not info.software):
        return Cost("ms")
    asked, law = law is not None or by == "device", law or law_on_record()
    obstacle = "" if by == "work" else _without_law(view, info, law)
    if law is not None and by != "work" and not obstacle:
        return Cost("ms", law)
    if asked:
        raise InputError(f"--device: {obstacle}")
    if target.budget_ms is not None:
        why = obstacle or "found with --by work, which has no times"
        raise InputError(f"--budget-ms: {why}; allowed: with --by time, which ranks by this machine's times")
    if not info.pipeline_statistics:
        raise InputError(f"{info.renderer} does not count work; allowed: --by time, which ranks by its times")
    return Cost("work", without_law=obstacle)


def _without_law(view: View, info: DeviceInfo, law: Law | None) -> str:
    """Why no law gives times of what a device draws of a view; empty if one does."""
    if law is None:
        return "no device has times on record"
    if not info.software:
        return "times are predicted from the work that a software renderer counts, not on a GPU"
    if view.light.soft:
        return f"found a light with a size; those of which {law.device} has times have none"
    return "" if info.pipeline_statistics else f"{info.renderer} does not count work, from which times are predicted"
