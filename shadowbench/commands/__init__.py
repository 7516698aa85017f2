"""The command line, a file for each command: it parses, calls what computes, and prints.

What computes is imported in the bodies, so that help and a mistyped option answer at once.
"""

import os
import sys
import traceback
from typing import Annotated

import typer

from shadowbench import __version__
from shadowbench.commands import (
    check,
    doctor,
    export,
    listing,
    needs,
    new_technique,
    recommend,
    render,
    repeat,
    report,
    run,
    score,
    stress,
    truth,
    tune,
)

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
_MEASURING, _RESULTS = (run, truth, render, stress), (report, check, repeat)
_CHOOSING, _ENGINES, _ABOUT = (needs, tune, recommend), (export, score), (listing, new_technique, doctor)
for module in (*_MEASURING, *_RESULTS, *_CHOOSING, *_ENGINES, *_ABOUT):  # as --help lists them
    app.add_typer(module.app)


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


def main() -> None:
    """Entry point: errors that a user can mend are one line and an exit code, not a traceback."""
    from shadowbench.errors import ShadowbenchError
    from shadowbench.files import FULL

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
    except Exception as error:
        if isinstance(error, OSError) and error.errno in FULL:
            _complain(f"{error.filename or 'a file'}: cannot be written ({os.strerror(error.errno).lower()})")
            code = 2
        else:
            traceback.print_exc()
            _complain("an internal error; please report it with the lines above")
            code = 3
    if code == _STOPPED:  # Typer answers Ctrl-C with this code, and prints nothing
        _complain("stopped; the same command goes on from here")
    sys.exit(code)


def _complain(text: str) -> None:
    typer.echo(f"shadowbench: {' '.join(text.split())}", err=True)
