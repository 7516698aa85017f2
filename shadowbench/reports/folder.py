"""Folders as they are read: rows, what `run.json` says of them, and where the pictures are."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import pandas as pd

from shadowbench.errors import InputError
from shadowbench.studies.baseline import identity
from shadowbench.studies.rows import SCHEMA, Record, row_of
from shadowbench.studies.runner import Result
from shadowbench.studies.sweeps import Places, places_of
from shadowbench.studies.tables import cells_frame

_ALLOWED = "a folder that `shadowbench run` or `shadowbench stress` wrote"
_PLACE = ("axis", "axis_value", "light_kind", "home_spec")  # of a row on an axis


@dataclass(frozen=True, eq=False)
class Folder:
    """What somebody measured into a folder. `label` names it in a report; `about` is its `run.json`, empty without one.

    `rows` holds the score of each cell once: as `table.csv` names it, else as it was measured last; `older` counts the
    other records of the same cells.
    """

    label: str
    folder: Path
    about: Mapping[str, Any]
    rows: tuple[Record, ...]
    older: int

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
    of the rows that `table.csv` lacks, those of engines aside: cells of earlier commands.
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


def _read(folder: Path, label: str) -> Run | Sweep:
    if not folder.is_dir():
        raise InputError(f"{folder}: no such folder; allowed: {_ALLOWED}")
    file = folder / "rows.jsonl"
    records = _records(file)
    scores = [record for record in records if record["kind"] == "score"]
    count = len({record["key"] for record in scores})
    if not scores:
        raise InputError(f"{file}: found no cell; allowed: rows of a run or a sweep that measured something")
    kinds = {"axis" in record for record in scores}
    if len(kinds) > 1:
        raise InputError(f"{file}: found cells of `run` and of `stress`; allowed: those of one, in a folder of its own")
    about = _about(folder / "run.json")
    keys = _last_keys(folder)
    if kinds == {True}:
        points = {
            tuple(record[name] for name in _PLACE): record for record in scores if keys is None or record["key"] in keys
        }
        return Sweep(label, folder, about, tuple(points.values()), count - len(points))
    times = [record for record in records if record["kind"] == "time"]
    machine = about.get("machine_key") or (times[-1].get("machine") if times else None)
    last_times: dict[str, Record] = {}
    times_before: dict[str, Record] = {}
    for record in times:
        if record.get("machine") == machine:
            if record["key"] in last_times:
                times_before[record["key"]] = last_times[record["key"]]
            last_times[record["key"]] = record
    # A run that finds its rows measured appends none, so that the last of a cell in the file may be another study's.
    last = {} if keys is None else {identity(record): record for record in scores if record["key"] in keys}
    cells = {identity(record): record for record in scores} | last
    earlier = {} if keys is None else {cell: row for cell, row in cells.items() if cell not in last}
    return Run(
        label=label,
        folder=folder,
        about=about,
        rows=tuple(cells.values()),
        older=count - len(cells),
        times=last_times,
        times_before=times_before,
        foreign=sum(record.get("machine") != machine for record in times),
        earlier=frozenset(row["key"] for row in earlier.values() if "content" not in row),
    )


def _last_keys(folder: Path) -> set[str] | None:
    """The keys of the cells that were measured, or found measured, last: those of `table.csv`; None without one.

    Beside them, what was measured before the last change of a default would stand for something that is no more.
    """
    table = folder / "table.csv"
    if not table.is_file():
        return None
    try:
        return set(pd.read_csv(table, usecols=["key"], dtype=str)["key"])
    except ValueError:
        raise InputError(f"{table}: found no column `key`; allowed: the table of the last command, or none") from None


def _records(file: Path) -> list[Record]:
    """Every whole line; the last may have been cut short by the end of a run."""
    if not file.exists():
        raise InputError(f"{file.parent}: found no rows.jsonl; allowed: {_ALLOWED}")
    lines = file.read_bytes().split(b"\n")[:-1]
    return [_record(file, number, line) for number, line in enumerate(lines, start=1)]


def _record(file: Path, number: int, line: bytes) -> Record:
    record = row_of(line)
    if record is None or not (record["kind"] == "time" or _needed(record) <= record.keys()):
        raise InputError(f"{file} line {number}: found something else; allowed: a row of schema {SCHEMA}")
    return record


def _needed(record: Record) -> set[str]:
    return {"scene", "spec", "status"} | (set(_PLACE) if "axis" in record else set())


def _about(file: Path) -> Mapping[str, Any]:
    if not file.exists():
        return {}
    try:
        about = json.loads(file.read_bytes())
    except ValueError:
        about = None
    if not isinstance(about, dict):
        raise InputError(f"{file}: found something else; allowed: the JSON object of the command that made the folder")
    return about
