"""`new-technique`: a technique of your own to start from."""

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
    name: Annotated[str, typer.Argument(metavar="NAME", help="What it is called in specs and tables.")],
    output: Annotated[
        Path,
        typer.Option(
            "-o", "--output", metavar="DIR", help="Where NAME.py is written  [the current folder].", show_default=False
        ),
    ] = Path(),
) -> None:
    """Write NAME.py, a small shadow map with its shader, which runs as it is: make a technique of your own of it.

    A file that is there already is not overwritten.
    """
    from shadowbench.techniques.template import write_technique

    file = write_technique(name, output)
    typer.echo(f"{file}: try it with\n  shadowbench run cube-on-plane -t {name} -t shadow-map --plugin {file}")
