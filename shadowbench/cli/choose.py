"""Commands that help to choose: needs, tune, recommend."""

from pathlib import Path
from typing import Annotated

import typer

from shadowbench.cli.options import (
    SCENE,
    SPEC,
    Assets,
    Json,
    LightName,
    Plugins,
    Quiet,
    SceneArgument,
    Up,
    ViewName,
    ViewSize,
)

app = typer.Typer()


@app.command(epilog="For example  shadowbench needs street --view-size 1024")
def needs(
    scene: SceneArgument,
    view_size: ViewSize = None,
    view: ViewName = None,
    light: LightName = None,
    assets: Assets = None,
    up: Up = None,
    json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Say what a scene asks of shadows, without drawing any: map size, cascades, depth bits, bias, penumbra.

    Each need with its number, its standard error where pixels were sampled, and the reason. Needs no OpenGL.
    """
    from shadowbench.commands.needs import needs_command

    needs_command(scene, view_size or 512, view, light, assets, up, json, quiet)


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
    from shadowbench.commands.tune import TuneOptions, tune_command

    options = TuneOptions(
        technique, scenes, held_out, params, tuple(against or ()), trials,
        map_size, view_size or 512, phases, tuple(plugin or ()), assets, up,
    )  # fmt: skip
    raise typer.Exit(tune_command(options, output, as_json=json, quiet=quiet))


@app.command(
    epilog="\b\nFor example\n"
    "  shadowbench recommend street\n"
    "  shadowbench recommend my.glb --max-edge-px 0.5 --export for-my-engine\n"
    "  shadowbench recommend my.glb --min-iou 0.98 --budget-ms 2"
)
def recommend(
    scene: SceneArgument,
    min_iou: Annotated[
        float | None, typer.Option(metavar="X", help="Least IoU of the shadow, up to 1  [0.99].")
    ] = None,
    max_edge_px: Annotated[
        float | None,
        typer.Option(metavar="X", help="Most that the shadow's edges are off, the mean in pixels; instead of an IoU."),
    ] = None,
    budget_ms: Annotated[
        float | None, typer.Option(metavar="X", help="Most milliseconds of a frame's shadows, on a GPU.")
    ] = None,
    on_this_machine: Annotated[
        bool, typer.Option("--on-this-machine", help="Rank by times of a software renderer, which are not a GPU's.")
    ] = False,
    export: Annotated[
        Path | None, typer.Option(metavar="DIR", help="Folder for parameters and GLSL of the choice, ready to paste.")
    ] = None,
    view_size: ViewSize = None,
    view: ViewName = None,
    light: LightName = None,
    plugin: Plugins = None,
    assets: Assets = None,
    up: Up = None,
    output: Annotated[
        Path, typer.Option("-o", "--output", metavar="DIR", help="Folder of the rows, which are measured once.")
    ] = Path("results/recommend"),
    json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Find the cheapest technique, parameters and map size that meet a target in a scene.

    Measures few of them: needs leave out what cannot pay or suffice, what was measured tells what else may. Ranks by a
    frame's milliseconds; on a software renderer by work (shader invocations, texture reads), then bytes. Exit code 1
    when nothing meets the target: then the closest is shown, and what stands in the way.
    """
    from shadowbench.commands.recommend import RecommendOptions, recommend_command

    options = RecommendOptions(
        scene, min_iou, max_edge_px, budget_ms, on_this_machine, export, view_size or 512, view, light,
        tuple(plugin or ()), assets, up,
    )  # fmt: skip
    raise typer.Exit(recommend_command(options, output, as_json=json, quiet=quiet))
