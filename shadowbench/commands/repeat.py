"""`repeat`: compare two runs of one study, in two folders or in one."""

import dataclasses
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from shadowbench.commands import console
from shadowbench.commands.options import Json, Quiet

if TYPE_CHECKING:
    from shadowbench.check.repeat import RepeatResult

app = typer.Typer()


@app.command(
    epilog="\b\nFor example\n"
    "  shadowbench repeat results/monday results/tuesday\n"
    "  shadowbench run -s demo --time-again && shadowbench repeat results/latest"
)
def repeat(
    first: Annotated[Path, typer.Argument(metavar="DIR", help="A run folder.")],
    second: Annotated[
        Path | None,
        typer.Argument(
            metavar="[DIR]",
            help="The same study, run again into another folder; without it, the last two times of each cell in the "
            "first folder are compared (see `run --time-again`).",
        ),
    ] = None,
    json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Check whether two runs agree on ranking and work.

    Compares the ranking of cells by time, and their work counters, between two runs on one machine; measures nothing.
    Exit code 1 if Kendall's tau of any ranking is below 0.95, or if work differs.

    \b
    Columns
      cells           cells with a time in both runs
      pairs           pairs of cells whose times differ significantly in both runs
      swapped         pairs that the two runs order differently
      τ               Kendall's tau over these pairs; 1 is the same order
      τ of all pairs  Kendall's tau over all pairs, noise included
    """
    from shadowbench.check.repeat import compare_folders

    found = compare_folders(first, second)
    if json:
        rankings = [dataclasses.asdict(ranking) | {"tau": ranking.tau} for ranking in found.rankings]
        console.print_json({**dataclasses.asdict(found), "rankings": rankings, "holds": found.agrees})
    else:
        _print(found, quiet)
    raise typer.Exit(0 if found.agrees else 1)


def _print(found: "RepeatResult", quiet: bool) -> None:
    from shadowbench.check.repeat import LEAST_RATIO, LEAST_TAU

    block, numbers = "scene, view, light, phase", ("cells", "pairs", "swapped", "τ", "τ of all pairs")
    rows = []
    for one in found.rankings:
        taus = (console.number(tau) for tau in (one.tau, one.tau_of_all))
        rows.append((one.block, str(one.cells), str(one.sharp), str(one.swapped), *taus))
    console.print_table("", (block, *numbers), rows, numbers=numbers, whole=(block,))
    for name in found.unequal:
        console.print_line(f"  work differs: {name}")
    if quiet:
        return
    apart = f"{100 * (LEAST_RATIO - 1):.0f}%"
    console.print_line(
        f"τ: Kendall's tau over the pairs whose times differ by more than {apart}, with interquartile ranges that do "
        f"not overlap, in both runs; {'at least' if found.rankings_agree else 'not everywhere at least'} {LEAST_TAU}"
    )
    console.out().print(f"work: exactly the same in {found.counted - len(found.unequal)} of {found.counted} cells")
