"""`merge`: join run folders of several machines or parts into one."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from shadowbench.commands import console
from shadowbench.commands.options import Json, Quiet
from shadowbench.errors import counted

if TYPE_CHECKING:
    from shadowbench.results.merge import Conflict

_LINES = 40  # of the table of what differs

app = typer.Typer()


@app.command(
    epilog="\b\nFor example\n"
    "  shadowbench run -s presets --part 1/2 -o part-1     # on one machine\n"
    "  shadowbench run -s presets --part 2/2 -o part-2     # on another\n"
    "  shadowbench merge part-1 part-2 -o results/presets"
)
def merge(
    folders: Annotated[
        list[Path], typer.Argument(metavar="DIR...", help="Folders written by `run`, or by `stress`, on one renderer.")
    ],
    output: Annotated[Path, typer.Option("-o", "--output", metavar="DIR", help="Folder for the result, new or empty.")],
    json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Merge run folders of several machines or parts.

    The result has the cells of all folders, their images, and a table, as if one command had measured them. A cell that
    several folders have must have the same scores and mask in each: otherwise what differs is listed, nothing is
    written, and the exit code is 1. A cell that failed in one folder is taken from another, and so is a mask whose
    pixels are not those of its row. Times are kept by machine; table and report show those of the machine with the
    most. Nothing is measured.
    """
    from shadowbench.results.merge import merge as merged

    found = merged(folders, output)
    if json:
        console.print_json(
            {
                **{name: getattr(found, name) for name in ("cells", "times", "machines")},
                "notes": list(found.notes),
                "differing": [
                    {"cell": one.cell, "what": one.what, "folders": list(map(str, one.folders)), "values": one.values}
                    for one in found.conflicts
                ],
            }
        )
    elif found.conflicts:
        _print_conflicts(found.conflicts)
    if not quiet:
        for note in found.notes:
            console.print_error(f"note: {note}")
    if found.conflicts:
        cells = counted(len({one.cell for one in found.conflicts}), "cell")
        console.print_error(
            f"shadowbench: nothing was written: {cells} with unequal scores in {counted(len(folders), 'folder')}"
        )
        raise typer.Exit(1)
    if not json:
        of_times = f", {counted(found.times, 'time')} of {counted(found.machines, 'machine')}" if found.times else ""
        console.print_line(
            f"{output}: {counted(found.cells, 'cell')}{of_times}, from {counted(len(folders), 'folder')}"
        )


def _print_conflicts(conflicts: "tuple[Conflict, ...]") -> None:
    rows = [
        [
            one.cell,
            one.what,
            *(f"{value} in {folder.name}" for value, folder in zip(one.values, one.folders, strict=True)),
        ]
        for one in conflicts[:_LINES]
    ]
    console.print_table("unequal scores", ("cell", "what", "", " "), rows, whole=("what",))
    if len(conflicts) > _LINES:
        console.print_line(f"  and {len(conflicts) - _LINES} more; --json lists all")
