"""Commands about shadowbench and this machine: list, doctor."""

from typing import Annotated

import typer

from shadowbench.cli.options import Json, Plugins, Quiet

app = typer.Typer()


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
    """Check this machine: OpenGL and its limits, clock and its noise, cache of truths; says what is missing."""
    from shadowbench.commands.doctor import doctor_command

    raise typer.Exit(doctor_command(json, quiet))
