"""Running a study into a folder: all truths first, then the cells block by block."""

import math
from collections.abc import Sequence
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path

from shadowbench.errors import InputError, ShadowbenchError
from shadowbench.measure.attempt import Attempt, Failure
from shadowbench.measure.bench import Bench, Job, Reporter
from shadowbench.measure.cells import Block
from shadowbench.measure.executor import Executor
from shadowbench.measure.flips import size_after
from shadowbench.measure.machine import machine_key
from shadowbench.measure.measurer import BlockJob, Measurer
from shadowbench.measure.pictures import Pictures
from shadowbench.measure.row_store import Rows, RowStore
from shadowbench.measure.rows import Result
from shadowbench.measure.session import DeviceInfo
from shadowbench.scenes.model import Scene, View
from shadowbench.scenes.views import first_of
from shadowbench.studies.part import WHOLE, Part
from shadowbench.studies.study import Study, scenes_of
from shadowbench.studies.time_left import drawing_seconds, duration, timing_seconds
from shadowbench.techniques.filters import Filter
from shadowbench.techniques.unshadowed import Unshadowed
from shadowbench.truths.cache import PIXEL_SAMPLES, cached_truth
from shadowbench.truths.trace import Truth

_LONG_S = 60.0  # from which an estimate is given


@dataclass(frozen=True, eq=False)
class RunResult:
    """Results of all cells of a run, measured now or before, its notes and its time by activity.

    failures: what was left out, with `keep_going`.
    """

    results: list[Result]
    notes: list[str]
    failures: list[Failure]


def run_study(
    study: Study,
    folder: Path,
    executor: Executor,
    reporter: Reporter,
    time_again: bool = False,
    part: Part = WHOLE,
    keep_going: bool = False,
) -> RunResult:
    """Measure all cells of a study that the folder lacks. Raises InputError before anything is written.

    time_again: time cells again that have a time; the rows keep both; part: measure only its cells; keep_going: leave
    out scenes, truths and blocks that fail. Raises ShadowbenchError if nothing is left.
    """
    failures: list[Failure] = []
    blocks = part.of_blocks(readable_blocks(study, failures) if keep_going else [*study.blocks()])
    info = executor.info
    check_sizes(study, info)
    of_scenes = [note for scene in scenes_of(blocks) for note in _notes_on(study, scene)]
    notes = [*study.notes, *_filter_notes(study), *of_scenes]
    for note in notes:
        reporter.note(note)
    uniform: set[str] = set()  # views
    reporter.stage("truth", len(blocks))
    truths = Bench(executor, Rows(), reporter)
    # All of them before anything is written: a view that shows nothing raises InputError.
    jobs: Sequence[Job[str | Failure | None]] = [TruthJob(block.view) for block in blocks]
    if keep_going:
        jobs = [Attempt(TruthJob(block.view), "truth", block.view.name) for block in blocks]
    traced = []
    for block, line in zip(blocks, truths.run(jobs), strict=True):
        if isinstance(line, Failure):
            failures.append(line)
            continue
        traced.append(block)
        if line is not None:
            notes.append(f"{block.view.name}: {line}")
            reporter.note(notes[-1])
            uniform.add(block.view.name)
    blocks = traced
    if not blocks:
        raise ShadowbenchError(f"nothing is left to measure: {failures[0].where}: {failures[0].reason}")
    with closing(RowStore(folder)) as store:
        conditions = study.conditions(time_again)
        modelled, drawn, machine = 0.0, 0, machine_key(executor)
        for block in blocks:
            keys = BlockJob(block, conditions).keys(executor.identity)
            missing = [cell for cell, key in keys.items() if store.finished_score(key) is None]
            untimed = [cell for cell, key in keys.items() if time_again or store.time_on(machine, key) is None]
            modelled += sum(drawing_seconds(study, cell) for cell in missing)
            modelled += sum(timing_seconds(study, cell) for cell in filter(conditions.times, untimed))
            drawn += len(missing)
        measurer = Measurer(Bench(executor, store, reporter, Pictures(folder)), conditions)
        cells = [cell for block in blocks for cell in block.cells]
        if modelled >= _LONG_S:
            rough = f"about {duration(modelled)} on two cores without a GPU"
            reporter.note(f"{drawn} of {len(cells)} cells to measure: {rough}, by a model that the first cells correct")
        reporter.stage("cells", len(cells) + sum(map(conditions.times, cells)))
        results = []
        for block, found in zip(blocks, measurer.measure(blocks, failures if keep_going else None), strict=True):
            results += found
            masks = () if block.view.name in uniform else filter(None, map(_uniform_mask, found))
            for line in dict.fromkeys(masks):  # phases may say the same
                notes.append(f"{block.view.name}: {line}")
                reporter.note(notes[-1])
    if not results:
        raise ShadowbenchError(f"no cell was measured: {failures[0].where}: {failures[0].reason}")
    return RunResult(results, notes, failures)


