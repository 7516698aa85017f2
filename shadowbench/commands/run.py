"""`run`: measure a study and print its tables."""

import dataclasses
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from shadowbench.commands import completion, console
from shadowbench.commands.executors import campaigns
from shadowbench.commands.options import (
    SCENE,
    SPEC,
    KeepGoing,
    PartOption,
    Plugins,
    Printed,
    StudyMachines,
    grouped,
    map_sizes,
)
from shadowbench.commands.study_tables import print_study
from shadowbench.errors import InputError
from shadowbench.options import Measuring, ViewOptions

if TYPE_CHECKING:
    from shadowbench.results.folder import Run
    from shadowbench.studies.crossing import Techniques
    from shadowbench.studies.run import StudyResult
    from shadowbench.studies.study import Study

app = typer.Typer()


@app.command(
    epilog="\b\nColumns\n"
    "  spec      the technique and its parameters\n"
    "  map       texels along a side of its shadow map\n"
    "  1 − IoU   error: 1 − intersection over union of the shadows; 0 is exact\n"
    "  IoU soft  IoU with partial shadow; 1 is exact\n"
    "  SSIM      structural similarity of the shadow masks; 1 is exact\n"
    "  edge px   mean distance between drawn and true shadow edges, in pixels\n"
    "  acne      share of the lit area, away from edges, that is in shadow\n"
    "  leak      share of the shadow, away from edges, that is lit\n"
    "  contact   share of the shadow next to its caster that is lit (peter-panning)\n"
    "  RMSE      of soft shadows (lights with a size), which it ranks: root mean\n"
    "            square error of visibility; RMSE pen: in the penumbra\n"
    "  flips     share of the pixels near edges that flicker after a step (--step)\n"
    "  ms        time of a frame's shadows; ~ marks a time that varied widely\n"
    "  × ref     time relative to the reference technique\n"
    "  MiB       memory of textures and buffers\n\n"
    "`shadowbench list metrics` has the exact definitions, also of the other columns of soft shadows; < marks a value "
    "below the truth's own error. A slope, below a table, is the median of the slopes of each view, light and phase."
)
@grouped
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
    output: Annotated[
        Path, typer.Option("-o", "--output", metavar="DIR", help="Folder for the table, masks and pictures.")
    ] = Path("results/latest"),
    plugin: Plugins = None,
    *,
    measuring: Measuring,
    time_again: Annotated[
        bool,
        typer.Option(
            "--time-again",
            rich_help_panel="Measurement",
            help="Time cells again that have been timed before; `check DIR --repeat` compares the two times.",
        ),
    ] = False,
    options: ViewOptions,
    machines: StudyMachines,
    part: PartOption = None,
    printed: Printed,
    keep_going: KeepGoing = False,
) -> None:
    """Measure techniques: accuracy against ray tracing, and time.

    Draws each technique in each scene, compares its shadows with ray-traced ones and times it. Prints one table per
    scene, most accurate first; table.csv, masks and pictures go to the output folder. An interrupted run resumes when
    the command is repeated. Without arguments: three scenes, every technique at its defaults, map sizes 512 to 4096.

    \b
    For example
      shadowbench run cube-on-plane -t shadow-map --map-size 512,1024
      shadowbench run my.glb -t unshadowed -t 'shadow-map:bias=slope,filter=pcf(taps=5)'
      shadowbench run -s presets -o results/presets
    """
    from shadowbench.measure.worker import Worker

    stray = [scene for scene in scenes or () if scene.isdecimal()]
    if map_size is not None and stray:
        together = ",".join([map_size, *stray])
        raise InputError(
            f"--map-size: found {map_size!r:.60} and {stray[0]!r:.60} as separate arguments; allowed: {together}"
        )
    with ExitStack() as stack:
        # It starts while the rest is imported and the study is read.
        worker = None if machines.dask is not None else stack.enter_context(Worker(plugin or ()))
        from shadowbench.measure.plugin_output import techniques_with
        from shadowbench.plugin.spec import parse_spec
        from shadowbench.studies.run import Part, estimate, measure
        from shadowbench.studies.study import study_from_options

        chosen_part = Part.named(part)
        known = techniques_with(plugin or ())
        specs = [parse_spec(text, known) for text in techniques or ()]
        reporter = stack.enter_context(console.Reporter(printed.quiet))
        measuring = _timed(measuring, machines, reporter)
        asked = study_from_options(
            known, scenes or (), specs, study=study, map_size=map_sizes(map_size), measuring=measuring, view=options
        )
        if machines.time_on is not None and asked.rounds == 0:
            raise InputError(f"--time-on {machines.time_on}: found 0 rounds; allowed: 1 or more")
        if not scenes and not study and part is None:
            cells, seconds = estimate(asked)
            on = f"{len(asked.scenes)} scenes"
            reporter.note(f"{cells} cells in {on}: about {seconds:.0f} s on two cores without a GPU")
        if worker is not None:
            worker.limits = asked.limits
        where = (output, machines, plugin or (), asked.limits, reporter, worker)
        at = stack.enter_context(campaigns(*where, time_again=time_again, keep_going=keep_going))
        found = measure(asked, at, chosen_part)
    _print(found, output, printed)
    raise typer.Exit(_exit_code(found, asked, known))


