"""Folders as they are read: rows, what `run.json` says of them, and where the pictures are."""

import re
from collections.abc import Mapping, Sequence, Set
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import pandas as pd

from shadowbench.errors import InputError
from shadowbench.measure.rows import Record, Result, RunFile, read_rows, read_run_file
from shadowbench.studies.sweeps import Places, places_of, with_factors
from shadowbench.studies.tables import cells_frame, write_table

IDENTITY = ("scene", "view", "light", "phase", "map_size", "view_size", "coordinates")  # and the full spec
_COMMA = re.compile(r",(?![^()]*\))")  # outside parentheses
_ALLOWED = "a folder that `shadowbench run` or `shadowbench stress` wrote"


def identity(record: Record) -> tuple[Any, ...]:
    """What names a cell whatever its sources; two runs' cells are the same if these are.

    The order of a spec's parameters, that of the code, is no part of it.
    """
    name, _, parameters = str(record.get("full_spec")).partition(":")
    spec = name, *sorted(_COMMA.split(parameters))
    return spec, *(record.get(name) for name in IDENTITY)


@dataclass(frozen=True, eq=False)
class Folder:
    """What somebody measured into a folder. `label` names it in a report; `about` is its `run.json`, empty without one.

    `rows` holds the score of each cell once: as the last command found it, else as `table.csv` names it, else as it was
    measured last. `older` counts the other records of the same cells; `cut_off`: whether the last line of `rows.jsonl`
    is incomplete, as a killed writer leaves it.
    """

    label: str
    folder: Path
    about: RunFile
    rows: tuple[Record, ...]
    older: int
    cut_off: bool

    @property
    def renderer(self) -> str:
        """Who drew it: as `run.json` says, else the row that was measured last; `unknown` where neither does."""
        named = [row["renderer"] for row in self.rows if row.get("renderer")]
        return str(self.about.get("device", {}).get("renderer") or (named[-1] if named else "unknown"))

    @property
    def software(self) -> bool | None:
        """Whether a processor drew it in place of a GPU; None where the folder does not say."""
        software = self.about.get("device", {}).get("software")
        return None if software is None else bool(software)

    @property
    def assumptions(self) -> list[str]:
        """Everything that was assumed, of the whole and of every row, each once."""
        of_rows = [note for row in self.rows for note in row.get("assumptions", ())]
        return list(dict.fromkeys([*self.about.get("assumptions", ()), *of_rows]))


@dataclass(frozen=True, eq=False)
class Run(Folder):
    """A folder of `run`. `times`: the last of one machine, by key; `foreign` counts the others'.

    `times_before`: of the cells that this machine timed several times, the time before the last.
    The machine is the one that `run.json` names, or that of the last time where it names none. `earlier` has the keys
    of the rows that the last command did not measure or find, those of engines aside.
    """

    times: Mapping[str, Record]
    times_before: Mapping[str, Record]
    foreign: int
    earlier: frozenset[str]

    @cached_property
    def results(self) -> tuple[Result, ...]:
        """Each cell with its time."""
        return tuple(Result(row, self.times.get(row["key"])) for row in self.rows)

    @cached_property
    def frame(self) -> pd.DataFrame:
        """A line a cell, with the columns of `table.csv`, in the order of `results`."""
        return cells_frame(self.results)

    @cached_property
    def swept(self) -> Places:
        """The specs whose bias is another's multiplied, as `table.csv` says."""
        return places_of(self.folder / "table.csv")


@dataclass(frozen=True, eq=False)
class Sweep(Folder):
    """A folder of `stress`: its rows stand on axes."""


def read_folders(folders: Sequence[Path]) -> tuple[list[Run], list[Sweep]]:
    """The folders, labelled by name, or by path where names are the same; InputError for what is of neither kind."""
    paths = list(dict.fromkeys(folder.resolve() for folder in folders))
    names = [path.name for path in paths]
    labels = [str(path) if names.count(path.name) > 1 else path.name for path in paths]
    found = [_read(path, label) for path, label in zip(paths, labels, strict=True)]
    return [one for one in found if isinstance(one, Run)], [one for one in found if isinstance(one, Sweep)]


def read_runs(folders: Sequence[Path]) -> list[Run]:
    """Folders of `run` alone, labelled likewise; InputError for any other."""
    runs, sweeps = read_folders(folders)
    if sweeps:
        raise InputError(f"{sweeps[0].folder}: found a sweep of `shadowbench stress`; allowed: a folder of a run")
    return runs


