"""`repro`: a folder that makes one row again."""

from pathlib import Path
from typing import Annotated

import typer

from shadowbench.commands import console, options


@options.command(
    "\b\nFor example\n"
    "  shadowbench repro 1b43f3e7 --of results/latest\n"
    "  cd repro-1b43f3e7 && shadowbench run -s study.toml -o again && shadowbench check again --baseline ."
)
def repro(
    row: Annotated[str, options.argument("ROW", "The row's key, or its beginning: see table.csv.")],
    of: Annotated[Path, typer.Option("--of", metavar="DIR", help="The run folder that has the row.")] = Path(
        "results/latest"
    ),
    output: Annotated[
        Path | None, typer.Option("-o", "--output", metavar="DIR", help="Folder for the files  [repro-ROW].")
    ] = None,
    quiet: options.Quiet = False,
) -> None:
    """Write a folder that makes one row of a table again.

    \b
    study.toml  the row's cell alone, every parameter spelt out
    rows.jsonl  the row, as a baseline for `check`
    mask.png    the mask that was scored
    cite.bib    a BibTeX entry of the row
    README.md   what was measured, where, by which versions, and two commands

    Nothing is measured.
    """
    from shadowbench.studies.repro import write_repro

    folder, made = write_repro(row, of, output)
    if not quiet:
        console.print_line(f"{folder}: to measure the row again and compare, in this folder")
        for command in made.commands:
            console.print_line(f"  {command}")
