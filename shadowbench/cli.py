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


@app.command()
def doctor(json: Json = False, quiet: Quiet = False) -> None:
    """Check this machine: OpenGL and its limits, clock, cache of truths; says what is missing and how to get it."""
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
