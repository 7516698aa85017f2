"""Commands for other renderers: export, score."""

from pathlib import Path
from typing import Annotated

import typer

from shadowbench.cli.options import Assets, Json, LightName, Quiet, SceneArgument, Up, ViewName, ViewSize

app = typer.Typer()


@app.command(epilog="For example  shadowbench export stairs for-my-engine/ --view-size 1024")
def export(
    scene: SceneArgument,
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="Where the files go; made if need be.")],
    view_size: ViewSize = None,
    view: ViewName = None,
    light: LightName = None,
    assets: Assets = None,
    up: Up = None,
    quiet: Quiet = False,
) -> None:
    """Write a view for your engine: scene.glb, view.json, truth.png.

    scene.glb: meshes with colours, the camera, the light (KHR_lights_punctual). view.json: matrices, near and far,
    size, where pixels are sampled. truth.png: the ray-traced shadows, as an example of a mask for `shadowbench score`.
    """
    from shadowbench.commands.export import export_command

    export_command(scene, folder, view_size or 512, view, light, assets, up, quiet)


@app.command(
    epilog="\b\nFor example\n"
    "  shadowbench score stairs mask.png --diff wrong.png\n"
    "  shadowbench score stairs --lit lit.png --shadowed shadowed.png -o results/engines --name my-engine"
)
def score(
    scene: SceneArgument,
    mask: Annotated[
        Path | None,
        typer.Argument(
            metavar="MASK.png", help="Linear grey, 8 or 16 bit, square, full is lit; its size is the view's."
        ),
    ] = None,
    lit: Annotated[
        Path | None, typer.Option(metavar="LIT.png", help="Instead of a mask: a screenshot without shadows, sRGB.")
    ] = None,
    shadowed: Annotated[Path | None, typer.Option(metavar="SHADOWED.png", help="The same with shadows.")] = None,
    ambient: Annotated[
        Path | None, typer.Option(metavar="AMBIENT.png", help="The same without the light  [black].")
    ] = None,
    view: ViewName = None,
    light: LightName = None,
    output: Annotated[
        Path | None, typer.Option("-o", "--output", metavar="DIR", help="A run folder that gets a row; with --name.")
    ] = None,
    name: Annotated[str | None, typer.Option(metavar="NAME", help="What your engine is called in that row.")] = None,
    diff: Annotated[
        Path | None, typer.Option(metavar="FILE.png", help="The difference: false shadow orange, false light blue.")
    ] = None,
    assets: Assets = None,
    up: Up = None,
    json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Score a mask of another renderer, or three of its screenshots, against ray tracing. Needs no OpenGL.

    `shadowbench export` says what to draw. What is flipped, inverted or not square is refused; what seems shifted or
    gamma-encoded is scored as it is, with a warning.
    """
    from shadowbench.commands.score import ScoreOptions, score_command

    options = ScoreOptions(scene, mask, lit, shadowed, ambient, view, light, assets, up, output, name, diff)
    score_command(options, as_json=json, quiet=quiet)
