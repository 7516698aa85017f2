"""`repeat`: two runs of one study, and whether they say the same."""

import dataclasses
from pathlib import Path

from rich.markup import escape
from rich.table import Table

from shadowbench.commands.console import number, out, print_json
from shadowbench.errors import InputError
from shadowbench.reports.folder import read_runs
from shadowbench.studies.repeat import APART, ENOUGH, Repeat, compare_runs


def repeat_command(first: Path, second: Path, as_json: bool, quiet: bool) -> int:
    """Print how well the runs agree, and unless `quiet` what that means; 1 where they do not."""
    if first.resolve() == second.resolve():
        raise InputError(f"{second}: is named twice; allowed: two runs of one study, in folders of their own")
    one, other = read_runs([first, second])
    if one.renderer != other.renderer:
        raise InputError(f"{second}: found rows of {other.renderer}; allowed: of {one.renderer}, as in {first}")
    found = compare_runs(one.results, other.results)
    holds = found.ranked_alike and not found.unequal
    if not any(ranking.sharp for ranking in found.rankings):
        raise InputError(
            f"{second}: no two cells differ sharply in both runs; allowed: runs of one study on one machine, timed"
        )
    if as_json:
        rankings = [dataclasses.asdict(ranking) | {"tau": ranking.tau} for ranking in found.rankings]
        print_json({**dataclasses.asdict(found), "rankings": rankings, "holds": holds})
    else:
        _print(found, quiet)
    return 0 if holds else 1


def _print(found: Repeat, quiet: bool) -> None:
    table = Table(box=None, pad_edge=False)
    for heading in ("scene, view, light, phase", "cells", "pairs", "swapped", "τ", "τ of all pairs"):
        table.add_column(heading, justify="left" if heading.startswith("scene") else "right", no_wrap=True)
    for one in found.rankings:
        taus = ("–" if tau is None else number(tau) for tau in (one.tau, one.tau_of_all))
        table.add_row(escape(one.block), str(one.cells), str(one.sharp), str(one.swapped), *taus)
    out.print(table)
    for name in found.unequal:
        out.print(f"  work differs: {name}", markup=False, soft_wrap=True)
    if quiet:
        return
    apart = f"{100 * (APART - 1):.0f}%"
    out.print(
        f"τ: Kendall's, over the pairs that differ by more than {apart} in both runs and whose ratios' IQRs do not "
        f"overlap; {ENOUGH} or more in every line {'holds' if found.ranked_alike else 'does not hold'}",
        soft_wrap=True,
    )
    out.print(f"work: {found.counted - len(found.unequal)} of {found.counted} cells did exactly the same")
