"""`stress`: techniques along axes until they break, and the table of operating ranges."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from rich.markup import escape
from rich.table import Table

from shadowbench.commands.console import (
    ConsoleReporter,
    check_folder,
    err,
    out,
    print_json,
    print_table,
    say_unsupported,
    techniques_with,
)
from shadowbench.errors import InputError, alternatives
from shadowbench.measure.machine import write_run_file
from shadowbench.measure.place import Limits
from shadowbench.measure.rows import Record
from shadowbench.measure.worker import Worker
from shadowbench.reports.folder import read_folders
from shadowbench.stress.axes import AXES, Axis
from shadowbench.stress.axes.model import NAMES, VIEW_SIZE
from shadowbench.stress.ranges import (
    BROKEN,
    DEAD,
    OperatingRange,
    failure,
    operating_ranges,
    points_frame,
    ranges_frame,
)
from shadowbench.stress.sweep import Sweep, default_specs
from shadowbench.studies.study import Study
from shadowbench.studies.tables import write_table
from shadowbench.techniques.spec import Spec, parse_spec

LIMITS = Limits(seconds=120.0, bytes=4 << 30)  # so that the largest maps are refused on any machine


@dataclass(frozen=True)
class StressOptions:
    """What the command line says; empty means every technique at its defaults, and every axis."""

    specs: tuple[str, ...]
    axes: tuple[str, ...]
    plugins: tuple[Path, ...]
    quick: bool


def stress_command(options: StressOptions, folder: Path, *, as_json: bool, quiet: bool) -> int:
    """Sweep, write `ranges.csv`, `table.csv` and `run.json`, print the ranges.

    3 when a cell crashed, hung or raised; 1 when one drew NaN or infinity or left an OpenGL error; else 0: breaking
    points are what was asked for.
    """
    axes = _axes(options.axes)
    specs = _specs(options)
    check_folder(folder)
    with ConsoleReporter(quiet) as reporter, Worker(options.plugins, LIMITS) as worker:
        rows = Sweep(specs, folder, worker, reporter).run(axes, options.quick)
        info = worker.info
    ranges = operating_ranges(axes, rows)
    write_table(folder / "ranges.csv", ranges_frame(ranges))
    study = Study(tuple(axis.name for axis in axes), specs, specs[0], view_size=VIEW_SIZE, rounds=0)
    write_run_file(folder / "run.json", info, [], study.facts, rows)
    _, (whole,) = read_folders([folder])
    write_table(folder / "table.csv", points_frame(whole.rows))
    if as_json:
        print_json(ranges_frame(ranges).astype(object).where(lambda frame: frame.notna(), None).to_dict("records"))
    else:
        for spec in specs:
            _print(spec.text, [one for one in ranges if one.spec == spec.text])
        if not quiet:
            out.print(f"{folder / 'ranges.csv'}: {len(ranges)} ranges of {len(rows)} cells", soft_wrap=True)
    say_unsupported([str(row["status"]) for row in rows])
    return _exit_code(rows)


def _axes(names: Sequence[str]) -> list[Axis]:
    for name in names:
        if name not in AXES:
            raise InputError(f"--axis: found {name!r:.60}{alternatives(name, AXES)}")
    return [axis for axis in AXES.values() if not names or axis.name in names]


def _specs(options: StressOptions) -> tuple[Spec, ...]:
    known = techniques_with(options.plugins)
    if options.specs:
        return tuple(dict.fromkeys(parse_spec(text, known) for text in options.specs))
    return default_specs(known.values())


def _print(title: str, ranges: Sequence[OperatingRange]) -> None:
    """A line an axis, a column a kind of light; one line in all for what never holds."""
    if not any(one.held for one in ranges):
        if ranges:
            out.print(f"{title}: breaks at home on every axis", markup=False, soft_wrap=True)
        return
    lights = [kind for kind in NAMES if any(one.light == kind for one in ranges)]
    table = Table(title=escape(title), title_justify="left", box=None, pad_edge=False)
    table.add_column("axis", no_wrap=True)
    for kind in lights:
        table.add_column(NAMES[kind])
    for axis in dict.fromkeys(one.axis for one in ranges):
        texts = {one.light: one.text for one in ranges if one.axis is axis}
        table.add_row(axis.name, *(escape(texts.get(kind, "")) for kind in lights))
    print_table(table)
    out.print()


def _exit_code(rows: Sequence[Record]) -> int:
    """What FORMATS promises, with one line a kind of failure on stderr."""
    code = 0
    for kinds, verdict, what in ((BROKEN, 1, "NaN, infinity or an OpenGL error"), (DEAD, 3, "a crash, hang or error")):
        found = [(row, one) for row in rows if (one := failure(row)) is not None and one.kind in kinds]
        if found:
            row, one = found[0]
            place = f"{row['axis']} {row['axis_value']} {row['light']}"
            line = f"shadowbench: {what} in {len(found)} of {len(rows)} cells; the first: {row['spec']} at {place}: "
            err.print(line + one.text, markup=False, soft_wrap=True)
            code = verdict
    return code
