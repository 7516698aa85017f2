"""`needs`: what a scene asks of shadows."""

import typer

from shadowbench.commands.console import TEXT, ConsoleReporter, notes_on_view, print_json, print_table
from shadowbench.commands.options import Assets, Json, LightName, Quiet, SceneArgument, Up, ViewName, ViewSize

app = typer.Typer()


@app.command(epilog="For example  shadowbench needs street --view-size 1024")
def needs(
    scene: SceneArgument,
    view_size: ViewSize = None,
    view: ViewName = None,
    light: LightName = None,
    assets: Assets = None,
    up: Up = None,
    json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Say what a scene asks of shadows, without drawing any: map size, cascades, depth bits, bias, penumbra.

    Each need with its number, its standard error where pixels were sampled, and the reason. Needs no OpenGL.
    """
    from dataclasses import asdict

    from shadowbench.needs.survey import needs as needs_of
    from shadowbench.needs.words import told
    from shadowbench.scenes.views import chosen_view

    with ConsoleReporter(quiet) as reporter:
        chosen = chosen_view(scene, view_size or 512, view, light, assets, up)
        notes_on_view(reporter, chosen, view, light)
        found = needs_of(chosen)
        if found.pixels < found.view_size**2:
            part = found.pixels / found.view_size**2
            reporter.note(f"{part:.1%} of the pixels were looked at; ± is one standard error")
    rows = told(found)
    if json:
        values = asdict(found)
        values["reach"].pop("matters")
        names = {"scene": chosen.scene.name, "view": chosen.camera.name}
        print_json(names | values | {"told": [asdict(row) for row in rows]})
        return
    title = f"{chosen.scene.name}, {chosen.size} × {chosen.size} pixels"
    columns = dict.fromkeys(("need", "number", "why"), TEXT)
    print_table(title, columns, [(row.need, row.number, row.reason) for row in rows], padded=True)
