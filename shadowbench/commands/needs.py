"""`needs`: what a scene asks of shadows."""

from dataclasses import asdict
from pathlib import Path

from rich.table import Table

from shadowbench.commands.console import ConsoleReporter, print_json, print_table
from shadowbench.needs.survey import needs
from shadowbench.needs.words import told
from shadowbench.scenes.views import chosen_view, notes_on


def needs_command(
    scene: str,
    view_size: int,
    view: str | None,
    light: str | None,
    assets: Path | None,
    up: str | None,
    as_json: bool,
    quiet: bool,
) -> None:
    """Look at a view and print what it needs."""
    with ConsoleReporter(quiet) as reporter:
        chosen = chosen_view(scene, view_size, view, light, assets, up)
        for note in notes_on(chosen, view, light):
            reporter.note(note)
        found = needs(chosen)
        if found.pixels < found.view_size**2:
            part = found.pixels / found.view_size**2
            reporter.note(f"{part:.1%} of the pixels were looked at; ± is one standard error")
    rows = told(found)
    if as_json:
        values = asdict(found)
        values["reach"].pop("matters")
        names = {"scene": chosen.scene.name, "view": chosen.camera.name}
        print_json(names | values | {"told": [asdict(row) for row in rows]})
        return
    table = Table(title=f"{chosen.scene.name}, {view_size} × {view_size} pixels", title_justify="left", box=None)
    for column in ("need", "number", "why"):
        table.add_column(column)
    for row in rows:
        table.add_row(row.need, row.number, row.reason)
    print_table(table)
