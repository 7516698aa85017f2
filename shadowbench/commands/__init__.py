"""The command line: one file per command, which parses arguments, calls the computation and prints.

Modules that compute are imported in function bodies, so that help and usage errors are fast.
"""

import errno
import io
import os
import sys
import traceback
from typing import Annotated, Any

import typer
from typer.core import TyperGroup

from shadowbench.commands import (
    check,
    engines,
    extend,
    listing,
    merge,
    recommend,
    render,
    report,
    run,
    score,
    stress,
    view,
)
from shadowbench.commands.options import GroupedCommand, write_sections
from shadowbench.errors import NOT_EVERYWHERE, NOT_INSTALLED, ShadowbenchError
from shadowbench.files import FULL
from shadowbench.versions import VERSION

_STOPPED = 130
# Typer brought its own copy of click in 2025; either way this is what it raises for a wrong command line.
_UsageError: type[Exception] = next(base for base in typer.BadParameter.__mro__ if base.__name__ == "ClickException")


class _Grouped(TyperGroup):
    """Commands in --help under their `rich_help_panel`, which typer does only where it draws help with Rich."""

    def format_commands(self, ctx: Any, formatter: Any) -> None:
        """One section per panel, with aligned columns."""
        longest = max(map(len, self.commands))
        panels: dict[str, list[tuple[str, str]]] = {}
        for name, command in self.commands.items():
            text = command.get_short_help_str(formatter.width - longest - 6)
            panels.setdefault(str(getattr(command, "rich_help_panel", "")), []).append((name.ljust(longest), text))
        write_sections(formatter, panels)


app = typer.Typer(
    name="shadowbench",
    cls=_Grouped,
    help="Real-time shadow techniques, scored against ray tracing.\n\n"
    "SCENE is a built-in name (see `shadowbench list scenes`), a scene file (.toml) or a mesh file "
    "(.glb .gltf .obj .ply .stl .off). If a file lacks a camera, a light or a ground, one is assumed, and a note "
    "says which; --camera, --lamp and --sun-at place others.\n\n"
    "SPEC is a technique with its parameters (see `shadowbench list techniques`), written as "
    "shadow-map:size=2048,filter=pcf. A cell is one spec in one view of a scene, under one light, at one map size.",
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
    context_settings={"help_option_names": ["-h", "--help"]},
)
_PANELS = {  # as --help lists them
    "Measure techniques": (run.run, stress.stress, score.score, render.truth),
    "Decide what a scene needs": (recommend.recommend, recommend.needs),
    "Check results and the machine": (check.check, merge.merge, listing.doctor),
    "Look": (report.report, render.render, view.view, listing.list_things),
    "Extend with a technique or an engine": (engines.engines, extend.new_technique, extend.export),
}
for _panel, _commands in _PANELS.items():
    for _one in _commands:
        app.command(epilog=_one.epilog, rich_help_panel=_panel, cls=GroupedCommand)(_one.function)


@app.callback(invoke_without_command=True)
def version_option(
    context: typer.Context,
    version: Annotated[bool, typer.Option("--version", help="Print the version and exit.")] = False,
) -> None:
    """Print the version for --version, or the help if no command is given."""
    if version:
        typer.echo(VERSION)
        raise typer.Exit
    if context.invoked_subcommand is None:
        typer.echo(context.get_help())


def main() -> None:
    """Entry point: an error that the user can fix becomes one line and an exit code, not a traceback."""
    if isinstance(sys.stdout, io.TextIOWrapper):
        sys.stdout.reconfigure(errors="replace")
    line = ""
    try:
        code = int(app(standalone_mode=False) or 0)
        sys.stdout.flush()
    except (KeyboardInterrupt, typer.Abort):
        code = _STOPPED
    except Exception as error:
        code, line = _answer(error)
    if code == _STOPPED:  # Typer answers Ctrl-C with this code, and prints nothing
        line = "stopped; repeat the command to resume"
    if line:
        print(f"shadowbench: {' '.join(line.split())}", file=sys.stderr)
    sys.exit(code)


def _answer(error: Exception) -> tuple[int, str]:
    """Exit code and line for an error; the traceback of an internal one is printed."""
    if isinstance(error, _UsageError):
        message = error.format_message().rstrip(".").replace("Input should be", "allowed is")  # type: ignore[attr-defined]
        return 2, f"{message}; --help lists what is allowed"
    if isinstance(error, ShadowbenchError):
        return error.exit_code, str(error)
    if isinstance(error, OSError) and error.errno in (*FULL, errno.EPIPE):
        if error.filename is None:
            os.dup2(os.open(os.devnull, os.O_WRONLY), 1)  # what Python still has to print
        if error.errno == errno.EPIPE:  # its reader has ended, as `| head` does; Typer answers the same
            return 1, ""
        return 2, f"{error.filename or 'stdout or a file'}: cannot be written ({os.strerror(error.errno).lower()})"
    if isinstance(error, ModuleNotFoundError) and error.name in NOT_EVERYWHERE:
        return 3, NOT_INSTALLED.format(error.name)
    traceback.print_exc()
    return 3, "an internal error; please report it with the lines above"
