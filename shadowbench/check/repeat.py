"""Whether two runs of one study say the same: the ranking by time, and the work."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np
from scipy.stats import kendalltau

from shadowbench.errors import InputError
from shadowbench.measure.rows import Record, Result
from shadowbench.studies.folder import identity, read_runs

APART = 1.05  # cells whose times differ by less need not keep their order
ENOUGH = 0.95


@dataclass(frozen=True)
class Ranking:
    """The cells of one block by time, in two runs.

    `sharp` counts the pairs that differ by more than 5% in both runs, with ratios whose IQRs do not overlap in either;
    `swapped` those of them that the runs order differently. `tau_of_all` is Kendall's τ-b over all pairs, None where
    there is none.
    """

    block: str
    cells: int
    sharp: int
    swapped: int
    tau_of_all: float | None

    @property
    def tau(self) -> float | None:
        """Kendall's τ over the sharp pairs (1938): those that agree less those that do not, over all of them."""
        return 1 - 2 * self.swapped / self.sharp if self.sharp else None


@dataclass(frozen=True)
class Repeat:
    """Two runs compared: a ranking for each block, and whether the `counted` cells of both did the same work."""

    rankings: tuple[Ranking, ...]
    counted: int
    unequal: tuple[str, ...]

    @property
    def holds(self) -> bool:
        """Whether the runs agree: every ranking, and all work."""
        return self.ranked_alike and not self.unequal

    @property
    def ranked_alike(self) -> bool:
        """Whether every ranking has a τ of 0.95 or more."""
        return all(one.tau is None or one.tau >= ENOUGH for one in self.rankings)


def compare_folders(first: Path, second: Path | None = None) -> Repeat:
    """Two folders of one study on one machine, or the last two times of each cell of one folder.

    Raises InputError for folders that cannot be compared, or in which no two cells differ sharply.
    """
    one, other = _timed_twice(first) if second is None else _two_folders(first, second)
    found = compare_runs(one, other)
    if not any(ranking.sharp for ranking in found.rankings):
        raise InputError(
            f"{second or first}: no two cells differ sharply in both runs; "
            "allowed: runs of one study on one machine, timed"
        )
    return found


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


def compare_runs(first: Sequence[Result], second: Sequence[Result]) -> Repeat:
    """Two runs of one study on one machine; cells that did not hold in both are left out."""
    then = {identity(one.score): one for one in first if one.status == "ok"}
    pairs = [(then[identity(one.score)], one) for one in second if one.status == "ok" and identity(one.score) in then]
    blocks: dict[tuple[Any, ...], list[tuple[Record, Record]]] = {}
    for one, other in pairs:
        if one.time and other.time and _comparable(one.time, other.time):
            block = tuple(one.score[name] for name in ("scene", "view", "light", "phase", "view_size", "coordinates"))
            blocks.setdefault(block, []).append((one.time, other.time))
    unequal = [_named(one.score) for one, other in pairs if _work(one.score) != _work(other.score)]
    rankings = [_ranking(" ".join(map(str, block[:4])), times) for block, times in blocks.items()]
    return Repeat(tuple(rankings), len(pairs), tuple(unequal))


def _comparable(one: Record, other: Record) -> bool:
    """Whether both have a ratio to the same reference, by one clock of one machine."""
    same = all(one.get(name) == other.get(name) for name in ("machine", "clock", "reference"))
    return same and all(side.get("ratio_quartiles") is not None for side in (one, other))


def _ranking(block: str, times: Sequence[tuple[Record, Record]]) -> Ranking:
    sharp = swapped = 0
    for one, other in combinations(times, 2):
        orders = [_order(one[run], other[run]) for run in range(2)]
        if 0 not in orders:
            sharp += 1
            swapped += orders[0] != orders[1]
    ratios = np.array([[side["ratio"] for side in pair] for pair in times]).T
    tau = kendalltau(*ratios).statistic if len(times) > 1 else np.nan
    return Ranking(block, len(times), sharp, swapped, None if np.isnan(tau) else float(tau))


def _order(one: Record, other: Record) -> int:
    """1 or −1 for which of two times of a run is larger, 0 where that is not sharp."""
    quicker, slower = sorted((one, other), key=lambda time: float(time["ratio"]))
    near = slower["ratio"] <= APART * quicker["ratio"]
    if near or slower["ratio_quartiles"][0] <= quicker["ratio_quartiles"][1]:
        return 0
    return 1 if slower is one else -1


def _work(score: Record) -> tuple[Mapping[str, int], int]:
    return score["work"], score["gpu_bytes"]


def _named(score: Record) -> str:
    size = f" {score['map_size']}" if score["map_size"] else ""
    return f"{score['scene']} {score['spec']}{size}"
