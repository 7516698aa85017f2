"""`run`: a study from options, the run, its table."""

import dataclasses
import operator
import time
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from rich.markup import escape
from rich.table import Table

from shadowbench.commands.console import (
    ConsoleReporter,
    check_folder,
    err,
    number,
    out,
    print_json,
    print_table,
    say_unsupported,
    techniques_with,
)
from shadowbench.errors import InputError
from shadowbench.measure.machine import write_run_file
from shadowbench.measure.place import Limits
from shadowbench.measure.profile import ACTIVITIES, MEASURING, share, whole
from shadowbench.measure.session import Session
from shadowbench.measure.worker import Worker
from shadowbench.reports.folder import Run, write_cells
from shadowbench.reports.words import counted
from shadowbench.studies.file import find_study, read_study
from shadowbench.studies.run import run_study
from shadowbench.studies.study import Study
from shadowbench.studies.sweeps import Curve, curves, places
from shadowbench.studies.tables import (
    Slope,
    SummaryRow,
    cells_frame,
    over_scenes,
    phase_note,
    reference_times,
    slopes,
    summary,
)
from shadowbench.studies.times import time_notes
from shadowbench.techniques.spec import Spec, parse_spec

_COLUMNS = {  # heading: (value, or "error" for 1 − IoU)
    "1 − IoU": "error",
    "IoU soft": "iou_soft",
    "SSIM": "ssim",
    "edge px": "edge_px",
    "acne": "acne",
    "leak": "leak",
    "contact": "contact",
    "ms": "frame_ms",
    "× ref": "ratio",
    "MiB": "gpu_bytes",  # five cascades of a size are no equal of one map
}
_WIDE = 110  # characters; a narrower terminal gets the columns that matter most
_NARROW = ("error", "ssim", "frame_ms", "ratio")
_OPTIONAL = ("frame_ms", "ratio", "gpu_bytes")  # shown where a row has them


@dataclass(frozen=True)
class RunOptions:
    """What the command line says of a study; None and empty leave it to the study file."""

    scenes: tuple[str, ...]
    study: str | None
    specs: tuple[str, ...]
    map_size: str | None
    view_size: int | None
    rounds: int | None
    phases: int | None
    time_again: bool
    view: str | None
    light: str | None
    plugins: tuple[Path, ...]
    assets: Path | None
    up: str | None


def run_command(options: RunOptions, folder: Path, *, profile: bool, as_json: bool, quiet: bool) -> int:
    """Run, write `table.csv` and `run.json`, print a table per scene; 3 when a cell failed, else 0."""
    study = study_from(options)
    check_folder(folder)
    limits = Limits(study.time_limit, int(study.memory_limit * 2**30))
    start = time.perf_counter()
    with ConsoleReporter(quiet) as reporter, Worker(options.plugins, limits) as worker:
        if not options.scenes and not options.study:
            reporter.note(_estimate(study))
        ran = run_study(study, folder, worker, reporter, options.time_again)
        info, spent = worker.info, worker.call(Session.spent) if profile else {}
    swept = places(study.sweeps)
    write_run_file(folder / "run.json", info, ran.notes, study.facts, [one.score for one in ran.results])
    whole_folder = write_cells(folder, ran.results, swept)
    frame = cells_frame(ran.results)
    if whole_folder.earlier and not quiet:
        err.print(f"note: {folder}: {_found_before(whole_folder)}", markup=False, soft_wrap=True)
    tables, references, fits = summary(frame), reference_times(frame), slopes(frame)
    if as_json:
        print_json({scene: [dataclasses.asdict(row) for row in rows] for scene, rows in tables.items()})
    else:
        times = "; times of a software renderer, not of a GPU" if info.software else "; times of this GPU"
        times = times if study.rounds else ""
        for scene, rows in tables.items():
            rough = [row.wide for row in rows if row.values["frame_ms"] is not None]
            notes = [*_notes(rows), *time_notes(references[scene], rough)]
            _print_scene(f"{scene}, best first{times}", rows, [fit for fit in fits if fit.scene == scene], notes)
            _print_curves(scene, curves(rows, swept))
        scenes, means = over_scenes(tables)
        if len(scenes) > 1:
            _print_scene(f"mean of the {len(scenes)} scenes in which every cell held", means, [], [])
        held = [row for rows in tables.values() for row in rows if row.cells]
        if held and out.width < _WIDE:
            dropped = ", ".join(name for name in _columns(held, False) if name not in _columns(held, True))
            where = f"{folder / 'table.csv'} or a terminal of {_WIDE}"
            out.print(f"columns left out at {out.width} characters, see {where}: {dropped}", soft_wrap=True)
        if not quiet:
            cells = counted(len(whole_folder.rows), "cell")
            beside = "; masks/ and pictures/ beside it" if (frame["status"] == "ok").any() else ""
            out.print(f"{folder / 'table.csv'}: {cells}{beside}", soft_wrap=True)
    if profile:
        _print_profile(whole(ran.profile.seconds, spent, time.perf_counter() - start))
    say_unsupported(list(frame["status"]))
    failed = [status for status in frame["status"] if status.startswith("failed")]
    if failed:
        first = failed[0].removeprefix("failed: ")
        line = f"shadowbench: {len(failed)} of {len(frame)} cells failed; the first: {first}"
        err.print(line, markup=False, soft_wrap=True)
    return 3 if failed else 0


