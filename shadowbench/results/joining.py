"""Which row of several folders represents each cell, and where equal keys have unequal scores."""

import hashlib
import math
from collections import Counter
from collections.abc import Mapping, Sequence, Set
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

from shadowbench.errors import InputError
from shadowbench.measure.flips import row_metrics
from shadowbench.measure.row_store import stream_rows
from shadowbench.measure.rows import Record

_ROUNDING = 1e-9  # relative, or of 1 near 0; sums of floats differ with the width of a processor's vectors


class Scores(NamedTuple):
    """What must be equal of a cell wherever it was measured; status: `ok`, `unsupported` or `failed`."""

    status: str
    mask: str | None
    metrics: Mapping[str, float | None]

    @property
    def failed(self) -> bool:
        """Whether the cell has to be measured again."""
        return self.status == "failed"


class Place(NamedTuple):
    """A row: index of its folder, and its line in `rows.jsonl`, from 1."""

    folder: int
    line: int


@dataclass(frozen=True)
class Conflict:
    """A cell with unequal scores; what: a metric, `mask` or `status`; values: of the two folders."""

    cell: str
    what: str
    folders: tuple[Path, Path]
    values: tuple[object, object]


@dataclass(frozen=True, eq=False)
class Joined:
    """The rows to keep of several folders of one command.

    cells: the row of each key; masks: hashes of the masks of those that have one; times: lines of time rows, without
    duplicates, by folder; machines: number of time rows of each machine; cut_off: folders whose last line is
    incomplete; conflicts: cells with unequal scores, of which nothing may be kept.
    """

    sweep: bool
    cells: Mapping[str, Place]
    masks: Mapping[str, str]
    times: Sequence[Set[int]]
    machines: Mapping[str | None, int]
    cut_off: tuple[Path, ...]
    conflicts: tuple[Conflict, ...]

    def lines(self, folder: int) -> set[int]:
        """Lines to keep of a folder's `rows.jsonl`."""
        return {place.line for place in self.cells.values() if place.folder == folder} | set(self.times[folder])


@dataclass(eq=False)
class _Join:
    """State while folders are read: their kind and renderers, as of the first one, and what is kept so far."""

    sweep: bool | None = None
    renderers: frozenset[str] = frozenset()
    cells: dict[str, tuple[Scores, Place]] = field(default_factory=dict)
    seen_times: set[bytes] = field(default_factory=set)
    machines: Counter[str | None] = field(default_factory=Counter)
    conflicts: list[Conflict] = field(default_factory=list)


def join(folders: Sequence[Path]) -> Joined:
    """Choose a row for each cell of folders of `run`, or of `stress`; memory grows with cells, not with their rows.

    A folder's last row of a key counts. Of several folders, that of the first counts, unless it failed. Raises
    InputError for a folder without cells, for one of the other command, and for one of another renderer.
    """
    state, times, cut_off = _Join(), [], []
    for index, folder in enumerate(folders):
        file = folder / "rows.jsonl"
        if not file.exists():
            what = "found no rows.jsonl" if folder.is_dir() else "no such folder"
            raise InputError(f"{folder}: {what}; allowed: a folder that `shadowbench run` or `stress` wrote")
        here: dict[str, tuple[Record, int]] = {}
        kept_times: set[int] = set()
        complete = 0
        for line, (row, end) in enumerate(stream_rows(file), start=1):
            complete = end
            if row["kind"] == "score":
                here[row["key"]] = {name: row[name] for name in _NEEDED if name in row}, line
            elif (digest := _digest(row)) not in state.seen_times:
                state.seen_times.add(digest)
                state.machines[row.get("machine")] += 1
                kept_times.add(line)
        if complete < file.stat().st_size:
            cut_off.append(folder)
        _check_kind(state, folders[0], folder, [row for row, _ in here.values()])
        for key, (row, line) in here.items():
            _add(state, folders, key, row, Place(index, line))
        times.append(kept_times)
    places = {key: place for key, (_, place) in state.cells.items()}
    masks = {key: scores.mask for key, (scores, _) in state.cells.items() if scores.mask is not None}
    return Joined(bool(state.sweep), places, masks, times, state.machines, tuple(cut_off), tuple(state.conflicts))


_NEEDED = (
    *("key", "scene", "view", "light", "phase", "spec", "map_size", "renderer", "status"),
    *("metrics", "flips", "mask_sha256", "content", "axis"),
)


def _check_kind(state: _Join, first: Path, folder: Path, rows: Sequence[Record]) -> None:
    """Raises InputError unless all rows are of the command and the renderers of the first folder."""
    kinds = {"axis" in row for row in rows}
    if len(kinds) != 1:
        found = "cells of `run` and of `stress`" if kinds else "no cell"
        raise InputError(f"{folder}: found {found}; allowed: cells of one command")
    (sweep,) = kinds
    renderers = frozenset(str(row["renderer"]) for row in rows if "content" not in row)
    if state.sweep is None:
        state.sweep, state.renderers = sweep, renderers
    if sweep != state.sweep:
        names = ("run", "stress")
        raise InputError(
            f"{folder}: found cells of `{names[sweep]}`; allowed: of `{names[state.sweep]}`, as in {first}"
        )
    state.renderers = state.renderers or renderers  # a folder of `score` has none
    if renderers and renderers != state.renderers:
        here, there = (" and ".join(sorted(found)) for found in (renderers, state.renderers))
        raise InputError(
            f"{folder}: found cells of {here}; allowed: of {there}, as in {first}; `shadowbench report` compares "
            "renderers, each in a folder of its own"
        )


def _add(state: _Join, folders: Sequence[Path], key: str, row: Record, place: Place) -> None:
    scores = Scores(row["status"].partition(":")[0], row.get("mask_sha256"), row_metrics(row))
    if key not in state.cells or state.cells[key][0].failed:
        state.cells[key] = scores, place
    elif not scores.failed:
        known, where = state.cells[key]
        both = folders[where.folder], folders[place.folder]
        state.conflicts += [
            Conflict(_name(row), what, both, values) for what, values in _differences(known, scores).items()
        ]


def _differences(known: Scores, other: Scores) -> dict[str, tuple[object, object]]:
    if known.status != other.status:
        return {"status": (known.status, other.status)}
    found: dict[str, tuple[object, object]] = {}
    if known.mask != other.mask:
        found["mask"] = known.mask, other.mask
    for name in {**known.metrics, **other.metrics}:
        one, two = known.metrics.get(name), other.metrics.get(name)
        if one != two and (
            one is None or two is None or not math.isclose(one, two, rel_tol=_ROUNDING, abs_tol=_ROUNDING)
        ):
            found[name] = one, two
    return found


def _name(row: Record) -> str:
    size = f" at {row['map_size']}" if row["map_size"] else ""
    phase = f" phase {row['phase']}" if row["phase"] else ""
    return f"{row['scene']} {row['view']} {row['light']} {row['spec']}{size}{phase}"


def _digest(row: Record) -> bytes:
    return hashlib.blake2b(repr(sorted(row.items())).encode(errors="replace"), digest_size=16).digest()
