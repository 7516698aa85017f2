"""The command line: sits on top, prints, and computes nothing."""

import sys
import traceback
from pathlib import Path
from typing import Annotated

import typer

from shadowbench import __version__

_STOPPED = 130
# Typer brought its own copy of click in 2025; either way this is what it raises for a wrong command line.
_UsageError: type[Exception] = next(base for base in typer.BadParameter.__mro__ if base.__name__ == "ClickException")

app = typer.Typer(
    name="shadowbench",
    help="Real-time shadow techniques, scored against ray tracing.\n\n"
    "SCENE is a built-in name (see `shadowbench list scenes`), a .toml scene file, or any mesh file "
    "(.glb .gltf .obj .ply .stl .off); what a file lacks is assumed, and said.",
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
    context_settings={"help_option_names": ["-h", "--help"]},
)

Quiet = Annotated[bool, typer.Option("--quiet", "-q", help="Print results and errors only: no notes, no progress.")]
Json = Annotated[bool, typer.Option("--json", help="Print JSON instead of tables.")]
Plugins = Annotated[
    list[Path] | None,
    typer.Option("--plugin", metavar="FILE.py", help="A Python file that adds techniques; repeatable."),
]
Assets = Annotated[
    Path | None,
    typer.Option(metavar="DIR", help="A folder that a scene file's meshes may lie in, beside the scene's own."),
]
ViewSize = Annotated[
    int | None, typer.Option(metavar="N", min=1, max=16384, help="Pixels along a side of the picture  [512].")
]
ViewName = Annotated[
    str | None, typer.Option("--view", metavar="NAME", help="A camera of the scene, by its name  [the first].")
]
LightName = Annotated[
    str | None, typer.Option("--light", metavar="NAME", help="A light of the scene, by its name  [the first].")
]
_SCENE = "a built-in name (shadowbench list scenes), a scene file (.toml), or a mesh file"
_SPEC = "a technique and its parameters (shadowbench list techniques)"
SceneArgument = Annotated[str, typer.Argument(metavar="SCENE", help=f"What to look at: {_SCENE}.")]
OneSpec = Annotated[list[str], typer.Option("-t", "--technique", metavar="SPEC", help=f"What draws it: {_SPEC}.")]


@app.callback(invoke_without_command=True)
def version_option(
    context: typer.Context,
    version: Annotated[bool, typer.Option("--version", help="Print the version and stop.")] = False,
) -> None:
    """Print the version when asked for it, and the help when asked for nothing."""
    if version:
        typer.echo(__version__)
        raise typer.Exit
    if context.invoked_subcommand is None:
        typer.echo(context.get_help())


@app.command(
    epilog="\b\nFor example\n"
    "  shadowbench run cube-on-plane -t shadow-map --map-size 512,1024\n"
    "  shadowbench run my.glb -t unshadowed -t 'shadow-map:bias=slope,filter=pcf(taps=5)'\n"
    "  shadowbench run -s presets -o results/presets"
)
def run(
    scenes: Annotated[list[str] | None, typer.Argument(metavar="SCENE", help=f"Each {_SCENE}  [the study's].")] = None,
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
        typer.Option("-t", "--technique", metavar="SPEC", help=f"What to measure: {_SPEC}; repeatable  [the study's]."),
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
            help="Positions of the map's texels to score; more than one give medians with intervals  [1].",
        ),
    ] = None,
    view: ViewName = None,
    light: Annotated[
        str | None, typer.Option("--light", metavar="NAME", help="A light of the scene, by its name  [each in turn].")
    ] = None,
    plugin: Plugins = None,
    assets: Assets = None,
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
        tuple(scenes or ()), study, tuple(techniques or ()), map_size, view_size, rounds, phases, view, light,
        tuple(plugin or ()), assets,
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
    quiet: Quiet = False,
) -> None:
    """Ray-trace the shadows of a view, and write them as NumPy arrays.

    Row 0 is at the top. visibility: 1 lit, 0 in shadow. receivers: the surface faces camera and light. undecided: the
    answer hangs on rounding. area: visibility averaged over the pixel. blocker: metres to the nearest occluder, inf for
    none. triangle: its index, -1 for a miss. cosine: of the light's incidence. diagonal: of casters and receivers,
    metres.
    """
    from shadowbench.commands.single import truth_command

    truth_command(scene, output, view_size or 512, pixel_samples, view, light, assets, quiet)


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
    quiet: Quiet = False,
) -> None:
    """Draw one picture with a technique's shadows, and if asked its mask and its map."""
    from shadowbench.commands.single import render_command

    render_command(
        scene, tuple(technique), output, mask, map, tint, view_size or 512, view, light, tuple(plugin or ()), assets,
        quiet,
    )  # fmt: skip


@app.command(epilog="For example  shadowbench export stairs for-my-engine/ --view-size 1024")
def export(
    scene: SceneArgument,
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="Where the files go; made if need be.")],
    view_size: ViewSize = None,
    view: ViewName = None,
    light: LightName = None,
    assets: Assets = None,
    quiet: Quiet = False,
) -> None:
    """Write a view for your engine: scene.glb, view.json, truth.png.

    scene.glb: meshes with colours, the camera, the light (KHR_lights_punctual). view.json: matrices, near and far,
    size, where pixels are sampled. truth.png: the ray-traced shadows, as an example of a mask for `shadowbench score`.
    """
    from shadowbench.commands.export import export_command

    export_command(scene, folder, view_size or 512, view, light, assets, quiet)


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
    json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Score a mask of another renderer, or three of its screenshots, against ray tracing. Needs no OpenGL.

    `shadowbench export` says what to draw. What is flipped, inverted or not square is refused; what seems shifted or
    gamma-encoded is scored as it is, with a warning.
    """
    from shadowbench.commands.score import ScoreOptions, score_command

    options = ScoreOptions(scene, mask, lit, shadowed, ambient, view, light, assets, output, name, diff)
    score_command(options, as_json=json, quiet=quiet)


@app.command("list")
def list_things(
    what: Annotated[
        str, typer.Argument(metavar="WHAT", help="One of techniques, scenes, metrics, studies  [all].")
    ] = "",
    name: Annotated[str, typer.Argument(metavar="NAME", help="One of them alone  [all].")] = "",
    plugin: Plugins = None,
    json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Print what there is: techniques with parameters and presets, built-in scenes, metrics (the columns), studies."""
    from shadowbench.commands.listing import list_command

    list_command(what, tuple(plugin or ()), json, quiet, name)


