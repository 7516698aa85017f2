"""`tune`: search a technique's parameters on some scenes, and score what was found and its default on others."""

from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from shadowbench.commands import completion, console
from shadowbench.commands.executors import campaigns
from shadowbench.commands.options import (
    SCENE,
    SPEC,
    KeepGoing,
    Machines,
    Plugins,
    Printed,
    ViewSize,
    grouped,
    listed,
    map_sizes,
)
from shadowbench.options import PHASES, SceneOptions

if TYPE_CHECKING:
    from shadowbench.advice.tune_search import Setting, Tuning

app = typer.Typer()


@app.command(
    epilog="\b\nFor example\n"
    "  shadowbench tune -t shadow-map --scenes stairs,statue,street,my.glb --held-out statue,my\n"
    "  shadowbench tune -t cube-map --params bias --trials 50"
)
@grouped
def tune(
    technique: Annotated[
        str,
        typer.Option(
            "-t",
            "--technique",
            metavar="SPEC",
            autocompletion=completion.spec,
            help=f"Technique to tune: {SPEC}; parameters outside the search keep their values.",
        ),
    ],
    scenes: Annotated[
        str | None,
        typer.Option(
            metavar="SCENE,SCENE,...",
            autocompletion=completion.scenes,
            help=f"Each is {SCENE}  [all built-in scenes that the technique supports and whose lights have no size].",
        ),
    ] = None,
    held_out: Annotated[
        str | None,
        typer.Option(
            metavar="NAME,NAME,...",
            autocompletion=completion.scenes,
            help="Scenes held out of the search, on which its result is judged  [a third, chosen by a hash of the "
            "names].",
        ),
    ] = None,
    params: Annotated[
        str | None,
        typer.Option(
            metavar="NAME,NAME,...",
            autocompletion=completion.parameters,
            help="Parameters to search  [those of bias, filter, fit that the technique has].",
        ),
    ] = None,
    trials: Annotated[
        int, typer.Option(metavar="N", min=1, max=100_000, help="Number of settings that the search tries.")
    ] = 100,
    map_size: Annotated[str, typer.Option(metavar="N,N,...", help="Map sizes to average over.")] = "2048",
    view_size: ViewSize = None,
    phases: Annotated[
        int,
        typer.Option(
            metavar="N", min=PHASES.least, max=PHASES.most, help="Sub-texel offsets of the map to average over."
        ),
    ] = 2,
    plugin: Plugins = None,
    keep_going: KeepGoing = False,
    output: Annotated[
        Path, typer.Option("-o", "--output", metavar="DIR", help="Folder for the measured cells.")
    ] = Path("results/tune"),
    *,
    options: SceneOptions,
    machines: Machines,
    printed: Printed,
) -> None:
    """Search a technique's parameters for the best accuracy.

    Finds the most accurate setting at each cost on some scenes, and scores it beside the default on others, held out
    of the search. The error combines IoU, or RMSE of soft shadows, and SSIM; the cost is counted work
    (shader invocations, texture reads). Every camera and light of a scene is used. An interrupted search resumes when
    the command is repeated.

    \b
    Columns
      cost                work relative to the default's
      tuning, held out    error √((1 − IoU) · (1 − SSIM)), of soft shadows
                          √(RMSE · (1 − SSIM)), on the scenes of the search, and
                          on those held out; geometric means
      acne, leak, contact means over the held-out scenes (shadowbench list metrics)
    """
    from shadowbench.advice.tune import no_image, tune_parameters, values
    from shadowbench.errors import counted
    from shadowbench.measure.plugin_output import techniques_with
    from shadowbench.plugin.spec import parse_spec

    known = techniques_with(plugin or ())
    with (
        console.Reporter(printed.quiet) as reporter,
        campaigns(output, machines, plugin or (), None, reporter, keep_going=keep_going, keeps_images=no_image) as (
            campaign,
        ),
    ):
        found = tune_parameters(
            parse_spec(technique, known),
            campaign,
            scenes=listed(scenes),
            held_out=listed(held_out),
            params=params,
            trials=trials,
            map_size=map_sizes(map_size) or (),
            view_size=view_size or 512,
            phases=phases,
            **asdict(options),
        )
    if printed.json:
        console.print_json(values(found.tuning))
    else:
        _print(found.tuning)
        if not printed.quiet:
            console.print_line(f"{output / 'table.csv'}: {counted(len(found.results), 'cell')}")
    console.print_failures((one.what, one.where, one.reason) for one in found.failures)
    failed = [one.status for one in found.results if one.status.startswith("failed")]
    if failed:
        console.print_error(f"shadowbench: {len(failed)} of {len(found.results)} cells failed; the first: {failed[0]}")
    raise typer.Exit(3 if failed or found.failures else 0)


def _print(found: "Tuning") -> None:
    numbers = ("cost", "tuning", "held out", "acne", "leak", "contact")
    lines = [_line("", one) for one in found.front] + [_line("default", found.default)]
    title = f"best at each cost, cheapest first; held out: {', '.join(found.split.held_out)}"
    console.print_table(title, ("", "spec", *numbers), lines, numbers=numbers)


def _line(name: str, one: "Setting") -> list[str]:
    values = (one.tuning, one.held_out, one.acne, one.leak, one.contact)
    return [name, one.spec.sizeless_text, f"{one.cost:.2f}", *map(console.number, values)]
