"""Repeatability: whether two runs of a study agree in the ranking by time and in work counts."""

from collections.abc import Sequence
from dataclasses import dataclass
from operator import itemgetter
from pathlib import Path
from typing import Any

import numpy as np
from scipy.stats import kendalltau

from shadowbench.errors import InputError
from shadowbench.measure.rows import Record, Result
from shadowbench.results.baseline import comparable
from shadowbench.results.folder import identity, read_runs

LEAST_RATIO = 1.05  # least ratio of two times whose order must be repeated
LEAST_TAU = 0.95  # least Kendall's τ
_block_of = itemgetter("scene", "view", "light", "phase", "view_size", "coordinates")
_work_of = itemgetter("work", "gpu_bytes")


@dataclass(frozen=True)
class Ranking:
    """Agreement of two runs on the order of one block's cells by time.

    sharp: number of pairs that differ by more than 5% and with disjoint IQRs in both runs; swapped: number of those
    that the runs order differently; tau_of_all: Kendall's τ-b over all pairs, None if undefined.
    """

    block: str
    cells: int
    sharp: int
    swapped: int
    tau_of_all: float | None

    @property
    def tau(self) -> float | None:
        """Kendall's τ (1938) over the sharp pairs: concordant minus discordant ones, over all."""
        return 1 - 2 * self.swapped / self.sharp if self.sharp else None


@dataclass(frozen=True)
class RepeatResult:
    """Comparison of two runs: rankings of all blocks, number of cells in both, and cells with unequal work counts."""

    rankings: tuple[Ranking, ...]
    counted: int
    unequal: tuple[str, ...]

    @property
    def agrees(self) -> bool:
        """Whether all rankings and all work counts agree."""
        return self.rankings_agree and not self.unequal

    @property
    def rankings_agree(self) -> bool:
        """Whether every ranking has a τ of at least 0.95."""
        return all(ranking.tau is None or ranking.tau >= LEAST_TAU for ranking in self.rankings)


def compare_folders(first: Path, second: Path | None = None) -> RepeatResult:
    """Compare two folders of one study, or the last two times of each cell of one folder. Raises InputError."""
    found = compare_runs(*(_timed_twice(first) if second is None else _two_folders(first, second)))
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
    studies = [run.about.get("study", {}) for run in (one, other)]
    for field in ("sun", "no_ground", "time", "clip"):
        given = [study.get(field, False) for study in studies if study]
        if len(set(given)) > 1:
            option = f"--{field.replace('_', '-')}"
            how = f"without {option}" if given[1] is False else f"with {option}"
            how += f" {given[1]}" if not isinstance(given[1], bool) else ""
            raise InputError(f"{second}: was measured {how}; allowed: as {first} was, whose shadows are others")
    return one.results, other.results


def _timed_twice(folder: Path) -> tuple[Sequence[Result], Sequence[Result]]:
    (run,) = read_runs([folder])
    if not run.previous_times:
        raise InputError(f"{folder}: no cell was timed twice; `shadowbench run … --time-again` times cells once more")
    before = [Result(result.score, run.previous_times.get(result.score["key"])) for result in run.results]
    return before, run.results


def compare_runs(first: Sequence[Result], second: Sequence[Result]) -> RepeatResult:
    """Compare two runs of one study on one machine; cells that did not succeed in both are left out."""
    one, other = ({identity(cell.score): cell for cell in side if cell.status == "ok"} for side in (first, second))
    pairs = [(one[key], cell) for key, cell in other.items() if key in one]
    blocks: dict[tuple[Any, ...], list[tuple[Record, Record]]] = {}
    for before, after in pairs:
        times = before.time, after.time
        if comparable(before, after) and all(time and time.get("ratio_quartiles") for time in times):
            blocks.setdefault(_block_of(before.score), []).append(times)  # type: ignore[arg-type]
    unequal = [_label(before.score) for before, after in pairs if _work_of(before.score) != _work_of(after.score)]
    rankings = [_ranking(" ".join(map(str, block[:4])), times) for block, times in blocks.items()]
    return RepeatResult(tuple(rankings), len(pairs), tuple(unequal))


def _ranking(block: str, times: Sequence[tuple[Record, Record]]) -> Ranking:
    ratios = np.array([[side["ratio"] for side in pair] for pair in times]).T  # (2, N)
    low, high = np.array([[side["ratio_quartiles"] for side in pair] for pair in times]).T
    one, other = np.triu_indices(len(times), 1)
    slower, quicker = (
        (ratios[:, a] > LEAST_RATIO * ratios[:, b]) & (low[:, a] > high[:, b]) for a, b in ((one, other), (other, one))
    )
    sharp = (slower | quicker).all(axis=0)
    swapped = sharp & (slower[0] != slower[1])
    tau = kendalltau(*ratios).statistic if len(times) > 1 else np.nan
    counts = int(np.count_nonzero(sharp)), int(np.count_nonzero(swapped))
    return Ranking(block, len(times), *counts, None if np.isnan(tau) else float(tau))


def _label(score: Record) -> str:
    return " ".join(str(score[name]) for name in ("scene", "spec", "map_size") if score[name])
