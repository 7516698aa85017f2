"""A cell for the fixture `shadow_benchmark`: scored, and timed in turn with the floor and a reference."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

from numpy.typing import NDArray

from shadowbench.errors import InputError, ShadowbenchError, Unsupported
from shadowbench.measure.campaign import DEFAULT_REFERENCE, Block, Cell
from shadowbench.measure.gl_drawer import campaign_in, shared_worker
from shadowbench.measure.plugin_output import techniques_with
from shadowbench.measure.rows import Result
from shadowbench.measure.time_rows import time_row
from shadowbench.plugin.spec import parse_spec
from shadowbench.results.baseline import compare
from shadowbench.results.frame import identity, read_runs
from shadowbench.scenes.model import View


class Measured(NamedTuple):
    """A cell's row, with its time record if it was timed.

    ratios: (rounds,) times of its frames over those of the reference in the same rounds; empty if it was not timed.
    """

    result: Result
    ratios: NDArray[Any] | tuple[()]

    @property
    def summary(self) -> dict[str, Any]:
        """Columns by name, for `extra_info`: metrics, work, bytes, renderer and times."""
        score, time = self.result.score, self.result.time or {}
        work = {f"work_{name}": count for name, count in score["work"].items()}
        named = {name: score[name] for name in ("scene", "light", "spec", "map_size", "gpu_bytes", "renderer")}
        times = ("clock", "frame_ms", "added_ms", "reference", "reference_ms", "ratio", "ratio_iqr", "prepare_ms")
        measured = {name: time[name] for name in times if name in time}
        return named | dict(score["metrics"]) | work | {"mask_sha256": score["mask_sha256"]} | measured


def measure_cell(
    spec: str, view: View, *, rounds: int, reference: str | None = None, plugins: Sequence[Path] = ()
) -> Measured:
    """Draw and score a spec in a view; with `rounds`, time it in turn with `unshadowed` and the reference.

    reference: a spec, by default that of studies. Raises Unsupported, InputError, and ShadowbenchError if it fails.
    """
    files = tuple(file.resolve() for file in plugins)
    known = techniques_with(files)
    cell = Cell(parse_spec(spec, known))
    divisor = DEFAULT_REFERENCE if reference is None else parse_spec(reference, known)
    block = Block((view,), (cell,), reference=divisor)
    with shared_worker(files) as worker, campaign_in(None, worker=worker) as campaign:
        with campaign:
            ((result,),) = campaign.measure([block])
        if result.status.startswith("unsupported"):
            raise Unsupported(f"{spec} on {view.scene.name}: {result.status}")
        if result.status != "ok":
            raise ShadowbenchError(f"{spec} on {view.scene.name} {result.status}")
        if not rounds:
            return Measured(result, ())
        timed = replace(block, rounds=rounds)
        times = dict(campaign.drawer.time(timed, {cell: int(result.score["gpu_bytes"])}))[cell]
    if isinstance(times, str) or times.ratios is None:
        reason = times if isinstance(times, str) else times.no_ratio
        raise ShadowbenchError(f"{spec} on {view.scene.name}: no time: {reason}")
    return Measured(Result(result.score, time_row(times, "", "", "")), times.ratios)


def regressions(result: Result, baseline: Path) -> list[str]:
    """What `check` would report of a cell against a baseline's: a line for each metric that got worse.

    Raises InputError if the baseline has no cell of this identity.
    """
    (run,) = read_runs([baseline])
    before = [other for other in run.results if identity(other.score) == identity(result.score)]
    if not before:
        has = ", ".join(sorted({f"{other.score['scene']} {other.score['full_spec']}" for other in run.results})[:3])
        raise InputError(f"{baseline}: no row of {result.score['scene']} {result.score['full_spec']}; it has {has}")
    worse = compare([result], before).of("regressed")
    return [f"{change.what} was {change.before:.6g} in {baseline}, now {change.after:.6g}" for change in worse]
