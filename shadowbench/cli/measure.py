"""Commands that draw or trace: run, truth, render, stress."""

from pathlib import Path
from typing import Annotated

import typer

from shadowbench.cli.options import (
    SCENE,
    SPEC,
    Assets,
    Json,
    LightName,
    OneSpec,
    Plugins,
    Quiet,
    SceneArgument,
    Up,
    ViewName,
    ViewSize,
)

app = typer.Typer()


@app.command(
    epilog="\b\nFor example\n"
    "  shadowbench run cube-on-plane -t shadow-map --map-size 512,1024\n"
    "  shadowbench run my.glb -t unshadowed -t 'shadow-map:bias=slope,filter=pcf(taps=5)'\n"
    "  shadowbench run -s presets -o results/presets"
)
def run(
    scenes: Annotated[list[str] | None, typer.Argument(metavar="SCENE", help=f"Each {SCENE}  [the study's].")] = None,
    study: Annotated[
        str | None,
        typer.Option(
            "-s",
            "--study",
            metavar="STUDY",
            help="A study file (.toml) with scenes and techniques, or one of ours by name (shadowbench list studies).",
        ),
    ] = None,
    techniques: Annotated[
        list[str] | None,
        typer.Option("-t", "--technique", metavar="SPEC", help=f"What to measure: {SPEC}; repeatable  [the study's]."),
    ] = None,
    map_size: Annotated[
        str | None,
        typer.Option(
            metavar="N,N,...",
            help="Sizes of the shadow map, for each spec that names none  [the study's; with -t and no study, "
            "the technique's own].",
        ),
    ] = None,
    view_size: ViewSize = None,
    rounds: Annotated[
        int | None,
        typer.Option(metavar="N", min=0, max=10000, help="How often each cell is timed; 0: not at all  [9]."),
    ] = None,
    phases: Annotated[
        int | None,
        typer.Option(
            metavar="N",
            min=1,
            max=10000,
            help="Positions of the map's texels to score; more than one give medians with intervals, of which the "
            "first is timed  [the study's; with -t and neither study nor --map-size, 1].",
        ),
    ] = None,
    time_again: Annotated[
        bool,
        typer.Option("--time-again", help="Time cells that have a time once more; `repeat DIR` compares the two."),
    ] = False,
    view: ViewName = None,
    light: Annotated[
        str | None, typer.Option("--light", metavar="NAME", help="A light of the scene, by its name  [each in turn].")
    ] = None,
    plugin: Plugins = None,
    assets: Assets = None,
    up: Up = None,
    profile: Annotated[bool, typer.Option("--profile", help="Print where the time went.")] = False,
    output: Annotated[
        Path, typer.Option("-o", "--output", metavar="DIR", help="Folder of the table, masks and pictures.")
    ] = Path("results/latest"),
    json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Measure techniques on scenes: each is drawn, scored against ray tracing and timed.

    Prints a table for each scene, best first, and writes it with masks and pictures into a folder. Stopped at any
    point, the same command goes on where it was. Without arguments: three scenes, every technique at its defaults, map
    sizes 512 to 4096. The columns are explained by `shadowbench list metrics`.
    """
    from shadowbench.commands.run import RunOptions, run_command

    options = RunOptions(
        tuple(scenes or ()), study, tuple(techniques or ()), map_size, view_size, rounds, phases, time_again,
        view, light, tuple(plugin or ()), assets, up,
    )  # fmt: skip
    raise typer.Exit(run_command(options, output, profile=profile, as_json=json, quiet=quiet))


@app.command(epilog="For example  shadowbench truth stairs -o stairs.npz --view-size 1024")
def truth(
    scene: SceneArgument,
    output: Annotated[Path, typer.Option("-o", "--output", metavar="FILE.npz", help="Where the arrays go.")],
    view_size: ViewSize = None,
    pixel_samples: Annotated[
        int,
        typer.Option(metavar="N", min=1, max=64, help="Rays along a side of a pixel, over which `area` is averaged."),
    ] = 4,
    view: ViewName = None,
    light: LightName = None,
    assets: Assets = None,
    up: Up = None,
    quiet: Quiet = False,
) -> None:
    """Ray-trace the shadows of a view, and write them as NumPy arrays.

    Row 0 is at the top. visibility: 1 lit, 0 in shadow. receivers: the surface faces camera and light. undecided: the
    answer hangs on rounding. area: visibility averaged over the pixel. blocker: metres to the nearest occluder, inf for
    none. triangle: its index, -1 for a miss. cosine: of the light's incidence. diagonal: of casters and receivers,
    metres.
    """
    from shadowbench.commands.single import truth_command

    truth_command(scene, output, view_size or 512, pixel_samples, view, light, assets, up, quiet)


@app.command(
    epilog="\b\nFor example\n"
    "  shadowbench render spot-lamp -t 'shadow-map:size=2048,filter=pcf' -o lamp.png --mask lamp-mask.png"
)
def render(
    scene: SceneArgument,
    technique: OneSpec,
    output: Annotated[
        Path, typer.Option("-o", "--output", metavar="PICTURE.png", help="Where the shaded picture goes.")
    ],
    mask: Annotated[
        Path | None, typer.Option(metavar="MASK.png", help="Visibility too, as 16-bit grey; white is lit.")
    ] = None,
    map: Annotated[
        Path | None, typer.Option(metavar="MAP.png", help="The technique's depth map too, linear; near is dark.")
    ] = None,
    tint: Annotated[
        bool, typer.Option("--tint", help="Tint the picture by what the technique did where, such as by cascade.")
    ] = False,
    view_size: ViewSize = None,
    view: ViewName = None,
    light: LightName = None,
    plugin: Plugins = None,
    assets: Assets = None,
    up: Up = None,
    quiet: Quiet = False,
) -> None:
    """Draw one picture with a technique's shadows, and if asked its mask and its map."""
    from shadowbench.commands.single import render_command

    render_command(
        scene, tuple(technique), output, mask, map, tint, view_size or 512, view, light, tuple(plugin or ()), assets,
        up, quiet,
    )  # fmt: skip


@app.command(
    epilog="\b\nFor example\n"
    "  shadowbench stress --quick\n"
    "  shadowbench stress -t shadow-map -t 'shadow-map:bias=slope' --axis elevation"
)
def stress(
    techniques: Annotated[
        list[str] | None,
        typer.Option(
            "-t", "--technique", metavar="SPEC", help=f"What to walk: {SPEC}; repeatable  [all at their defaults]."
        ),
    ] = None,
    axis: Annotated[
        list[str] | None, typer.Option("--axis", metavar="NAME", help="An axis to walk along; repeatable  [all].")
    ] = None,
    quick: Annotated[bool, typer.Option("--quick", help="A few values of each axis.")] = False,
    plugin: Plugins = None,
    output: Annotated[
        Path, typer.Option("-o", "--output", metavar="DIR", help="Folder of tables, and of masks out of tolerance.")
    ] = Path("results/stress"),
    json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Walk techniques along axes (low light, far from the origin, tiny gaps, ...) until they break.

    Prints the operating range of each: where IoU stays above 0.95, acne and leak below 1%, or the value where it
    breaks first, and how. Stopped at any point, the same command goes on where it was. Exit code 1 for NaN, infinity
    or an OpenGL error, 3 for a crash or hang; breaking points are no failure.
    """
    from shadowbench.commands.stress import StressOptions, stress_command

    options = StressOptions(tuple(techniques or ()), tuple(axis or ()), tuple(plugin or ()), quick)
    raise typer.Exit(stress_command(options, output, as_json=json, quiet=quiet))