def write_cells(folder: Path, results: Sequence[Result], swept: Places) -> Run:
    """Write `table.csv`, a line for each cell of the folder, and return the folder.

    results: those of the command that has just written `run.json`; of other cells the newest row stands there. `swept`:
    the command's bias sweeps.
    """
    (run,) = read_runs([folder])
    live = {one.score["key"]: one for one in results}  # which also say what could not be timed
    frame = cells_frame([live.get(one.score["key"], one) for one in run.results])
    write_table(folder / "table.csv", with_factors(frame, {**run.swept, **swept}))
    return run


def _read(folder: Path, label: str) -> Run | Sweep:
    if not folder.is_dir():
        raise InputError(f"{folder}: no such folder; allowed: {_ALLOWED}")
    file = folder / "rows.jsonl"
    if not file.exists():
        raise InputError(f"{folder}: found no rows.jsonl; allowed: {_ALLOWED}")
    rows, end = read_rows(file)
    cut_off = end < file.stat().st_size
    scores = [row for row in rows if row["kind"] == "score"]
    count = len({row["key"] for row in scores})
    if not scores:
        raise InputError(f"{file}: found no cell; allowed: rows of a run or a sweep that measured something")
    kinds = {"axis" in row for row in scores}
    if len(kinds) > 1:
        raise InputError(f"{file}: found cells of `run` and of `stress`; allowed: those of one, in a folder of its own")
    about = read_run_file(folder / "run.json")
    table = _table_keys(folder / "table.csv")
    keys = set(about["keys"]) if "keys" in about else table  # the table of an older version was the last command's
    shown, last = _named(scores, table), _named(scores, keys)
    if kinds == {True}:
        points = _points(scores if table is None else shown, last)
        return Sweep(label, folder, about, tuple(points), count - len(points), cut_off)
    times = [row for row in rows if row["kind"] == "time"]
    machine = about.get("machine_key") or (times[-1].get("machine") if times else None)
    last_times: dict[str, Record] = {}
    times_before: dict[str, Record] = {}
    for row in times:
        if row.get("machine") == machine:
            if row["key"] in last_times:
                times_before[row["key"]] = last_times[row["key"]]
            last_times[row["key"]] = row
    # A command that finds its rows measured appends none, so that the last of a cell in the file may be another text's.
    cells = _cells([*scores, *shown, *last])
    ours = {row["key"] for row in last}
    earlier = [row["key"] for row in cells if keys is not None and row["key"] not in ours and "content" not in row]
    return Run(
        label=label,
        folder=folder,
        about=about,
        rows=tuple(cells),
        older=count - len(cells),
        cut_off=cut_off,
        times=last_times,
        times_before=times_before,
        foreign=sum(row.get("machine") != machine for row in times),
        earlier=frozenset(earlier),
    )


def _table_keys(table: Path) -> set[str] | None:
    """The keys of a `table.csv`; None where there is none."""
    if not table.is_file():
        return None
    try:
        return set(pd.read_csv(table, usecols=["key"], dtype=str)["key"])
    except ValueError:
        raise InputError(f"{table}: found no column `key`; allowed: the table that a command wrote, or none") from None


def _named(scores: Sequence[Record], keys: Set[str] | None) -> list[Record]:
    """The rows with these keys, but none of another renderer: `score` runs no study, and its last row counts."""
    return [row for row in scores if keys is not None and row["key"] in keys and "content" not in row]


def _cells(rows: Sequence[Record]) -> list[Record]:
    """The last row of every cell, in the order of the first.

    Where a default has changed, a spec has two identities and one spelling: the last of those counts too.
    """
    spelled = {_spelled(row): identity(row) for row in rows}
    return [row for key, row in {identity(row): row for row in rows}.items() if spelled[_spelled(row)] == key]


def _spelled(row: Record) -> tuple[Any, ...]:
    return row["spec"], *identity(row)[1:]


def _points(shown: Sequence[Record], last: Sequence[Record]) -> list[Record]:
    """The last command's points, and of those shown before the ones on other lines: a range is of one command."""
    swept = {_line(row) for row in last}
    rows = [*(row for row in shown if _line(row) not in swept), *last]
    return list({(*_line(row), row["axis_value"]): row for row in rows}.values())


def _line(row: Record) -> tuple[Any, ...]:
    return row["home_spec"], row["axis"], row["light_kind"]
