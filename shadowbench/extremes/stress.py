"""Computation behind `stress`: a sweep of specs along axes into a folder, and their operating ranges."""

from collections.abc import Sequence
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path

from shadowbench.errors import InputError, ShadowbenchError, alternatives
from shadowbench.extremes.axes import AXES, Axis
from shadowbench.extremes.axes.model import VIEW_SIZE
from shadowbench.extremes.ranges import OperatingRange, operating_ranges, points_frame, ranges_frame
from shadowbench.extremes.sweep import sweep
from shadowbench.files import check_folder
from shadowbench.measure.attempt import Failure
from shadowbench.measure.bench import Bench, Reporter
from shadowbench.measure.executor import Executor, Limits
from shadowbench.measure.machine import write_run_file
from shadowbench.measure.pictures import Pictures
from shadowbench.measure.row_store import RowStore
from shadowbench.measure.rows import Record
from shadowbench.studies.folder import read_folders
from shadowbench.studies.part import WHOLE, Part
from shadowbench.studies.study import Study
from shadowbench.studies.tables import write_table
from shadowbench.techniques.spec import Spec

LIMITS = Limits(seconds=120.0, bytes=4 << 30)  # fixed, so that the same maps are too large on every machine


@dataclass(frozen=True, eq=False)
class StressResult:
    """Rows of a sweep, and the operating range of each spec on each axis under each kind of light.

    failures: what was left out, with `keep_going`.
    """

    rows: tuple[Record, ...]
    ranges: tuple[OperatingRange, ...]
    failures: tuple[Failure, ...] = ()


def select_axes(names: Sequence[str]) -> list[Axis]:
    """Axes by name, in the order of AXES; all for no name. Raises InputError for an unknown name."""
    for name in names:
        if name not in AXES:
            raise InputError(f"--axis: found {name!r:.60}{alternatives(name, AXES)}")
    return [axis for axis in AXES.values() if not names or axis.name in names]


def stress(
    specs: Sequence[Spec],
    axes: Sequence[Axis],
    folder: Path,
    executor: Executor,
    reporter: Reporter,
    *,
    quick: bool = False,
    part: Part = WHOLE,
    keep_going: bool = False,
) -> StressResult:
    """Sweep specs along axes and write rows, `ranges.csv`, `table.csv` and `run.json` into a folder.

    executor: must have LIMITS; quick: a few values of each axis; part: measure only its ranges; keep_going: leave out
    lines that fail. Raises InputError for a folder with other files. A cell that fails gets a row with that status.
    """
    check_folder(folder)
    failures: list[Failure] = []
    with closing(RowStore(folder, sweep=True)) as store:
        rows = sweep(
            specs,
            axes,
            Bench(executor, store, reporter, Pictures(folder)),
            quick,
            part,
            failures if keep_going else None,
        )
    if not rows and failures:
        raise ShadowbenchError(f"no cell was measured: {failures[0].where}: {failures[0].reason}")
    ranges = operating_ranges(axes, rows)
    write_table(folder / "ranges.csv", [ranges_frame(ranges)])
    study = Study.of(
        [axis.name for axis in axes], specs, reference=specs[0], view_size=VIEW_SIZE, rounds=0
    )  # for its entry in `run.json`
    write_run_file(folder / "run.json", executor, [], study.facts, rows)
    _, (whole,) = read_folders([folder])
    write_table(folder / "table.csv", [points_frame(whole.rows)])
    return StressResult(tuple(rows), tuple(ranges), tuple(failures))
