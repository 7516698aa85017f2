"""Commands that help to choose: needs."""

import typer

from shadowbench.cli.options import Assets, Json, LightName, Quiet, SceneArgument, ViewName, ViewSize

app = typer.Typer()


@app.command(epilog="For example  shadowbench needs street --view-size 1024")
def needs(
    scene: SceneArgument,
    view_size: ViewSize = None,
    view: ViewName = None,
    light: LightName = None,
    assets: Assets = None,
    json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Say what a scene asks of shadows, without drawing any: map size, cascades, depth bits, bias, penumbra.

    Each need with its number, its standard error where pixels were sampled, and the reason. Needs no OpenGL.
    """
    from shadowbench.commands.needs import needs_command

    needs_command(scene, view_size or 512, view, light, assets, json, quiet)
