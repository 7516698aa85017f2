"""`run`: measure a study and print its tables."""

from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from shadowbench.commands import completion, console
from shadowbench.commands.options import SCENE, SPEC, Assets, Json, Plugins, Quiet, Up, ViewName, ViewSize, map_sizes
from shadowbench.errors import InputError

if TYPE_CHECKING:
    from shadowbench.studies.folder import Run
    from shadowbench.studies.measure import StudyResult
    from shadowbench.studies.sweeps import Curve
    from shadowbench.studies.tables import Slope, SummaryRow

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
    "MiB": "gpu_bytes",  # five cascades need more memory than one map of the same size
}
_WIDE = 110  # characters; a narrower terminal gets the columns that matter most
_NARROW = ("error", "ssim", "frame_ms", "ratio")
_OPTIONAL = ("frame_ms", "ratio", "gpu_bytes")  # shown where a row has them

app = typer.Typer()


@app.command(
    epilog="\b\nFor example\n"
    "  shadowbench run cube-on-plane -t shadow-map --map-size 512,1024\n"
    "  shadowbench run my.glb -t unshadowed -t 'shadow-map:bias=slope,filter=pcf(taps=5)'\n"
    "  shadowbench run -s presets -o results/presets"
)
def run(
    scenes: Annotated[
        list[str] | None,
        typer.Argument(metavar="SCENE", autocompletion=completion.scene, help=f"Each is {SCENE}  [the study's]."),
    ] = None,
    study: Annotated[
        str | None,
        typer.Option(
            "-s",
            "--study",
            metavar="STUDY",
            autocompletion=completion.study,
            help="A study file (.toml), which names scenes, techniques and options, or a built-in study "
            "(shadowbench list studies).",
        ),
    ] = None,
    techniques: Annotated[
        list[str] | None,
        typer.Option(
            "-t",
            "--technique",
            metavar="SPEC",
            autocompletion=completion.spec,
            help=f"Technique to measure: {SPEC}; repeatable  [the study's].",
        ),
    ] = None,
    map_size: Annotated[
        str | None,
        typer.Option(
            metavar="N,N,...",
            help="Shadow-map sizes in texels along a side; each spec that does not set its own is measured at all of "
            "them  [the study's; with -t and no study, the technique's default].",
        ),
    ] = None,
    view_size: ViewSize = None,
    rounds: Annotated[
        int | None,
        typer.Option(
            metavar="N", min=0, max=10000, help="Number of times that each cell is timed; 0 for no timing  [9]."
        ),
    ] = None,
    phases: Annotated[
        int | None,
        typer.Option(
            metavar="N",
            min=1,
            max=10000,
            help="Sub-texel offsets of the shadow map at which each cell is scored; with more than one, the table "
            "shows medians and intervals. Only the first is timed  [the study's; with -t and neither study nor "
            "--map-size, 1].",
        ),
    ] = None,
    time_again: Annotated[
        bool,
        typer.Option(
            "--time-again", help="Time cells again that have been timed before; `repeat DIR` compares the two times."
        ),
    ] = False,
    view: ViewName = None,
    light: Annotated[
        str | None, typer.Option("--light", metavar="NAME", help="Name of a light of the scene  [each in turn].")
    ] = None,
    plugin: Plugins = None,
    assets: Assets = None,
    up: Up = None,
    profile: Annotated[
        bool, typer.Option("--profile", help="Print the time that each part of the measurement took.")
    ] = False,
    output: Annotated[
        Path, typer.Option("-o", "--output", metavar="DIR", help="Folder for the table, masks and pictures.")
    ] = Path("results/latest"),
    json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Measure techniques: accuracy against ray tracing, and time.

    Draws each technique in each scene, compares its shadows with ray-traced ones and times it. Prints one table per
    scene, most accurate first; table.csv, masks and pictures go to the output folder. An interrupted run resumes when
    the command is repeated. Without arguments: three scenes, every technique at its defaults, map sizes 512 to 4096.

    \b
    Columns
      spec      the technique and its parameters
      map       texels along a side of its shadow map
      1 − IoU   error: 1 − intersection over union of the shadows; 0 is exact
      IoU soft  IoU with partial shadow; 1 is exact
      SSIM      structural similarity of the shadow masks; 1 is exact
      edge px   mean distance between drawn and true shadow edges, in pixels
      acne      share of the lit area, away from edges, that is in shadow
      leak      share of the shadow, away from edges, that is lit
      contact   share of the shadow next to its caster that is lit (peter-panning)
      ms        time of a frame's shadows; ~ marks a time that varied widely
      × ref     time relative to the reference technique
      MiB       memory of textures and buffers
    `shadowbench list metrics` has the exact definitions.
    """
    import dataclasses

    from shadowbench.measure.executor import Limits
    from shadowbench.measure.plugin_output import techniques_with
    from shadowbench.measure.worker import Worker
    from shadowbench.studies.measure import estimate, measure, study_from_options
    from shadowbench.studies.tables import summary
    from shadowbench.techniques.spec import parse_spec

    stray = [scene for scene in scenes or () if scene.isdecimal()]
    if map_size is not None and stray:
        together = ",".join([map_size, *stray])
        raise InputError(f"--map-size: found {map_size!r:.60} and {stray[0]!r:.60} apart; allowed: {together}")
    known = techniques_with(plugin or ())
    asked = study_from_options(
        known,
        scenes or (),
        [parse_spec(text, known) for text in techniques or ()],
        study=study,
        map_size=map_sizes(map_size),
        view_size=view_size,
        rounds=rounds,
        phases=phases,
        view=view,
        light=light,
        assets=assets,
        up=up,
    )
    limits = Limits(asked.time_limit, int(asked.memory_limit * 2**30))
    with console.Reporter(quiet) as reporter, Worker(plugin or (), limits) as worker:
        if not scenes and not study:
            cells, seconds = estimate(asked)
            on = f"{len(asked.scenes)} scenes"
            reporter.note(f"{cells} cells in {on}: about {seconds:.0f} s on two cores without a GPU")
        found = measure(asked, output, worker, reporter, time_again=time_again, profile=profile)
    if found.run.earlier and not quiet:
        console.complain(f"note: {output}: {_found_before(found.run)}")
    if json:
        tables = summary(found.frame)
        console.print_json({scene: [dataclasses.asdict(row) for row in rows] for scene, rows in tables.items()})
    else:
        _print(found, output, quiet)
    if profile:
        _print_profile(found.seconds)
    statuses = list(found.frame["status"])
    console.say_unsupported(statuses)
    failed = [status for status in statuses if status.startswith("failed")]
    if failed:
        first = failed[0].removeprefix("failed: ")
        console.complain(f"shadowbench: {len(failed)} of {len(statuses)} cells failed; the first: {first}")
    raise typer.Exit(3 if failed else 0)


def _found_before(run: "Run") -> str:
    """What the folder holds beside the cells of this command."""
    from shadowbench.reports.words import counted

    rows = [row for row in run.rows if row["key"] in run.earlier]
    named = [counted(len({row[what] for row in rows}), what) for what in ("scene", "spec")]
    found = f"the folder also holds {counted(len(rows), 'cell')} of earlier commands ({', '.join(named)})"
    return f"{found}; they are in table.csv and in reports"


def _print(found: "StudyResult", folder: Path, quiet: bool) -> None:
    """One table per scene, one over all scenes, and the path of table.csv."""
    from shadowbench.reports.words import counted
    from shadowbench.studies.sweeps import curves
    from shadowbench.studies.tables import mean_over_scenes, reference_times, slopes, summary
    from shadowbench.studies.times import time_notes

    tables, references, fits = summary(found.frame), reference_times(found.frame), slopes(found.frame)
    times = "; times of a software renderer, not of a GPU" if found.info.software else "; times of this GPU"
    times = times if found.study.rounds else ""
    for scene, rows in tables.items():
        rough = [row.wide for row in rows if row.values["frame_ms"] is not None]
        notes = [*_notes(rows), *time_notes(references[scene], rough)]
        _print_scene(f"{scene}, best first{times}", rows, [fit for fit in fits if fit.scene == scene], notes)
        _print_curves(scene, curves(rows, found.sweep_positions))
    scenes, means = mean_over_scenes(tables)
    if len(scenes) > 1:
        _print_scene(f"mean over the {len(scenes)} scenes in which every cell was drawn", means, [], [])
    held = [row for rows in tables.values() for row in rows if row.cells]
    if held and console.out().width < _WIDE:
        dropped = ", ".join(name for name in _columns(held, False) if name not in _columns(held, True))
        where = f"see {folder / 'table.csv'}, or widen the terminal to {_WIDE}"
        console.say(f"columns left out at a width of {console.out().width} characters ({where}): {dropped}")
    if not quiet:
        beside = "; masks/ and pictures/ are beside it" if (found.frame["status"] == "ok").any() else ""
        console.say(f"{folder / 'table.csv'}: {counted(len(found.run.rows), 'cell')}{beside}")


def _print_scene(title: str, rows: "list[SummaryRow]", fits: "list[Slope]", notes: list[str]) -> None:
    """A line for each spec and map size that was drawn, best first; then what was not, the slopes, and notes."""
    columns = _columns(rows, console.out().width < _WIDE)
    held = [
        (row.spec, str(row.map_size or ""), *(_cell(row, key) for key in columns.values())) for row in rows if row.cells
    ]
    if held:
        console.print_table(title, ("spec", "map", *columns), held, numbers=("map", *columns))
    else:
        console.out().print(title, markup=False)
    for row in rows:
        for status, count in Counter(row.refused).items():
            total = row.cells + len(row.refused)
            share = f"{count} of {total} cells " if total > 1 else ""
            console.say(f"  {row.spec} {row.map_size or ''}: {share}{status}")
    for fit in fits:
        sizes = f"{fit.sizes[0]} to {fit.sizes[-1]}"
        slope = fit.slope.text("{:+.2f}".format) + (", one phase" if fit.phases == 1 else "")
        console.say(f"  slope of log(1 − IoU) over log(size), {sizes}: {slope}  {fit.spec}")
    for line in notes:
        console.say(f"  {line}")
    console.out().print()


def _notes(rows: "list[SummaryRow]") -> list[str]:
    """How many cells the medians of a table are over, and which maps were scored in one phase only."""
    from shadowbench.studies.tables import phase_note

    cells = max(row.cells for row in rows)
    medians = (
        f"medians of up to {cells} cells (views × phases); in brackets the 95% interval of 1 − IoU"
        if cells > 1
        else None
    )
    return [note for note in (medians, phase_note(rows)) if note is not None]


def _columns(rows: "Sequence[SummaryRow]", narrow: bool) -> dict[str, str]:
    """The columns of a table, by heading: fewer on a narrow terminal, no optional one that is empty."""
    lacking = {key for key in _OPTIONAL if all(row.values.get(key) is None for row in rows)}
    return {heading: key for heading, key in _COLUMNS.items() if key not in lacking and (key in _NARROW or not narrow)}


def _print_curves(scene: str, found: "list[Curve]") -> None:
    """A line for each factor of a swept bias, in ascending order: acne falls, contact rises."""
    if not found:
        return
    rows = []
    for curve in found:
        for factor, row in curve.rows:
            marks = [*(["default"] if factor == 1 else []), *(["best"] if factor == curve.best else [])]
            cells = [_cell(row, key) for key in ("acne", "contact", "error", "ssim")]
            rows.append((row.spec, str(row.map_size or ""), f"{factor:g}", *cells, ", ".join(marks)))
    numbers = ("map", "× bias", "acne", "contact", "1 − IoU", "SSIM")
    title = f"{scene}, bias multiplied by a factor: acne against contact (peter-panning)"
    console.print_table(title, ("spec", *numbers, ""), rows, numbers=numbers, whole=("",))
    console.out().print()


def _cell(row: "SummaryRow", key: str) -> str:
    """The error with its interval, else the median; ~ before a time whose rounds varied much."""
    value = row.values.get("iou" if key == "error" else key)
    if value is None:
        return "–"
    if key == "gpu_bytes":
        return f"{value.median / 2**20:.1f}"
    if key == "error":
        return value.complement().text(console.number)
    return f"~{console.number(value.median)}" if key == "frame_ms" and row.wide else console.number(value.median)


def _print_profile(seconds: Mapping[str, float]) -> None:
    from shadowbench.measure.profile import ACTIVITIES, MEASURING, share

    total = sum(seconds.values())
    for activity, value in sorted(seconds.items(), key=lambda item: -item[1]):
        console.complain(f"{activity:<9} {value:8.2f} s  {value / total:6.1%}  {ACTIVITIES[activity]}")
    console.complain(
        f"{total:.2f} s in all: {share(seconds):.1%} in GL passes, ray tracing and scoring, "
        f"{share(seconds, (*MEASURING, 'prepare')):.1%} with the preparation that prepare_ms measures"
    )
