"""`repeat`: two runs of one study, in two folders or in one, and whether they say the same."""

import dataclasses
from collections.abc import Sequence
from pathlib import Path

from rich.markup import escape
from rich.table import Table

from shadowbench.check.repeat import APART, ENOUGH, Repeat, compare_runs
from shadowbench.commands.console import number, out, print_json, print_table
from shadowbench.errors import InputError
from shadowbench.measure.rows import Result
from shadowbench.reports.folder import read_runs


def repeat_command(first: Path, second: Path | None, as_json: bool, quiet: bool) -> int:
    """Print how well the runs agree, and unless `quiet` what that means; 1 where they do not.

    Without `second`, the last two times of each cell of `first` are compared.
    """
    one, other = _timed_twice(first) if second is None else _two_folders(first, second)
    found = compare_runs(one, other)
    holds = found.ranked_alike and not found.unequal
    if not any(ranking.sharp for ranking in found.rankings):
        raise InputError(
            f"{second or first}: no two cells differ sharply in both runs; "
            "allowed: runs of one study on one machine, timed"
        )
    if as_json:
        rankings = [dataclasses.asdict(ranking) | {"tau": ranking.tau} for ranking in found.rankings]
        print_json({**dataclasses.asdict(found), "rankings": rankings, "holds": holds})
    else:
        _print(found, quiet)
    return 0 if holds else 1


def _two_folders(first: Path, second: Path) -> tuple[Sequence[Result], Sequence[Result]]:
    if first.resolve() == second.resolve():
        raise InputError(f"{second}: is named twice; named once, the last two times of its cells are compared")
    one, other = read_runs([first, second])
    if one.renderer != other.renderer:
        raise InputError(f"{second}: found rows of {other.renderer}; allowed: of {one.renderer}, as in {first}")
    return one.results, other.results


def _timed_twice(folder: Path) -> tuple[Sequence[Result], Sequence[Result]]:
    (run,) = read_runs([folder])
    if not run.times_before:
        raise InputError(f"{folder}: no cell was timed twice; `shadowbench run … --time-again` times cells once more")
    before = [Result(result.score, run.times_before.get(result.score["key"])) for result in run.results]
    return before, run.results


def _print(found: Repeat, quiet: bool) -> None:
    table = Table(box=None, pad_edge=False)
    for heading in ("scene, view, light, phase", "cells", "pairs", "swapped", "τ", "τ of all pairs"):
        table.add_column(heading, justify="left" if heading.startswith("scene") else "right", no_wrap=True)
    for one in found.rankings:
        taus = ("–" if tau is None else number(tau) for tau in (one.tau, one.tau_of_all))
        table.add_row(escape(one.block), str(one.cells), str(one.sharp), str(one.swapped), *taus)
    print_table(table)
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