def _found_before(run: Run) -> str:
    """What stands in the folder beside the cells of this command."""
    rows = [row for row in run.rows if row["key"] in run.earlier]
    named = [counted(len({row[what] for row in rows}), what) for what in ("scene", "spec")]
    found = f"found {counted(len(rows), 'cell')} of earlier commands ({', '.join(named)})"
    return f"{found}; they stay in table.csv and in reports"


def study_from(options: RunOptions) -> Study:
    """The study that the options make; raises InputError for what they get wrong."""
    stray = [scene for scene in options.scenes if scene.isdecimal()]
    if options.map_size is not None and stray:
        together = ",".join([options.map_size, *stray])
        raise InputError(f"--map-size: found {options.map_size!r:.60} and {stray[0]!r:.60} apart; allowed: {together}")
    known = techniques_with(options.plugins)
    study = read_study(find_study(options.study or "default"), known)
    if options.specs and not (options.study or options.map_size):
        study = replace(study, map_sizes=(), phases=1)  # specs alone mean what they say
    if options.specs or options.phases:
        study = replace(study, own_phases={})
    specs = tuple(parse_spec(text, known) for text in options.specs)
    changes = {
        "scenes": options.scenes,
        "specs": specs,
        "map_sizes": map_sizes(options.map_size),
        "view_size": options.view_size,
        "rounds": options.rounds,
        "phases": options.phases,
        "views": (options.view,) if options.view else None,
        "lights": (options.light,) if options.light else None,
        "assets": options.assets,
        "up": options.up,
        "notes": (*study.notes, *_sized(specs, options.map_size)),
    }
    return replace(study, **{key: value for key, value in changes.items() if value not in (None, ())})  # type: ignore[arg-type]


def _sized(specs: Sequence[Spec], asked: str | None) -> list[str]:
    """What to say of specs that name a size where --map-size asks for others."""
    named = [spec.text for spec in specs if "size" in spec.named] if asked else []
    return [f"{name} names its size, which --map-size {asked} leaves as it is" for name in named]


def map_sizes(text: str | None) -> tuple[int, ...]:
    """The sizes that --map-size names; raises InputError."""
    if text is None:
        return ()
    try:
        sizes = [int(part) for part in text.split(",")]
    except ValueError:
        sizes = []
    if not sizes or min(sizes) < 1 or max(sizes) > 65536:
        raise InputError(f"--map-size: found {text!r:.60}; allowed: whole numbers from 1 to 65536, separated by commas")
    return tuple(sizes)


def _estimate(study: Study) -> str:
    """Rough, from a machine of two cores without a GPU; a GPU takes less."""
    cells = study.cells()
    frames = [(study.rounds * 4 / 3 if cell.phase == 0 else 0) + 4 for cell in cells]
    pixels = [study.view_size**2 + (cell.spec.map_size or 0) ** 2 for cell in cells]
    seconds = sum(map(operator.mul, pixels, frames)) * 1e-9 * 12 * len(study.scenes)
    count = len(cells) * len(study.scenes)
    return f"{count} cells on {len(study.scenes)} scenes: about {max(seconds, 5):.0f} s on two cores without a GPU"


