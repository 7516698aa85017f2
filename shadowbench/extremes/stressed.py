"""What `stress` computes: specs walked along axes into a folder, and the operating ranges that are left."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from shadowbench.errors import InputError, alternatives
from shadowbench.extremes.axes import AXES, Axis
from shadowbench.extremes.axes.model import VIEW_SIZE
from shadowbench.extremes.ranges import OperatingRange, operating_ranges, points_frame, ranges_frame
from shadowbench.extremes.sweep import Sweep
from shadowbench.files import check_folder
from shadowbench.measure.executor import Executor, Limits
from shadowbench.measure.machine import write_run_file
from shadowbench.measure.measurer import Reporter
from shadowbench.measure.rows import Record
from shadowbench.studies.folder import read_folders
from shadowbench.studies.study import Study
from shadowbench.studies.tables import write_table
from shadowbench.techniques.spec import Spec

LIMITS = Limits(seconds=120.0, bytes=4 << 30)  # so that the largest maps are refused on any machine


@dataclass(frozen=True, eq=False)
class Stressed:
    """The rows of a sweep, and the operating range of each spec on each axis under each kind of light."""

    rows: tuple[Record, ...]
    ranges: tuple[OperatingRange, ...]


def chosen_axes(names: Sequence[str]) -> list[Axis]:
    """The axes of these names in their own order, all of them for no name; raises InputError for one there is not."""
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
) -> Stressed:
    """Walk specs along axes, a few values of each where `quick`; write rows, `ranges.csv`, `table.csv` and `run.json`.

    executor: one with LIMITS. Raises InputError for a folder of other files. A cell that fails is a row that says so.
    """
    check_folder(folder)
    rows = Sweep(specs, folder, executor, reporter).run(axes, quick)
    ranges = operating_ranges(axes, rows)
    write_table(folder / "ranges.csv", ranges_frame(ranges))
    study = Study.of(
        [axis.name for axis in axes], specs, reference=specs[0], view_size=VIEW_SIZE, rounds=0
    )  # as `run.json` tells it
    write_run_file(folder / "run.json", executor.info, [], study.facts, rows)
    _, (whole,) = read_folders([folder])
    write_table(folder / "table.csv", points_frame(whole.rows))
    return Stressed(tuple(rows), tuple(ranges))
