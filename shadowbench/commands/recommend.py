"""`recommend`: the cheapest technique, parameters and map size that meet a target in a view."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from shadowbench.commands import completion, console
from shadowbench.commands.executors import campaigns
from shadowbench.commands.options import Plugins, Printed, SceneArgument, TimingMachines, ViewSize, grouped
from shadowbench.errors import InputError
from shadowbench.options import ViewOptions

if TYPE_CHECKING:
    from shadowbench.advice.recommend import Recommendation
    from shadowbench.advice.search import Trial
    from shadowbench.measure.drawer import DeviceInfo

app = typer.Typer()

WORK = (
    "ranked by work, not by time; where a GPU's clock disagrees, as on shadow volumes: "
    "docs/explanation/choosing.md#work-and-time"
)


@app.command(
    epilog="\b\nFor example\n"
    "  shadowbench recommend street\n"
    "  shadowbench recommend my.glb --max-edge-px 0.5 --export for-my-engine\n"
    "  shadowbench recommend my.glb --min-iou 0.98 --budget-ms 2\n"
    "  shadowbench recommend my.glb -t shadow-map -t cascades"
)
@grouped
def recommend(
    scene: SceneArgument,
    min_iou: Annotated[
        float | None, typer.Option(metavar="X", help="Target: minimum IoU  [0.99, if nothing is in penumbra].")
    ] = None,
    max_edge_px: Annotated[
        float | None,
        typer.Option(
            metavar="X",
            help="Target, instead of --min-iou: maximum mean distance between drawn and true shadow edges, in pixels.",
        ),
    ] = None,
    max_rmse: Annotated[
        float | None,
        typer.Option(
            metavar="X",
            help="Target, instead of --min-iou: maximum root mean square error of visibility  [0.02, if any "
            "pixel is in penumbra].",
        ),
    ] = None,
    budget_ms: Annotated[
        float | None, typer.Option(metavar="X", help="Maximum time per frame, in ms; needs a GPU.")
    ] = None,
    on_this_machine: Annotated[
        bool, typer.Option("--on-this-machine", help="Rank by time even on a software renderer.")
    ] = False,
    export: Annotated[
        Path | None, typer.Option(metavar="DIR", help="Folder for the parameters and shaders (GLSL) of the choice.")
    ] = None,
    techniques: Annotated[
        list[str] | None,
        typer.Option(
            "-t",
            "--technique",
            metavar="TECHNIQUE",
            autocompletion=completion.spec,
            help="Name of a technique to search (shadowbench list techniques), such as one that your engine has; "
            "repeatable  [all].",
        ),
    ] = None,
    view_size: ViewSize = None,
    plugin: Plugins = None,
    output: Annotated[
        Path,
        typer.Option("-o", "--output", metavar="DIR", help="Folder for the measured cells, which later calls reuse."),
    ] = Path("results/recommend"),
    *,
    options: ViewOptions,
    machines: TimingMachines,
    printed: Printed,
) -> None:
    """Search for the cheapest technique that meets a target.

    Searches techniques, parameters and map sizes. Few specs are measured: the scene's geometry rules some out (see
    `shadowbench needs`), and cost and error of the others are predicted from the measurements, so that a cheaper one
    may exist. Cost is the time of a frame; on a software renderer it is work (shader invocations, texture reads), since
    its times are not those of a GPU. Exit code 1 if nothing measured meets the target; the closest is then shown with
    the reason.

    \b
    Lines of the table, all of specs that were measured
      choice    the cheapest that meets the target
      next      of each other technique, the cheapest that meets the target
      too slow  the same, but over --budget-ms
      so far    of a technique of which none measured meets the target, the most
                accurate; others were not tried, by predictions below the table
      misses    the same, where all were tried but those ruled out below the table
      closest   the most accurate of all, if none meets the target
    Columns
      map         texels along a side of the shadow map
      iou         or edge_px, rmse: the target's metric
      work or ms  cost of a frame; ~ marks a time that varied widely
      × choice    cost relative to the choice's
      MiB         memory of textures and buffers
      key         name of the cell's mask and picture in the output folder
    """
    from shadowbench.advice.recommend import has_penumbra
    from shadowbench.advice.recommend import recommend as measure_recommendation
    from shadowbench.advice.space import technique_names
    from shadowbench.advice.target import target_of
    from shadowbench.advice.words import export_choice, values
    from shadowbench.measure.plugin_output import techniques_with

    target_of(min_iou, max_edge_px, budget_ms, max_rmse)  # invalid options, before the scene is read
    plugins = tuple(plugin or ())
    known = techniques_with(plugins)
    among = technique_names(techniques or (), known)
    if export is not None:
        _make_folder(export)
    with (
        console.Reporter(printed.quiet) as reporter,
        campaigns(output, machines, plugins, None, reporter) as (*_, campaign),
    ):
        chosen = reporter.view(scene, view_size, options)
        target = target_of(min_iou, max_edge_px, budget_ms, max_rmse, soft=has_penumbra(chosen))
        found, info = measure_recommendation(
            chosen,
            target,
            known,
            campaign,
            on_this_machine=on_this_machine,
            timed=machines.dask is None or machines.time_on is not None,
            among=among,
        )
        if export is not None:
            export_choice(found, export, campaign.drawer)
    if printed.json:
        console.print_json(values(found, info))
    else:
        _print(found, info, output)
        if export is not None and found.choice is not None and not printed.quiet:
            console.print_line(f"{export}: parameters.json and the GLSL of the choice")
    raise typer.Exit(0 if found.choice is not None else 1)


def _make_folder(folder: Path) -> None:
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"--export {folder}: cannot be created ({error.strerror or error})") from None


def _print(found: "Recommendation", info: "DeviceInfo", folder: Path) -> None:
    from shadowbench.advice.words import excluded_lines, obstacles, phase_notes, step_lines, target_notes
    from shadowbench.results.times import time_notes

    by = "work" if found.unit == "work" else "this machine's times" if info.software else "this GPU's times"
    caveat = "; times of a software renderer are not those of a GPU" if info.software else ""
    cost = "work" if found.unit == "work" else "ms"
    numbers = ("map", found.target.metric, cost, "× choice", "MiB")
    columns = ("", "spec", *numbers, "key")
    shown = list(dict.fromkeys(one for one in (found.choice, found.closest, *found.runners_up) if one is not None))
    among = f", of {', '.join(found.among)}" if found.among else ""
    title = f"{found.view.scene.name}, {found.target}{among}, by {by}{caveat}"
    rows = [(found.standing(one), *_cells(found, one)) for one in shown]
    console.print_table(title, columns, rows, numbers=numbers, whole=columns)
    lines = step_lines(found) if found.choice else obstacles(found)
    rough = [_is_rough(found, one) for one in shown]
    notes = [*target_notes(found), *phase_notes(found), *time_notes(found.reference, rough)]
    for line in [*lines, *notes, *excluded_lines(found)]:
        console.print_line(line)
    if found.unit == "work":
        console.print_line(WORK)
    console.print_line(
        f"{len(found.trials)} of {found.space_size} specs measured; masks and pictures, by key, in {folder}"
    )


def _is_rough(found: "Recommendation", one: "Trial") -> bool:
    """Whether the rounds of a time varied much."""
    from shadowbench.results.times import ROUGH

    time = one.result.time
    return found.unit == "ms" and time is not None and time["ratio_iqr"] > ROUGH * time["ratio"]


def _cells(found: "Recommendation", one: "Trial") -> list[str]:
    from shadowbench.scores.metrics import METRICS

    row = one.result.score
    value = row["metrics"][found.target.metric]
    return [
        one.spec.sizeless_text,
        str(one.spec.map_size or ""),
        "" if value is None else METRICS[found.target.metric].text(value, found.target.digits, row),
        f"{one.cost:,.0f}" if found.unit == "work" else "~" * _is_rough(found, one) + console.number(one.cost),
        f"{one.cost / found.choice.cost:.3g}" if found.choice else "",
        f"{one.bytes / 2**20:.3g}",
        str(row["key"]),
    ]
