"""`merge`: join run folders of several machines or parts into one."""

from dataclasses import asdict
from pathlib import Path
from typing import Annotated

import typer

from shadowbench.commands import console, options
from shadowbench.errors import counted


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
    written, and the exit code is 1. A cell that failed in one folder is taken from another. Times are kept by machine;
    table and report show those of the machine with the most. Nothing is measured.
    """
    from shadowbench.results.merge import merge as merge_folders

    merged = merge_folders(folders, output)
    if json:
        console.print_json(asdict(merged))
    elif merged.differing:
        rows = [
            (one["cell"], one["what"], *map("{} in {}".format, one["values"], one["folders"]))
            for one in merged.differing
        ]
        console.print_table("unequal scores", ("cell", "what", "", " "), rows, whole=("what",))
    for note in () if quiet else merged.notes:
        console.print_error(f"note: {note}")
    if merged.differing:
        cells = counted(len({one["cell"] for one in merged.differing}), "cell")
        console.print_error(f"shadowbench: nothing was written: {cells} with unequal scores")
    elif not json:
        console.print_line(f"{output}: {counted(merged.cells, 'cell')}, {counted(merged.times, 'time')}")
    return 1 if merged.differing else 0
