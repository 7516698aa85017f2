"""Running a study into a folder: all truths first, then the cells block by block."""

import math
from collections.abc import Sequence
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path

from shadowbench.errors import InputError
from shadowbench.measure.bench import Bench, Job, Reporter
from shadowbench.measure.executor import Executor
from shadowbench.measure.flips import size_after
from shadowbench.measure.measurer import Measurer
from shadowbench.measure.pictures import Pictures
from shadowbench.measure.profile import Profile
from shadowbench.measure.row_store import Rows, RowStore
from shadowbench.measure.rows import Result
from shadowbench.measure.session import DeviceInfo
from shadowbench.scenes.model import Scene, View
from shadowbench.scenes.views import first_of
from shadowbench.studies.study import Study, scenes_of
from shadowbench.techniques.filters import Filter
from shadowbench.techniques.unshadowed import Unshadowed
from shadowbench.truths.cache import PIXEL_SAMPLES, cached_truth
from shadowbench.truths.trace import Truth


@dataclass(frozen=True, eq=False)
class RunResult:
    """Results of all cells of a run, measured now or before, its notes and its time by activity."""

    results: list[Result]
    notes: list[str]
    profile: Profile


def run_study(
    study: Study, folder: Path, executor: Executor, reporter: Reporter, time_again: bool = False
) -> RunResult:
    """Measure all cells of a study that the folder lacks. Raises InputError before anything is written.

    time_again: time cells again that have a time; the rows keep both.
    """
    profile, blocks = Profile(), list(study.blocks())
    with profile.activity("waiting"):
        info = executor.info
    check_sizes(study, info)
    of_scenes = [note for scene in scenes_of(blocks) for note in _notes_on(study, scene)]
    notes = [*study.notes, *_filter_notes(study), *of_scenes]
    for note in notes:
        reporter.note(note)
    uniform: set[str] = set()  # views
    reporter.stage("truth", len(blocks))
    truths = Bench(executor, Rows(), reporter, profile=profile)
    # All of them before anything is written: a view that shows nothing raises InputError.
    for block, line in zip(blocks, truths.run([TruthJob(block.view) for block in blocks]), strict=True):
        if line is not None:
            notes.append(f"{block.view.name}: {line}")
            reporter.note(notes[-1])
            uniform.add(block.view.name)
    with closing(RowStore(folder)) as store:
        conditions = study.conditions(time_again)
        measurer = Measurer(Bench(executor, store, reporter, Pictures(folder), profile), conditions)
        cells = [cell for block in blocks for cell in block.cells]
        reporter.stage("cells", len(cells) + sum(map(conditions.times, cells)))
        results = []
        for block, found in zip(blocks, measurer.measure(blocks), strict=True):
            results += found
            masks = () if block.view.name in uniform else filter(None, map(_uniform_mask, found))
            for line in dict.fromkeys(masks):  # phases may say the same
                notes.append(f"{block.view.name}: {line}")
                reporter.note(notes[-1])
    return RunResult(results, notes, profile)


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
        with bench.profile.activity("truth"):
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
