"""`new-technique`: write a minimal technique to start from."""

from pathlib import Path
from typing import Annotated

import typer

from shadowbench.commands import console, options


@options.command(
    "\b\nFor example\n"
    "  shadowbench new-technique my-shadows\n"
    "  shadowbench run cube-on-plane -t my-shadows -t shadow-map --plugin my-shadows.py"
)
def new_technique(
    name: Annotated[str, typer.Argument(metavar="NAME", help="Name of the technique in specs and tables.")],
    output: Annotated[
        Path | None, typer.Option("-o", "--output", metavar="DIR", help="Folder for NAME.py  [the current one].")
    ] = None,
) -> None:
    """Write NAME.py, a minimal technique to start from.

    It is a shadow map with its shader, and runs unmodified. An existing file is not overwritten.
    """
    from shadowbench.plugin.template import write_technique

    file = write_technique(name, output or Path())
    console.print_line(f"{file}: try it with")
    for command in ("run", "view"):
        console.print_line(f"  shadowbench {command} cube-on-plane -t {name} -t shadow-map --plugin {file}")
