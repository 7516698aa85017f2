"""`run`: measure a study and print its tables."""

from contextlib import ExitStack
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Annotated

from shadowbench.commands import console, options
from shadowbench.commands.study_tables import print_study
from shadowbench.errors import InputError, counted
from shadowbench.options import Measuring, ViewOptions, option


@dataclass(frozen=True)
class RunOptions:
    """What is measured, and where results go."""

    study: str | None = option(
        "A study file (.toml), which names scenes, techniques and options, or a built-in study (shadowbench list "
        "studies).",
        "STUDY",
        names=("-s", "--study"),
    )
    techniques: list[str] = options.technique(
        f"Technique to measure: {options.SPEC}; repeatable  [the study's].", default=()
    )
    map_size: str | None = option(
        "Shadow-map sizes in texels along a side; each spec that does not set its own is measured at all of them  [the "
        "study's; with -t and no study, the technique's default].",
        "N,N,...",
    )
    output: Path = options.output("Folder for the table, masks and pictures.", default=Path("results/latest"))
    plugin: list[Path] = options.plugins()
    time_again: bool = option(
        "Time cells again that have been timed before.",
        default=False,
        heading="Measurement",
    )
    part: str | None = options.part()
    keep_going: bool = options.keep_going()


@options.command(
    "\b\nColumns\n"
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
    "  ms        time of a frame's shadows on a GPU; ~ marks one that varied widely\n"
    "            without a GPU: predicted for a device on record (predicted ms), or\n"
    "            under a light with a size work, in millions (M)\n"
    "  × ref     time relative to the reference technique\n"
    "  MiB       memory of textures and buffers\n\n"
    "`shadowbench list metrics` has the exact definitions, also of the other columns of soft shadows; < marks a value "
    "below the truth's own error."
)
def run(
    scenes: Annotated[list[str] | None, options.argument("SCENE", f"Each is {options.SCENE}  [the study's].")] = None,
    *,
    measuring: Measuring,
    view: ViewOptions,
    machines: options.Machines,
    printed: options.Printed,
    chosen: RunOptions,
) -> int:
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

    with ExitStack() as stack:
        # It starts while the rest is imported and the study is read.
        worker = None if machines.dask is not None else stack.enter_context(Worker(chosen.plugin))
        from shadowbench.campaigns import campaign_in
        from shadowbench.measure.plugin_output import subjects_with
        from shadowbench.plugin.spec import parse_spec
        from shadowbench.studies.run import Part, measure
        from shadowbench.studies.study import study_from_options

        chosen_part = Part.named(chosen.part)
        known = subjects_with(chosen.plugin)
        specs = [parse_spec(text, known) for text in chosen.techniques]
        sizes = options.map_sizes(chosen.map_size)
        reporter = stack.enter_context(console.Reporter(printed.quiet))
        if machines.dask is not None:
            if measuring.rounds:
                raise InputError(f"--rounds {measuring.rounds}: nothing is timed with --dask; allowed: 0")
            measuring = replace(measuring, rounds=0)
        study = study_from_options(
            known, scenes or (), specs, study=chosen.study, map_size=sizes, measuring=measuring, view=view
        )
        if worker is not None:
            worker.limits = study.limits
        where = campaign_in(
            chosen.output,
            reporter,
            chosen.plugin,
            study.limits,
            worker=worker,
            **asdict(machines),
            time_again=chosen.time_again,
            keep_going=chosen.keep_going,
        )
        result = measure(study, stack.enter_context(where), chosen_part)
    if result.run.older and not printed.quiet:
        rows = f"{counted(result.run.older, 'row')} of earlier commands"
        why = "of cells with these names, but of another file, setting or version; another -o keeps both"
        console.print_error(f"note: {chosen.output}: table.csv and reports leave out {rows}: {why}")
    if printed.json:
        from shadowbench.results.law import law_on_record
        from shadowbench.results.summary import summaries

        shown = summaries(result.run.last, law_on_record())
        console.print_json({summary.scene: summary.records() for summary in shown})
    else:
        print_study(result, chosen.output, printed.quiet)
    return console.exit_code_of(result.run.last.results, result.failures)
