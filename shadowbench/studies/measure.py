"""Computation behind `run`: the study given by a file and options, and its measurement into a folder."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

from shadowbench.files import check_folder
from shadowbench.measure.attempt import Failure
from shadowbench.measure.bench import Reporter
from shadowbench.measure.executor import Executor
from shadowbench.measure.machine import write_run_file
from shadowbench.measure.rows import Result
from shadowbench.measure.session import DeviceInfo
from shadowbench.scenes.model import Scene
from shadowbench.studies.crossing import Techniques
from shadowbench.studies.part import WHOLE, Part
from shadowbench.studies.run import RunResult, run_study
from shadowbench.studies.study import Study, find_study, read_study
from shadowbench.studies.time_left import drawing_seconds, timing_seconds
from shadowbench.techniques.spec import Spec, has_size

if TYPE_CHECKING:  # what imports pandas, 0.3 s, waits until the cells are measured
    import pandas as pd

    from shadowbench.studies.folder import Run
    from shadowbench.studies.sweeps import SweepPositions


def study_from_options(
    known: Techniques,
    scenes: Sequence[str | Scene] = (),
    specs: Sequence[Spec] = (),
    *,
    study: str | None = None,
    map_size: Sequence[int] | None = None,
    phases: int | None = None,
    view: str | None = None,
    light: str | None = None,
    **others: Any,
) -> Study:
    """A study from a file or a built-in one (`default` for None), with the given fields replaced.

    known: techniques that the file may name; view, light: restrict to one camera and light by name; others: fields of
    the study, such as `view_size`, `rounds` and `assets`; None keeps the study's value. Specs without a study and map
    sizes are measured at their own map sizes, in one phase. Raises InputError.
    """
    found = read_study(find_study(study or "default"), known)
    if specs:
        if study is None and map_size is None:
            found = found.with_(map_size=None, phases=1)
        found = found.with_specs(specs)
    elif phases:
        found = found.with_(technique=tuple(replace(crossed, phases=None) for crossed in found.technique))
    named = [spec.text for spec in specs if "size" in spec.explicit] if map_size else []
    sizes = ",".join(map(str, map_size or ()))
    notes = [f"{name} names its size, which --map-size {sizes} leaves as it is" for name in named]
    around = [spec.text for spec in found.specs if any(map(has_size, spec.techniques[1:]))] if map_size else []
    notes += [
        f"{name}: --map-size {sizes} leaves the map inside as it is; its size is written in the spec" for name in around
    ]
    changes = {
        "scenes": scenes,
        "map_size": map_size,
        "phases": phases,
        "views": (view,) if view else None,
        "lights": (light,) if light else None,
        "notes": (*found.notes, *notes),
        **others,
    }
    return found.with_(**{name: value for name, value in changes.items() if value not in (None, (), [])})


def estimate(study: Study) -> tuple[int, float]:
    """Number of cells of a study, and their approximate run time in seconds on two cores without a GPU, at least 5.

    Lights other than `sun` are taken to have no size.
    """
    cells = study.cells(study.sun)
    seconds = sum(drawing_seconds(study, cell) + timing_seconds(study, cell) for cell in cells) * len(study.scenes)
    return len(cells) * len(study.scenes), max(seconds, 5)


@dataclass(frozen=True, eq=False)
class StudyResult:
    """Result of measuring a study into a folder.

    results: its cells, measured now or before; run: the whole folder, with cells of earlier commands; sweep_positions:
    of specs in the study's bias sweeps; failures: what was left out, with `keep_going`; times: by name of a machine,
    the results with its times, if several were asked for.
    """

    study: Study
    results: tuple[Result, ...]
    run: "Run"
    sweep_positions: "SweepPositions"
    info: DeviceInfo
    failures: tuple[Failure, ...] = ()
    times: Mapping[str, Sequence[Result]] = field(default_factory=dict)

    @cached_property
    def frame(self) -> "pd.DataFrame":
        """One line per cell of the study, with the columns of `table.csv`."""
        from shadowbench.studies.tables import cells_frame

        return cells_frame(self.results)


def measure(
    study: Study,
    folder: Path,
    executor: Executor,
    reporter: Reporter,
    *,
    others: Sequence[Executor] = (),
    timers: Mapping[str, Executor] | None = None,
    time_again: bool = False,
    part: Part = WHOLE,
    keep_going: bool = False,
) -> StudyResult:
    """Measure a study into a folder: rows, masks, pictures, `table.csv` and `run.json`. Existing rows are reused.

    others: executors with other renderers, on which the study is measured too; timers: those that time the cells, one
    after the other and after all scores, by name, None for the executor itself, block by block; time_again: time cells
    again that have a time; part: measure only its cells; keep_going: leave out scenes, truths and blocks that fail.
    Raises InputError for a folder with other files, a scene that cannot be read, and a map or view too large for the
    device. A cell that fails gets a row with that status.
    """
    check_folder(folder)
    scored = study if timers is None else study.with_(rounds=0)

    def run_on(one: Executor, study: Study, time_again: bool = False) -> RunResult:
        return run_study(study, folder, one, reporter, time_again, part, keep_going)

    first = run_on(executor, scored, time_again)
    scores = [first, *(run_on(other, scored) for other in others)]
    timed = {name: run_on(timer, study, time_again) for name, timer in (timers or {}).items()}
    # A cell by its key: the last machine's times are in the table.
    results = {result.score["key"]: result for found in (*scores, *timed.values()) for result in found.results}
    notes = list(dict.fromkeys(note for found in scores for note in found.notes))
    failures = dict.fromkeys(failure for found in (*scores, *timed.values()) for failure in found.failures)
    from shadowbench.studies.folder import write_cells
    from shadowbench.studies.sweeps import sweep_positions

    positions = sweep_positions(study.sweeps)
    *_, last = [executor, *(timers or {}).values()]
    write_run_file(folder / "run.json", last, notes, study.facts, [one.score for one in results.values()])
    run = write_cells(folder, list(results.values()), positions)
    return StudyResult(
        study,
        tuple(results.values()),
        run,
        positions,
        executor.info,
        tuple(failures),
        {name: found.results for name, found in timed.items()},
    )
