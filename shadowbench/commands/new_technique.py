"""`new-technique`: write a minimal technique to start from."""

from pathlib import Path
from typing import Annotated

import typer

app = typer.Typer()


@app.command(
    epilog="\b\nFor example\n"
    "  shadowbench new-technique my-shadows\n"
    "  shadowbench run cube-on-plane -t my-shadows -t shadow-map --plugin my-shadows.py"
)
def new_technique(
    name: Annotated[str, typer.Argument(metavar="NAME", help="Name of the technique in specs and tables.")],
    output: Annotated[
        Path,
        typer.Option(
            "-o", "--output", metavar="DIR", help="Folder for NAME.py  [the current one].", show_default=False
        ),
    ] = Path(),
) -> None:
    """Write NAME.py, a minimal technique to start from.

    It is a shadow map with its shader, and runs unmodified. An existing file is not overwritten.
    """
    from shadowbench.plugin.template import write_technique

    file = write_technique(name, output)
    typer.echo(f"{file}: try it with")
    for command in ("run", "view"):
        typer.echo(f"  shadowbench {command} cube-on-plane -t {name} -t shadow-map --plugin {file}")
