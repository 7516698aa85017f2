"""`merge`: join run folders of several machines or parts into one."""

from dataclasses import asdict
from pathlib import Path
from typing import Annotated

import typer

from shadowbench.commands import console, options
from shadowbench.errors import counted

_LINES = 40  # of the table of what differs


@options.command(
    "\b\nFor example\n"
    "  shadowbench run -s presets --part 1/2 -o part-1     # on one machine\n"
    "  shadowbench run -s presets --part 2/2 -o part-2     # on another\n"
    "  shadowbench merge part-1 part-2 -o results/presets"
)
def merge(
    folders: Annotated[
        list[Path], options.argument("DIR...", "Folders written by `run`, or by `stress`, on one renderer.")
    ],
    output: Annotated[Path, typer.Option("-o", "--output", metavar="DIR", help="Folder for the result, new or empty.")],
    json: options.Json = False,
    quiet: options.Quiet = False,
) -> int:
    """Merge run folders of several machines or parts.

    The result has the cells of all folders, their images, and a table, as if one command had measured them. A cell that
    several folders have must have the same scores and mask in each: otherwise what differs is listed, nothing is
    written, and the exit code is 1. A cell that failed in one folder is taken from another, and so is a mask whose
    pixels are not those of its row. Times are kept by machine; table and report show those of the machine with the
    most. Nothing is measured.
    """
    from shadowbench.results.merge import merge as merged

    found = merged(folders, output)
    of_folders = counted(len(folders), "folder")
    if json:
        values = asdict(found)
        values["differing"] = values.pop("conflicts")
        console.print_json(values)
    elif found.conflicts:
        rows = []
        for one in found.conflicts[:_LINES]:
            values_in = (f"{value} in {folder.name}" for value, folder in zip(one.values, one.folders, strict=True))
            rows.append((one.cell, one.what, *values_in))
        console.print_table("unequal scores", ("cell", "what", "", " "), rows, whole=("what",))
        if len(found.conflicts) > _LINES:
            console.print_line(f"  and {len(found.conflicts) - _LINES} more; --json lists all")
    for note in () if quiet else found.notes:
        console.print_error(f"note: {note}")
    if found.conflicts:
        cells = counted(len({one.cell for one in found.conflicts}), "cell")
        console.print_error(f"shadowbench: nothing was written: {cells} with unequal scores in {of_folders}")
        return 1
    if not json:
        of_times = f", {counted(found.times, 'time')} of {counted(found.machines, 'machine')}" if found.times else ""
        console.print_line(f"{output}: {counted(found.cells, 'cell')}{of_times}, from {of_folders}")
    return 0
