"""`run`: measure a study and print its tables."""

from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from shadowbench.commands import completion, console
from shadowbench.commands.executors import Places, check_without_dask, places
from shadowbench.commands.options import (
    SCENE,
    SPEC,
    Assets,
    Dask,
    Json,
    KeepGoing,
    NoGround,
    PartOption,
    Plugins,
    Quiet,
    Renderer,
    Sun,
    Up,
    ViewName,
    ViewSize,
    map_sizes,
)
from shadowbench.commands.study_tables import print_study
from shadowbench.errors import InputError

if TYPE_CHECKING:
    from shadowbench.studies.crossing import Techniques
    from shadowbench.studies.folder import Run
    from shadowbench.studies.study import Study

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
    step: Annotated[
        str | None,
        typer.Option(
            metavar="camera|light",
            autocompletion=completion.step,
            help="Draw each cell again after a small step of the camera or the light, and count the pixels that flip "
            "although the truth does not (shimmering). A step of the camera needs a truth and drawings of three times "
            "the view size  [the study's; none].",
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
    sun: Sun = False,
    no_ground: NoGround = False,
    part: PartOption = None,
    keep_going: KeepGoing = False,
    dask: Dask = None,
    renderer: Renderer = None,
    any_renderer: Annotated[
        bool,
        typer.Option(
            "--any-renderer", help="With --dask, use workers of every renderer; each makes rows and tables of its own."
        ),
    ] = False,
    time_on: Annotated[
        str | None,
        typer.Option(
            metavar="here|WORKER|each",
            help="With --dask, where cells are timed, after all are scored: in this process, on one worker (its "
            "address or machine), or on every machine, which a table compares  [nowhere].",
        ),
    ] = None,
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
      RMSE      of soft shadows (lights with a size), which it ranks: root mean
                square error of visibility; RMSE pen: in the penumbra
      flips     share of the pixels near edges that flicker after a step (--step)
      ms        time of a frame's shadows; ~ marks a time that varied widely
      × ref     time relative to the reference technique
      MiB       memory of textures and buffers
    `shadowbench list metrics` has the exact definitions, also of the other columns of soft shadows; < marks a value
    below the truth's own error. A slope, below a table, is the median of the slopes of each view, light and phase.
    """
    import dataclasses

    from shadowbench.measure.worker import Worker

    stray = [scene for scene in scenes or () if scene.isdecimal()]
    if map_size is not None and stray:
        together = ",".join([map_size, *stray])
        raise InputError(
            f"--map-size: found {map_size!r:.60} and {stray[0]!r:.60} as separate arguments; allowed: {together}"
        )
    if dask is None:
        check_without_dask({"--renderer": renderer, "--any-renderer": any_renderer, "--time-on": time_on})
    with ExitStack() as stack:
        # It starts while the rest is imported and the study is read.
        worker = None if dask is not None else stack.enter_context(Worker(plugin or ()))
        from shadowbench.measure.plugin_output import techniques_with
        from shadowbench.studies.measure import estimate, measure, study_from_options
        from shadowbench.studies.part import part_of
        from shadowbench.techniques.spec import parse_spec

        chosen_part = part_of(part)
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
            step=step,
            view=view,
            light=light,
            assets=assets,
            up=up,
            sun=sun or None,
            no_ground=no_ground or None,
        )
        reporter = stack.enter_context(console.Reporter(quiet))
        if not scenes and not study and part is None:
            cells, seconds = estimate(asked)
            on = f"{len(asked.scenes)} scenes"
            reporter.note(f"{cells} cells in {on}: about {seconds:.0f} s on two cores without a GPU")
        if worker is not None:
            worker.limits = asked.limits
            at = Places(asked, worker)
        else:
            assert dask is not None
            at = stack.enter_context(
                places(asked, dask, reporter, plugin or (), renderer, any_renderer, time_on, rounds)
            )
        found = measure(
            at.study,
            output,
            at.executor,
            reporter,
            others=at.others,
            timers=at.timers,
            time_again=time_again,
            part=chosen_part,
            keep_going=keep_going,
        )
    if found.run.earlier and not quiet:
        console.print_error(f"note: {output}: {_earlier_cells_note(found.run)}")
    if json:
        from shadowbench.studies.tables import summary

        tables = summary(found.frame)
        console.print_json({scene: [dataclasses.asdict(row) for row in rows] for scene, rows in tables.items()})
    else:
        print_study(found, output, quiet)
    statuses = list(found.frame["status"])
    if not any(found.frame["status"] == "ok") and not found.failures:
        console.print_unsupported(statuses, _others(asked, known))
    failed = [status for status in statuses if status.startswith("failed")]
    if found.failures or len(set(failed)) > 1:
        failed_cells = [
            ("cell", f"{row['scene']} {row['spec']}", status.removeprefix("failed: "))
            for row, status in zip((cell.score for cell in found.results), statuses, strict=True)
            if status.startswith("failed")
        ]
        console.print_failures([*((one.what, one.where, one.reason) for one in found.failures), *failed_cells])
    if failed:
        first = failed[0].removeprefix("failed: ")
        console.print_error(f"shadowbench: {len(failed)} of {len(statuses)} cells failed; the first: {first}")
    raise typer.Exit(3 if failed or found.failures else 0)


def _others(study: "Study", known: "Techniques") -> list[str]:
    """The real-time techniques that support all lights of a study, if one of its own does not."""
    lights = [block.view.light for block in study.blocks()]
    kinds, soft = {light.hard_kind for light in lights}, all(light.soft for light in lights)
    able = [
        name for name, technique in known.items() if kinds <= technique.lights and (soft or not technique.soft_only)
    ]
    if all(spec.technique.name in able for spec in study.specs):
        return []
    return [name for name in able if not known[name].never_recommended]


def _earlier_cells_note(run: "Run") -> str:
    """A note on the cells of earlier commands in the folder."""
    from shadowbench.reports.words import counted

    rows = [row for row in run.rows if row["key"] in run.earlier]
    named = [counted(len({row[what] for row in rows}), what) for what in ("scene", "spec")]
    found = f"the folder also holds {counted(len(rows), 'cell')} of earlier commands ({', '.join(named)})"
    return f"{found}; they are in table.csv and in reports"
