"""`score`: score a mask or screenshots of another renderer."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from shadowbench.commands import completion, console
from shadowbench.commands.options import SCENE, Printed, grouped
from shadowbench.errors import InputError
from shadowbench.options import ViewOptions

if TYPE_CHECKING:
    from shadowbench.engines.accuracy import Accuracy
    from shadowbench.scores.metric import Metric

app = typer.Typer()


@app.command(
    epilog="\b\nFor example\n"
    "  shadowbench score stairs mask.png --diff wrong.png\n"
    "  shadowbench score stairs --lit lit.png --shadowed shadowed.png -o results/engines --name my-engine"
)
@grouped
def score(
    scene: Annotated[
        str,
        typer.Argument(
            metavar="SCENE",
            autocompletion=completion.scene,
            help=f"The scene: {SCENE}; or its truth, a file of `shadowbench truth`.",
        ),
    ],
    mask: Annotated[
        Path | None,
        typer.Argument(
            metavar="MASK.png",
            help="Shadow mask: linear grey, 8 or 16 bit, square, white is lit; its size is the view size.",
        ),
    ] = None,
    lit: Annotated[
        Path | None, typer.Option(metavar="LIT.png", help="Instead of a mask: a screenshot without shadows, sRGB.")
    ] = None,
    shadowed: Annotated[
        Path | None, typer.Option(metavar="SHADOWED.png", help="The same screenshot with shadows.")
    ] = None,
    ambient: Annotated[
        Path | None, typer.Option(metavar="AMBIENT.png", help="The same screenshot without the light  [black].")
    ] = None,
    output: Annotated[
        Path | None,
        typer.Option("-o", "--output", metavar="DIR", help="Run folder to add the score to; requires --name."),
    ] = None,
    name: Annotated[
        str | None, typer.Option(metavar="NAME", help="Name of your engine in that run folder; requires -o.")
    ] = None,
    diff: Annotated[
        Path | None,
        typer.Option(metavar="FILE.png", help="File for a difference picture: false shadow orange, false light blue."),
    ] = None,
    *,
    options: ViewOptions,
    printed: Printed,
) -> None:
    """Score another renderer's mask or screenshots.

    Compares them with the ray-traced shadows of the scene; needs no OpenGL, and with a file of `shadowbench truth` in
    place of the scene no Embree either. `shadowbench export` writes the scene to draw. A mask that is flipped, inverted
    or not square is refused; one that seems shifted or sRGB-encoded is scored unchanged, with a warning. Below the
    metrics, faults of the whole mask are named, and the wrong pixels that are left once these are undone are listed by
    kind of error, most pixels first; the line `displaced edge` covers those pixels only, whereas edge_px and edge_p95
    cover all edges, also of leaks. Under a light with a size, the errors that stand out are listed instead: causes (a
    shift, an sRGB encoding, a blur, a wrong width of penumbrae) before errors of penumbra, umbra and full light, the
    larger first. The column `shadows` says whether a metric is for hard shadows, soft ones (of a light with a size) or
    both.
    """
    from shadowbench.engines.accuracy import accuracy_of
    from shadowbench.engines.export import size_mismatch
    from shadowbench.engines.external_mask import external_mask
    from shadowbench.engines.store import append_row
    from shadowbench.engines.stored_truth import stored_truth_of
    from shadowbench.scores.difference import write_difference

    _check_outputs(output, name, diff, [mask, lit, shadowed, ambient])
    handed = external_mask(scene, mask, lit, shadowed, ambient)
    with console.Reporter(printed.quiet) as reporter:
        against = stored_truth_of(scene, options) or reporter.view(scene, handed.size, options)
        accuracy = accuracy_of(handed, against)
    drawn = mask or shadowed
    sized = size_mismatch(drawn, accuracy.view) if drawn is not None else None
    warnings = [*accuracy.warnings, *([sized] if sized else [])]
    if diff is not None:
        write_difference(diff, accuracy.difference())
    new = append_row(accuracy, name, output) if output is not None and name is not None else False
    if printed.json:
        console.print_json(accuracy.values() | {"warnings": warnings})
        return
    _print(accuracy)
    if printed.quiet:
        return
    for warning in warnings:
        console.print_error(f"warning: {warning}")
    if diff is not None:
        console.print_line(f"{diff}: false shadow orange, false light blue")
    if output is not None:
        row = f"score, mask and difference of {name} added" if new else f"already holds this score of {name}"
        console.print_line(f"{output}: {row}")


def _check_outputs(folder: Path | None, name: str | None, diff: Path | None, pictures: Sequence[Path | None]) -> None:
    """Raises InputError if what is asked for cannot be written."""
    from shadowbench.engines.store import check_name
    from shadowbench.files import check_folder, check_outputs

    if (folder is None) != (name is None):
        raise InputError("-o DIR and --name NAME: found one of them; allowed: both, for a row in a run folder, or none")
    check_outputs(".png", diff)
    if diff is not None and diff.exists():
        for picture in filter(None, pictures):
            if picture.exists() and diff.samefile(picture):
                raise InputError(f"--diff {diff}: is one of the pictures to score; name another file")
    if folder is not None and name is not None:
        check_name(name)
        check_folder(folder)


def _print(accuracy: "Accuracy") -> None:
    from shadowbench.scores.metrics import METRICS, is_soft

    view = accuracy.view
    title = f"{accuracy.external.name} on {view.scene.name}, {view.camera.name}, {view.light.name}, {view.size}²"
    soft = is_soft(accuracy.metrics)
    first = ("rmse", "rmse_pen") if soft else ()
    rows = [
        (metric.name, metric.text(value, console.number, accuracy.record), metric.better, metric.kind, about)
        for metric in sorted(METRICS.values(), key=lambda metric: metric.name not in first)
        for value, about in [(accuracy.metrics[metric.name], _about(metric))]
        if metric.suits(soft) and (value is not None or metric.kind != "soft")
    ]
    columns = ("metric", "", "better", "shadows", "what it is")
    console.print_table(title, columns, rows, numbers=("",), whole=("metric", "better", "shadows"))
    for line in accuracy.summary():
        console.print_line(f"  {line}")


def _about(metric: "Metric") -> str:
    """What a metric is: its first sentence; all of them for one of soft shadows, where the first is not enough."""
    return metric.help if metric.kind == "soft" else metric.help.split(". ")[0]
