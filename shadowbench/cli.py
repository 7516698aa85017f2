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

Quiet = Annotated[bool, typer.Option("--quiet", "-q", help="Print results and errors only.")]
Json = Annotated[bool, typer.Option("--json", help="Print tables as JSON.")]
Plugins = Annotated[
    list[Path] | None, typer.Option("--plugin", metavar="FILE.py", help="A Python file that defines techniques.")
]
Assets = Annotated[
    Path | None, typer.Option(metavar="DIR", help="A second folder that a scene file's meshes may lie in.")
]
ViewSize = Annotated[
    int | None, typer.Option(metavar="N", min=1, max=16384, help="Pixels along a side of the view  [512].")
]
ViewName = Annotated[
    str | None, typer.Option("--view", metavar="NAME", help="A camera of the scene, by name  [its first].")
]
LightName = Annotated[
    str | None, typer.Option("--light", metavar="NAME", help="A light of the scene, by name  [its first].")
]
SceneArgument = Annotated[str, typer.Argument(metavar="SCENE", help="Built-in name, .toml, or mesh file.")]
OneSpec = Annotated[str, typer.Option("-t", "--technique", metavar="SPEC", help="Technique and parameters.")]


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


@app.command()
def run(
    scenes: Annotated[
        list[str] | None, typer.Argument(metavar="[SCENE]...", help="Scenes; without any, the study's.")
    ] = None,
    study: Annotated[
        str | None, typer.Option("-s", "--study", metavar="STUDY", help="A study file, or one of ours by name.")
    ] = None,
    techniques: Annotated[
        list[str] | None,
        typer.Option(
            "-t",
            "--technique",
            metavar="SPEC",
            help="A technique, such as shadow-map:size=2048,filter=pcf(taps=5); repeatable.",
        ),
    ] = None,
    map_size: Annotated[str | None, typer.Option(metavar="N,N,...", help="Map sizes  [512,1024,2048,4096].")] = None,
    view_size: ViewSize = None,
    rounds: Annotated[
        int | None, typer.Option(metavar="N", min=0, max=10000, help="Timed rounds; 0 times nothing  [9].")
    ] = None,
    phases: Annotated[
        int | None,
        typer.Option(
            metavar="N", min=1, max=10000, help="Positions of the map's grid; more than one give intervals  [1]."
        ),
    ] = None,
    view: ViewName = None,
    light: Annotated[
        str | None, typer.Option("--light", metavar="NAME", help="A light of the scene, by name  [each].")
    ] = None,
    plugin: Plugins = None,
    assets: Assets = None,
    profile: Annotated[bool, typer.Option("--profile", help="Print where the time went.")] = False,
    output: Annotated[Path, typer.Option("-o", "--output", metavar="DIR", help="Run folder.")] = Path("results/latest"),
    json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Measure techniques on scenes: a scored and timed table, masks and pictures, in a run folder.

    Stopped at any point, the same command goes on where it was. Without arguments: three scenes, every technique at
    its defaults, map sizes 512 to 4096.
    """
    from shadowbench.commands.run import RunOptions, run_command

    options = RunOptions(
        tuple(scenes or ()), study, tuple(techniques or ()), map_size, view_size, rounds, phases, view, light,
        tuple(plugin or ()), assets,
    )  # fmt: skip
    raise typer.Exit(run_command(options, output, profile=profile, as_json=json, quiet=quiet))


@app.command()
def truth(
    scene: SceneArgument,
    output: Annotated[Path, typer.Option("-o", "--output", metavar="FILE.npz", help="Where the arrays go.")],
    view_size: ViewSize = None,
    pixel_samples: Annotated[int, typer.Option(min=1, max=64, help="Samples along a side of a pixel, for `area`.")] = 4,
    view: ViewName = None,
    light: LightName = None,
    assets: Assets = None,
    quiet: Quiet = False,
) -> None:
    """Trace the truth of a view: visibility, receivers, undecided, area, blocker, triangle and more, as arrays."""
    from shadowbench.commands.single import truth_command

    truth_command(scene, output, view_size or 512, pixel_samples, view, light, assets, quiet)


@app.command()
def render(
    scene: SceneArgument,
    technique: OneSpec,
    output: Annotated[Path, typer.Option("-o", "--output", metavar="PICTURE.png", help="The shaded picture.")],
    mask: Annotated[Path | None, typer.Option(metavar="MASK.png", help="Visibility, 16-bit grey.")] = None,
    map: Annotated[Path | None, typer.Option(metavar="MAP.png", help="The depth map, linear, near is dark.")] = None,
    view_size: ViewSize = None,
    view: ViewName = None,
    light: LightName = None,
    plugin: Plugins = None,
    assets: Assets = None,
    quiet: Quiet = False,
) -> None:
    """Draw one picture with a technique's shadow, and if asked its mask and its map."""
    from shadowbench.commands.single import render_command

    render_command(
        scene, technique, output, mask, map, view_size or 512, view, light, tuple(plugin or ()), assets, quiet
    )


@app.command("list")
def list_things(
    what: Annotated[str, typer.Argument(help="techniques, scenes, metrics or studies; without it, all.")] = "",
    plugin: Plugins = None,
    json: Json = False,
    quiet: Quiet = False,
) -> None:
    """What there is: techniques with their parameters, scenes, metrics, studies."""
    from shadowbench.commands.listing import list_command

    list_command(what, tuple(plugin or ()), json)


@app.command()
def doctor(json: Json = False, quiet: Quiet = False) -> None:
    """Check this machine: OpenGL, Embree, clock, limits, cache; says what is missing and how to get it."""
    from shadowbench.commands.doctor import doctor_command

    raise typer.Exit(doctor_command(json))


def main() -> None:
    """Entry point: errors that a user can mend are one line and an exit code, not a traceback."""
    from shadowbench.errors import ShadowbenchError

    try:
        code = app(standalone_mode=False) or 0
    except _UsageError as error:
        _complain(f"{error.format_message().rstrip('.')}; --help lists what is allowed")  # type: ignore[attr-defined]
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
