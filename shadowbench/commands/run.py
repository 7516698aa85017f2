"""`run`: measure a study and print its tables."""

from collections import Counter
from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from shadowbench.commands import console, options
from shadowbench.errors import InputError, counted, number
from shadowbench.options import Measuring, ViewOptions, option

if TYPE_CHECKING:
    from shadowbench.results.summary import Setting, Summary
    from shadowbench.studies.run import StudyResult

_COSTS = ("cost", "ratio", "gpu_bytes")  # memory: five cascades need more than one map of their size
_PENUMBRA = ("bias_pen", "bleed", "false_dark", "noise", "banding", "width", "hardening")
_MOVING = ("flicker", "false_change", "pop", "swim", "lag", "lag_bias")
# As they are shown.
_OF_HARD = ("error", "iou_soft", "ssim", "edge_px", "acne", "leak", "contact", "terminator", *_MOVING, *_COSTS)
_OF_SOFT = ("error", "rmse_pen", "iou", "ssim", *_PENUMBRA, *_MOVING, *_COSTS)
_HEADINGS = {  # of others it is the name
    "iou": "1 − IoU",
    "iou_soft": "IoU soft",
    "ssim": "SSIM",
    "rmse_pen": "RMSE pen",
    "ratio": "× ref",
    "gpu_bytes": "MiB",
}
_OPTIONAL = ("terminator", "bleed", "false_dark", "width", "hardening", *_MOVING, *_COSTS)  # shown where a row has them


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
    "  flicker … of a --sequence: changes of the mask that the truth does not make\n"
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
        from shadowbench.measure.gl_drawer import campaign_in
        from shadowbench.measure.plugin_output import subjects_with
        from shadowbench.plugin.spec import parse_spec
        from shadowbench.studies.run import measure
        from shadowbench.studies.study import study_from_options

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
        result = measure(study, stack.enter_context(where), chosen.part)
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
        _print_study(result, chosen.output, printed.quiet)
    return console.exit_code_of(result.run.last.results, result.failures)


def _print_study(study: "StudyResult", folder: Path, quiet: bool) -> None:
    """One table per scene, one over all scenes, and the path of table.csv."""
    from shadowbench.results.law import law_on_record
    from shadowbench.results.summary import by_kind, over_scenes, summaries

    run = study.run.last
    scenes = summaries(run, law_on_record())
    times = "; times of a software renderer, not of a GPU" if study.info.software else "; times of this GPU"
    for scene in scenes:
        costs = {
            "frame_ms": times if study.study.rounds else "",
            "predicted_ms": f"; ms predicted for {scene.device}",
            "work_cost": "; work in millions of shader invocations and texture reads",
        }
        _print_scene(scene, costs.get(scene.cost, ""))
    kinds = by_kind(scenes) if run.frame["renderer"].nunique() == 1 else []  # no mean over renderers
    for kind in (kind for kind in kinds if len(kind) > 1):
        hardness = "" if len(kinds) == 1 else "soft " if kind[0].soft else "hard "
        title = f"mean over the {len(kind)} {hardness}scenes, of what has a score in each"
        mean = over_scenes(kind, title)
        _print_settings(title, mean, mean.shown)
        console.print_text("")
    if not quiet:
        drawn = any(scene.max_cells for scene in scenes)
        beside = "; masks/ and pictures/ are beside it" if drawn else ""
        console.print_line(f"{folder / 'table.csv'}: {counted(len(study.run.rows), 'cell')}{beside}")


def _print_scene(scene: "Summary", costs: str) -> None:
    """A table with a line for each setting; then unsuccessful cells and notes."""
    from shadowbench.reports.texts import phase_note, preset_note
    from shadowbench.results.times import time_notes

    settings, error, lines = scene.lines, scene.ranked_by.error_label, []
    for one in settings:
        total = one.cells + len(one.refused)
        for status, count in Counter(one.refused).items():
            share = f"{count} of {total} cells " if total > 1 else ""
            lines.append(f"{one.name} {one.map_size or ''}: {share}{status}")
    if scene.max_cells > 1:
        several = f"medians of up to {scene.max_cells} cells (views × phases)"
        lines.append(f"{several}; in brackets the 95% interval of {error}")
    lines += filter(None, (phase_note(settings), preset_note(settings)))
    lines += time_notes(scene.reference, [one.rough for one in scene.timed])
    _print_settings(f"{scene.scene}, best first{' by RMSE' if scene.soft else ''}{costs}", scene, settings)
    for line in lines:
        console.print_line(f"  {line}")
    console.print_text("")


def _print_settings(title: str, summary: "Summary", settings: "Sequence[Setting]") -> None:
    columns = _columns(summary, settings)
    lines = [
        (one.name, str(one.map_size or ""), *(_cell(summary, one, key) for key in columns.values()))
        for one in settings
        if one.cells
    ]
    if lines:
        console.print_table(title, ("spec", "map", *columns), lines, numbers=("map", *columns))
    else:
        console.print_text(title)


def _columns(summary: "Summary", settings: "Sequence[Setting]") -> dict[str, str]:
    """The columns of a table, by heading; no optional one that is empty."""
    from shadowbench.reports.texts import COST_HEADINGS
    from shadowbench.results.summary import known
    from shadowbench.scores.metrics import plugged_in

    added = {one.name: one.label or one.name for one in plugged_in() if one.suits(summary.soft)}
    headings = {"error": "RMSE" if summary.soft else "1 − IoU", "cost": COST_HEADINGS[summary.cost]}
    headings |= _HEADINGS | added
    lacking = {key for key in _OPTIONAL if not any(known(getattr(one, key)) for one in settings)}
    lacking |= set() if summary.cost == "frame_ms" else {"ratio"}  # of measured times
    return {
        headings.get(key, key.replace("_", " ")): key
        for key in (*(_OF_SOFT if summary.soft else _OF_HARD), *added)
        if key not in lacking
    }


def _cell(summary: "Summary", one: "Setting", key: str) -> str:
    """The error with its interval, else the median; 1 − IoU for `iou`."""
    from shadowbench.reports.texts import error_text, value_text

    if key == "error":
        return error_text(summary, one, number)
    value = getattr(one, key)
    if key in ("iou", "gpu_bytes") and value == value:  # not NaN
        return number(1 - value) if key == "iou" else f"{value / 2**20:.1f}"
    return "–" if value != value else value_text(one, summary.cost if key == "cost" else key, number)