@app.command(
    epilog="\b\nFor example\n"
    "  shadowbench report results/latest\n"
    "  shadowbench report laptop/ server/ -o both.html\n"
    "  shadowbench report results/latest --format png -o charts/"
)
def report(
    folders: Annotated[list[Path], typer.Argument(metavar="DIR...", help="Run folders, of one machine or of several.")],
    output: Annotated[
        Path | None,
        typer.Option(
            "-o",
            "--output",
            metavar="FILE",
            help="Where it goes; a folder for png  [report.html, .md, .csv, or the folder report].",
        ),
    ] = None,
    format: Annotated[
        str,
        typer.Option(
            metavar="FORMAT",
            help="html: one page, which opens without a network; md: tables; csv: the cells of all folders; "
            "png: a file for each chart, SCENE.VIEW-SIZE.front.png, .sizes.png, .passes.png.",
        ),
    ] = "html",
    quiet: Quiet = False,
) -> None:
    """Show what accuracy costs: error against time, time to accuracy, passes, pictures of what is wrong.

    Reads run folders and measures nothing. Times of different folders never share an axis.
    """
    from shadowbench.commands.report import report_command

    report_command(folders, output, format, quiet)


@app.command(
    epilog="\b\nFor example\n"
    "  shadowbench check results/latest --baseline results/baseline\n"
    "  shadowbench check results/latest --baseline results/baseline --update"
)
def check(
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="A run folder.")],
    baseline: Annotated[
        Path, typer.Option(metavar="DIR", help="What it is held against: a baseline or another run folder.")
    ],
    time: Annotated[
        bool, typer.Option("--time", help="Fail also for what has become slower, on the same machine.")
    ] = False,
    update: Annotated[
        bool, typer.Option("--update", help="Make DIR's rows the baseline; says what changes by it.")
    ] = False,
    tolerance: Annotated[
        list[str] | None,
        typer.Option(metavar="METRIC=X", help="How far a metric may get worse; repeatable  [the metric's own]."),
    ] = None,
    json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Fail, with exit code 1, where a run is worse than a baseline: shadows, work, or cells that are missing.

    Cells are matched by scene, view, light, phase, full spec, map and view size. Prints what regressed and what
    improved, worst first, and draws the worst into DIR/check. Work (draws, primitives, bytes exactly, shader
    invocations within 2%) is compared where the renderer is the same, times as ratios to the reference.
    """
    from shadowbench.commands.check import CheckOptions, check_command

    options = CheckOptions(folder, baseline, time, update, tuple(tolerance or ()))
    raise typer.Exit(check_command(options, as_json=json, quiet=quiet))


@app.command(epilog="For example  shadowbench repeat results/monday results/tuesday")
def repeat(
    first: Annotated[Path, typer.Argument(metavar="DIR", help="A run folder.")],
    second: Annotated[Path, typer.Argument(metavar="DIR", help="The same study, run again into a folder of its own.")],
    json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Compare two runs of one study on one machine: the order of cells by time, and their work.

    Measures nothing. Exit code 1 when a ranking's Kendall tau is below 0.95, over the pairs that are apart in both
    runs, or work differs.
    """
    from shadowbench.commands.repeat import repeat_command

    raise typer.Exit(repeat_command(first, second, json, quiet))


@app.command(
    epilog="\b\nFor example\n"
    "  shadowbench stress --quick\n"
    "  shadowbench stress -t shadow-map -t 'shadow-map:bias=slope' --axis elevation"
)
def stress(
    techniques: Annotated[
        list[str] | None,
        typer.Option(
            "-t", "--technique", metavar="SPEC", help=f"What to walk: {_SPEC}; repeatable  [all at their defaults]."
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


@app.command()
def doctor(json: Json = False, quiet: Quiet = False) -> None:
    """Check this machine: OpenGL and its limits, clock and its noise, cache of truths; says what is missing."""
    from shadowbench.commands.doctor import doctor_command

    raise typer.Exit(doctor_command(json, quiet))


def main() -> None:
    """Entry point: errors that a user can mend are one line and an exit code, not a traceback."""
    from shadowbench.errors import ShadowbenchError

    try:
        code = app(standalone_mode=False) or 0
    except _UsageError as error:
        message = error.format_message().rstrip(".").replace("Input should be", "allowed is")  # type: ignore[attr-defined]
        _complain(f"{message}; --help lists what is allowed")
        code = 2
    except ShadowbenchError as error:
        _complain(str(error))
        code = error.exit_code
    except (KeyboardInterrupt, typer.Abort):
        code = _STOPPED
    except Exception:
        traceback.print_exc()
        _complain("an internal error; please report it with the lines above")
        code = 3
    if code == _STOPPED:  # Typer answers Ctrl-C with this code, and prints nothing
        _complain("stopped; the same command goes on from here")
    sys.exit(code)


def _complain(text: str) -> None:
    typer.echo(f"shadowbench: {' '.join(text.split())}", err=True)


if __name__ == "__main__":
    main()