def _print_scene(title: str, rows: list[SummaryRow], fits: list[Slope], notes: list[str]) -> None:
    """A line for each spec and map size that held, best first; then what did not hold, the slopes, and notes."""
    table = Table(title=title, title_justify="left", box=None, pad_edge=False)
    table.add_column("spec")
    table.add_column("map", justify="right", no_wrap=True)
    columns = _columns(rows, out.width < _WIDE)
    for heading in columns:
        table.add_column(heading, justify="right", no_wrap=True)
    for row in rows:
        if row.cells:
            size = str(row.map_size or "")
            table.add_row(escape(row.spec), size, *(_cell(row, key) for key in columns.values()))
    if table.row_count:
        print_table(table)
    else:
        out.print(title, markup=False)
    for row in rows:
        for status, count in Counter(row.refused).items():
            share = f"{count} of {row.cells + len(row.refused)} cells " if row.cells + len(row.refused) > 1 else ""
            out.print(f"  {row.spec} {row.map_size or ''}: {share}{status}", markup=False, soft_wrap=True)
    for fit in fits:
        sizes = f"{fit.sizes[0]} to {fit.sizes[-1]}"
        slope = fit.slope.text(_signed) + (", one phase" if fit.phases == 1 else "")
        line = f"  slope of log(1 − IoU) over log(size), {sizes}: {slope}  {fit.spec}"
        out.print(line, markup=False, soft_wrap=True)
    for line in notes:
        out.print(f"  {line}", markup=False, soft_wrap=True)
    out.print()


def _notes(rows: list[SummaryRow]) -> list[str]:
    """Of how many cells a table's numbers are medians, and which maps were scored in one phase."""
    cells = max(row.cells for row in rows)
    medians = f"medians of up to {cells} cells (views × phases), the error with its 95% interval" if cells > 1 else None
    return [note for note in (medians, phase_note(rows)) if note is not None]


def _columns(rows: Sequence[SummaryRow], narrow: bool) -> dict[str, str]:
    """The columns of a table, by heading: few on a narrow terminal; no optional one that no row has."""
    lacking = {key for key in _OPTIONAL if all(row.values.get(key) is None for row in rows)}
    return {heading: key for heading, key in _COLUMNS.items() if key not in lacking and (key in _NARROW or not narrow)}


def _print_curves(scene: str, found: list[Curve]) -> None:
    """A line for each factor of a swept bias, as it grows: acne falls, contact rises; the best beside the default."""
    if not found:
        return
    title = f"{scene}, bias multiplied: acne against contact (peter-panning)"
    table = Table(title=title, title_justify="left", box=None, pad_edge=False)
    table.add_column("spec")
    for heading in ("map", "× bias", "acne", "contact", "1 − IoU", "SSIM", ""):
        table.add_column(heading, justify="left" if not heading else "right", no_wrap=True)
    for curve in found:
        for factor, row in curve.rows:
            marks = [*(["default"] if factor == 1 else []), *(["best"] if factor == curve.best else [])]
            cells = [_cell(row, key) for key in ("acne", "contact", "error", "ssim")]
            table.add_row(escape(row.spec), str(row.map_size or ""), f"{factor:g}", *cells, ", ".join(marks))
    print_table(table)
    out.print()


def _cell(row: SummaryRow, key: str) -> str:
    """The error with its interval, the median alone of all else; a time that is rough is marked."""
    value = row.values.get("iou" if key == "error" else key)
    if value is None:
        return "–"
    if key == "gpu_bytes":
        return f"{value.median / 2**20:.1f}"
    if key == "error":
        return value.complement().text(number)
    return f"~{number(value.median)}" if key == "frame_ms" and row.wide else number(value.median)


def _signed(value: float) -> str:
    return f"{value:+.2f}"


def _print_profile(seconds: Mapping[str, float]) -> None:
    total = sum(seconds.values())
    for activity, value in sorted(seconds.items(), key=lambda item: -item[1]):
        err.print(f"{activity:<9} {value:8.2f} s  {value / total:6.1%}  {ACTIVITIES[activity]}", soft_wrap=True)
    err.print(
        f"{total:.2f} s in all, {share(seconds):.1%} of it inside GL passes, ray tracing and scoring; "
        f"{share(seconds, (*MEASURING, 'prepare')):.1%} with what is measured as prepare_ms",
        soft_wrap=True,
    )