def _timed(measuring: Measuring, machines: StudyMachines, reporter: console.Reporter) -> Measuring:
    """How the study is measured: with --dask it is only timed where --time-on says. Raises InputError."""
    if machines.dask is None or machines.time_on is not None or measuring.rounds == 0:
        return measuring
    if measuring.rounds:
        given = f"--rounds {measuring.rounds} with --dask: times belong to one machine"
        raise InputError(f"{given}; allowed: --rounds 0, or --time-on here or a worker")
    reporter.note("nothing is timed: --time-on says on which machine")
    return dataclasses.replace(measuring, rounds=0)


def _print(found: "StudyResult", output: Path, printed: Printed) -> None:
    if found.run.earlier and not printed.quiet:
        console.print_error(f"note: {output}: {_earlier_cells_note(found.run)}")
    if not printed.json:
        print_study(found, output, printed.quiet)
        return
    from shadowbench.results.configurations import sections

    made = [section for parts in sections([found.run.last]).values() for section in parts]
    console.print_json({section.scene: list(map(dataclasses.asdict, section.configurations)) for section in made})


def _exit_code(found: "StudyResult", asked: "Study", known: "Techniques") -> int:
    """3 if a cell failed or something was left out, else 0; what it was, and why nothing was drawn, is printed."""
    results = found.run.last.results
    statuses = [one.status for one in results]
    if "ok" not in statuses and not found.failures:
        console.print_unsupported(statuses, _others(asked, known))
    failed = [
        ("cell", f"{one.score['scene']} {one.score['spec']}", one.status.removeprefix("failed: "))
        for one in results
        if one.status.startswith("failed")
    ]
    if found.failures or len({reason for _, _, reason in failed}) > 1:
        console.print_failures([*((one.what, one.where, one.reason) for one in found.failures), *failed])
    if failed:
        console.print_error(f"shadowbench: {len(failed)} of {len(statuses)} cells failed; the first: {failed[0][2]}")
    return 3 if failed or found.failures else 0


def _others(study: "Study", known: "Techniques") -> list[str]:
    """The real-time techniques that support all lights of a study, if one of its own does not."""
    lights = [block.view.light for block in study.blocks()]
    kinds, soft = {light.hard_kind for light in lights}, all(light.soft for light in lights)
    able = [
        name
        for name, technique in known.items()
        if kinds <= technique.lights and (soft or not technique.catalogue.soft_only)
    ]
    if all(spec.technique.name in able for spec in study.specs):
        return []
    return [name for name in able if not known[name].catalogue.never_recommended]


def _earlier_cells_note(run: "Run") -> str:
    """A note on the cells of earlier commands in the folder."""
    from shadowbench.errors import counted

    rows = [row for row in run.rows if row["key"] in run.earlier]
    named = [counted(len({row[what] for row in rows}), what) for what in ("scene", "spec")]
    found = f"the folder also holds {counted(len(rows), 'cell')} of earlier commands ({', '.join(named)})"
    return f"{found}; they are in table.csv and in reports"