def readable_blocks(study: Study, failures: list[Failure]) -> list[Block]:
    """The blocks of a study whose scenes can be read; failures: receives the others."""
    blocks: list[Block] = []
    for source in study.scenes:
        try:
            own = list(study.with_(scenes=(source,)).blocks())
            if any(block.scene.name == own[0].scene.name for block in blocks):
                raise InputError(f"found two scenes that are called {own[0].scene.name!r}; names must differ")
            blocks += own
        except InputError as error:
            name = source if isinstance(source, str) else source.name
            reason = str(error).removeprefix(f"{Path(name).name}: ").removeprefix(f"{name}: ")
            failures.append(Failure("scene", name, reason))
    if not blocks:
        raise InputError(f"{failures[0].where}: {failures[0].reason}")
    return blocks


@dataclass(frozen=True, eq=False)
class TruthJob(Job[str | None]):
    """Job that traces the truth of a view into the cache, and returns a line about one without an edge."""

    view: View

    @property
    def truths(self) -> Sequence[tuple[View, int]]:
        """The view's."""
        return ((self.view, PIXEL_SAMPLES),)

    def __call__(self, bench: Bench) -> str | None:
        """Trace the truth unless it is in the cache. Raises InputError for a view that shows nothing."""
        truth = cached_truth(self.view)
        bench.reporter.step(self.view.name)
        return _uniform_truth(truth)


def check_sizes(study: Study, info: DeviceInfo) -> None:
    """Raises InputError if a map or the view is larger than the device allows."""
    largest = max(study.reference.map_size or 0, *(cell.spec.map_size or 0 for cell in study.cells()))
    view = max(study.view_size, size_after(study.step, study.view_size))
    for what, size in (("map size", largest), ("view size", view)):
        if size > info.max_map_size:
            raise InputError(f"{what} {size}: {info.renderer} allows 1 to {info.max_map_size}")


def _uniform_truth(truth: Truth) -> str | None:
    visibility = truth.visibility[truth.receivers & ~truth.undecided]
    if not (visibility < 1).any():
        return "nothing is in shadow, so most metrics are undefined or trivial"
    return None if visibility.any() else "everything is in shadow, so most metrics are undefined or trivial"


def _uniform_mask(result: Result) -> str | None:
    """A line about a mask without an edge, in a view whose truth has one: it is lit, or in shadow, all over."""
    row = result.score
    if result.score["status"] != "ok" or row["technique"] == Unshadowed.name:
        return None
    if row["metrics"]["edge_px"] != math.hypot(row["view_size"], row["view_size"]):
        return None
    size = f" at {row['map_size']}" if row["map_size"] else ""
    where = "in shadow" if row["metrics"]["iou"] else "lit"
    return f"{row['spec']}{size} draws every scored pixel {where}"


def _filter_notes(study: Study) -> list[str]:
    filters = {spec.text: getattr(spec.params, "filter", None) for spec in study.specs}
    return [f"{text}: {one.note}" for text, one in filters.items() if isinstance(one, Filter) and one.note]


def _notes_on(study: Study, scene: Scene) -> list[str]:
    first = "file" in study.views
    several = first_of(scene.name, "cameras", scene.cameras, "--view or a study") if first else []
    return [*scene.notes, *several]
