"""`tune`: a technique's parameters searched on some scenes, compared with its default and presets on others."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from shadowbench.commands import console
from shadowbench.commands.options import SCENE, SPEC, Assets, Json, Plugins, Quiet, Up, ViewSize, listed, map_sizes

if TYPE_CHECKING:
    from shadowbench.advice.tune_comparison import Entry, TuningComparison

app = typer.Typer()


@app.command(
    epilog="\b\nFor example\n"
    "  shadowbench tune -t shadow-map --scenes stairs,statue,street,my.glb --held-out statue,my\n"
    "  shadowbench tune -t cube-map --params bias --trials 50"
)
def tune(
    technique: Annotated[
        str,
        typer.Option("-t", "--technique", metavar="SPEC", help=f"What is tuned: {SPEC}; the rest of it stays."),
    ],
    scenes: Annotated[
        str | None,
        typer.Option(metavar="SCENE,SCENE,...", help=f"Each {SCENE}  [all built-in ones that it answers]."),
    ] = None,
    held_out: Annotated[
        str | None,
        typer.Option(
            metavar="NAME,NAME,...", help="Scenes, by name, to compare on and not to tune on  [every third, by hash]."
        ),
    ] = None,
    params: Annotated[
        str | None,
        typer.Option(metavar="NAME,NAME,...", help="Parameters that are searched  [bias,filter,fit, those it has]."),
    ] = None,
    trials: Annotated[int, typer.Option(metavar="N", min=1, max=100_000, help="Settings that a search tries.")] = 100,
    against: Annotated[
        list[str] | None,
        typer.Option(metavar="SPEC", help="What else to compare with, beside default and presets; repeatable."),
    ] = None,
    map_size: Annotated[str, typer.Option(metavar="N,N,...", help="Sizes of the map; several are averaged.")] = "2048",
    view_size: ViewSize = None,
    phases: Annotated[
        int, typer.Option(metavar="N", min=1, max=10_000, help="Positions of the map's texels; they are averaged.")
    ] = 2,
    plugin: Plugins = None,
    assets: Assets = None,
    up: Up = None,
    output: Annotated[Path, typer.Option("-o", "--output", metavar="DIR", help="Folder of rows and table.")] = Path(
        "results/tune"
    ),
    json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Search the parameters at which a technique is most accurate at each cost, on several scenes.

    Error is that of IoU and SSIM together, cost the work counted. What is best on the scenes tuned on is set beside
    the default and the presets on scenes held out: every camera and light of a scene takes part. Stopped at any point,
    the same command goes on where it was.
    """
    from shadowbench.advice.tune import tune_parameters, values
    from shadowbench.measure.plugin_output import techniques_with
    from shadowbench.measure.worker import Worker
    from shadowbench.reports.words import counted
    from shadowbench.techniques.spec import parse_spec

    known = techniques_with(plugin or ())
    with console.Reporter(quiet) as reporter, Worker(plugin or ()) as worker:
        found = tune_parameters(
            parse_spec(technique, known),
            output,
            worker,
            reporter,
            scenes=listed(scenes),
            held_out=listed(held_out),
            params=params,
            against={text: parse_spec(text, known) for text in against or ()},
            trials=trials,
            map_size=map_sizes(map_size) or (),
            view_size=view_size or 512,
            phases=phases,
            assets=assets,
            up=up,
        )
    if json:
        console.print_json(values(found.tuning))
    else:
        _print(found.tuning)
        if not quiet:
            console.say(f"{output / 'table.csv'}: {counted(len(found.results), 'cell')}")
    failed = [one.status for one in found.results if one.status.startswith("failed")]
    if failed:
        console.complain(f"shadowbench: {len(failed)} of {len(found.results)} cells failed; the first: {failed[0]}")
    raise typer.Exit(3 if failed else 0)


def _print(found: "TuningComparison") -> None:
    from shadowbench.advice.tune import verdict
    from shadowbench.reports.words import counted

    held_out = found.split.held_out
    _print_entries(f"best at each cost, from the cheapest; held out: {', '.join(held_out)}", found.front)
    console.out().print()
    intervals = ", with 95% intervals over them" if len(held_out) > 1 else ""
    title = f"beside the default and others on {counted(len(held_out), 'scene')} held out{intervals}"
    _print_entries(title, (found.tuned, *found.others))
    console.out().print("error: √((1 − IoU) · (1 − SSIM)), geometric mean over scenes; × tuned: median over scenes")
    console.say(verdict(found))


def _print_entries(title: str, entries: "Sequence[Entry]") -> None:
    numbers = ("cost", "tuning", "held out", "1 − IoU × tuned", "1 − SSIM × tuned", "acne", "leak", "contact")
    console.print_table(title, ("", "spec", *numbers), [_line(entry) for entry in entries], numbers=numbers)


def _line(entry: "Entry") -> list[str]:
    return [
        entry.name,
        entry.spec.sizeless_text,
        f"{entry.cost:.2f}",
        console.number(entry.tuning),
        entry.held_out.text(console.number),
        *("–" if one is None else one.text("{:.3g}".format) for one in (entry.iou_ratio, entry.ssim_ratio)),
        *(console.number(value) for value in (entry.acne, entry.leak, entry.contact)),
    ]
