"""`repeat`: two runs of one study, in two folders or in one, and whether they say the same."""

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
            help="The same study, run again into a folder of its own; without it, the last two times of each cell in "
            "the first folder, as `run --time-again` leaves them.",
        ),
    ] = None,
    json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Compare two runs of one study on one machine: the order of cells by time, and their work.

    Measures nothing. Exit code 1 when a ranking's Kendall tau is below 0.95, over the pairs that are apart in both
    runs, or work differs.
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
        console.say(f"  work differs: {name}")
    if quiet:
        return
    apart = f"{100 * (LEAST_RATIO - 1):.0f}%"
    console.say(
        f"τ: Kendall's, over the pairs that differ by more than {apart} in both runs and whose ratios' IQRs do not "
        f"overlap; {LEAST_TAU} or more in every line {'holds' if found.rankings_agree else 'does not hold'}"
    )
    console.out().print(f"work: {found.counted - len(found.unequal)} of {found.counted} cells did exactly the same")
