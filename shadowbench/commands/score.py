"""`score`: score a mask or screenshots of another renderer."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from shadowbench.commands import console, options
from shadowbench.errors import InputError, number
from shadowbench.options import ViewOptions, option

if TYPE_CHECKING:
    from shadowbench.masks.accuracy import Accuracy


@dataclass(frozen=True)
class ScoreOptions:
    """Screenshots in place of a mask, and where the score goes."""

    lit: Path | None = option("Instead of a mask: a screenshot without shadows, sRGB.", "LIT.png")
    shadowed: Path | None = option("The same screenshot with shadows.", "SHADOWED.png")
    ambient: Path | None = option("The same screenshot without the light  [black].", "AMBIENT.png")
    linear: bool = options.flag("The screenshots hold linear values instead of sRGB.")
    output: Path | None = options.output("Run folder to add the score to; requires --name.")
    name: str | None = option("Name of your engine in that run folder; requires -o.", "NAME")
    diff: Path | None = option("File for a difference picture: false shadow orange, false light blue.", "FILE.png")


@options.command(
    "\b\nFor example\n"
    "  shadowbench score stairs mask.png --diff wrong.png\n"
    "  shadowbench score stairs --lit lit.png --shadowed shadowed.png -o results/engines --name my-engine"
)
def score(
    scene: options.Scene,
    mask: Annotated[
        Path | None,
        options.argument("MASK.png", "Shadow mask: linear grey, 8 or 16 bit, white is lit; its size is the view size."),
    ] = None,
    *,
    scoring: ScoreOptions,
    view: ViewOptions,
    printed: options.Printed,
) -> None:
    """Score another renderer's mask or screenshots.

    Compares them with the ray-traced shadows of the scene; needs no OpenGL. `shadowbench export` writes the scene to
    draw; pictures of a sequence, 000.png, 001.png …, are in folders below that of `export`, which are given in place of
    files. A mask that is flipped, turned or inverted is refused; one that seems shifted, sRGB-encoded or lit by
    ambient light is scored unchanged, with a warning. Below the metrics the errors are said in words, the leading one
    first. The column `shadows` says whether a metric is for hard shadows, soft ones (of a light with a size) or both.
    """
    from shadowbench.masks.accuracy import accuracy_of, accuracy_of_clip, append_row
    from shadowbench.masks.inputs import external_mask
    from shadowbench.scores.difference import difference_picture, write_difference

    _check_outputs(scoring, mask)
    pictures = mask, scoring.lit, scoring.shadowed, scoring.ambient
    folder = next((one for one in pictures if one and one.is_dir()), None)
    with console.Reporter(printed.quiet) as reporter:
        if folder:
            from shadowbench.masks.export import clip_of, exported_sequence  # imports trimesh, 0.8 s

            name, count, size = exported_sequence(folder)
            clip = clip_of(reporter.view(scene, size, view), name, count)
            reporter.stage("frames", count)
            accuracy = accuracy_of_clip(clip, pictures, scoring.linear, reporter.step)
        else:
            picture = external_mask(*pictures, scoring.linear)
            accuracy = accuracy_of(picture, reporter.view(scene, picture.size, view))
    notes = []
    if scoring.diff is not None:
        write_difference(scoring.diff, difference_picture(accuracy.comparison))
        notes.append(f"{scoring.diff}: false shadow orange, false light blue")
    if scoring.output is not None and scoring.name is not None:
        added = append_row(accuracy, scoring.name, scoring.output)
        row = f"score, mask and difference of {scoring.name} added"
        notes.append(f"{scoring.output}: {row if added else f'already holds this score of {scoring.name}'}")
    if printed.json:
        console.print_json(accuracy.values())
        return
    _print(accuracy)
    if not printed.quiet:
        for warning in accuracy.warnings:
            console.print_error(f"warning: {warning}")
        for line in notes:
            console.print_line(line)


def _check_outputs(scoring: ScoreOptions, mask: Path | None) -> None:
    """Raises InputError if an output cannot be written."""
    from shadowbench.files import check_folder, check_outputs
    from shadowbench.masks.accuracy import check_name

    if (scoring.output is None) != (scoring.name is None):
        raise InputError("-o DIR and --name NAME: found one of them; allowed: both, for a row in a run folder, or none")
    check_outputs(".png", scoring.diff)
    if scoring.diff is not None and scoring.diff.exists():
        for picture in (mask, scoring.lit, scoring.shadowed, scoring.ambient):
            if picture is not None and picture.exists() and scoring.diff.samefile(picture):
                raise InputError(f"--diff {scoring.diff}: is one of the pictures to score; name another file")
    if scoring.output is not None and scoring.name is not None:
        check_name(scoring.name)
        check_folder(scoring.output)


def _print(accuracy: "Accuracy") -> None:
    from shadowbench.scores.metrics import METRICS, is_soft
    from shadowbench.scores.motion import MOTION

    view, record = accuracy.view, accuracy.record
    title = f"{accuracy.external.name} on {view.scene.name}, {view.camera.name}, {view.light.name}, {view.size}"
    if name := record.get("sequence"):
        title += f", {record['frames']} frames of {name}"
    soft = is_soft(accuracy.metrics)
    first = ("rmse", "rmse_pen") if soft else ()
    rows = []
    metrics = [metric for metric in (*METRICS.values(), *MOTION.values()) if metric.name in accuracy.metrics]
    for metric in sorted(metrics, key=lambda metric: metric.name not in first):
        value = accuracy.metrics[metric.name]
        if metric.suits(soft) and (value is not None or metric.kind != "soft"):
            # The first sentence of a metric of soft shadows is not enough.
            about = metric.help if metric.kind == "soft" else metric.help.split(". ")[0]
            shown = metric.text(value, number, record)
            rows.append((metric.name, shown, metric.better, metric.kind, about))
    columns = ("metric", "", "better", "shadows", "what it is")
    console.print_table(title, columns, rows, numbers=("",), whole=("metric", "better", "shadows"))
    for line in accuracy.summary():
        console.print_line(f"  {line}")
