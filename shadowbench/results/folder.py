"""Reading run folders: rows, `run.json`, and the cells of the last command."""

import re
from collections.abc import Mapping, Sequence, Set
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from itertools import chain
from operator import itemgetter
from pathlib import Path
from typing import Any

import pandas as pd

from shadowbench.errors import InputError, printable
from shadowbench.measure.rows import Record, Result, RunFile, read_run_file, stream_rows
from shadowbench.results.tables import (
    SweepPositions,
    add_factor_columns,
    cells_frame,
    cells_frames,
    read_sweep_positions,
    write_table,
)
from shadowbench.scores.metrics import is_soft

IDENTITY = ("scene", "view", "light", "phase", "map_size", "view_size", "coordinates")  # and the full spec
_identity_of = itemgetter(*IDENTITY)
_view_of = itemgetter("scene", "view", "light", "view_size")
_range_of = itemgetter("home_spec", "axis", "light_kind")
_READ_HERE = {
    *("kind", "key", "status", "spec", "full_spec", *IDENTITY, "metrics", "renderer", "machine", "content"),
    *("axis", "axis_value", "light_kind", "home_spec"),
}
_COMMA = re.compile(r",(?![^()]*\))")  # outside parentheses


def identity(record: Record) -> tuple[Any, ...]:
    """Identity of a cell, by which cells of two runs are matched whatever the code and its order of parameters."""
    return _parts_of(record["full_spec"]), *_identity_of(record)


def view_name(record: Record) -> str:
    """Name of a row's view, as `View.name`, with which the files of its truth begin."""
    return ".".join(map(str, _view_of(record)))


@lru_cache(1 << 12)
def _parts_of(full_spec: str) -> tuple[str, ...]:
    name, _, parameters = full_spec.partition(":")
    return name, *sorted(_COMMA.split(parameters))


@dataclass(frozen=True, eq=False)
class Folder:
    """A folder of measurements.

    label: its name in a report; about: its `run.json`, empty if missing; rows: one score record per cell, that of the
    last command, else the one named in `table.csv`, else the last one measured; older: number of other records of the
    same cells; cut_off: whether the last line of `rows.jsonl` is incomplete, as a killed writer leaves it.
    """

    label: str
    folder: Path
    about: RunFile
    rows: tuple[Record, ...]
    older: int
    cut_off: bool

    @property
    def renderer(self) -> str:
        """OpenGL renderer from `run.json`, else from the last row; `unknown` if neither has it."""
        named = [row["renderer"] for row in self.rows if row.get("renderer")]
        return str(self.about.get("device", {}).get("renderer") or (named[-1] if named else "unknown"))

    @property
    def software(self) -> bool | None:
        """Whether the renderer is a software renderer; None if unknown."""
        software = self.about.get("device", {}).get("software")
        return None if software is None else bool(software)

    @property
    def assumptions(self) -> list[str]:
        """Assumptions from `run.json` and from all rows, without duplicates."""
        of_rows = [note for row in self.rows for note in row.get("assumptions", ())]
        return list(dict.fromkeys([*self.about.get("assumptions", ()), *of_rows]))


@dataclass(frozen=True, eq=False)
class Run(Folder):
    """Results of `shadowbench run`.

    times: last time record of each key on one machine, the one in `run.json`, else the one of the last time record;
    previous_times: the time record before it, of keys timed more than once on that machine; foreign: number of time
    records from other machines; earlier: keys of rows that do not belong to the last command, except rows that `score`
    added for other renderers.
    """

    times: Mapping[str, Record]
    previous_times: Mapping[str, Record]
    foreign: int
    earlier: frozenset[str]

    @cached_property
    def results(self) -> tuple[Result, ...]:
        """Each cell with its time record, if any."""
        return tuple(Result(row, self.times.get(row["key"])) for row in self.rows)

    @cached_property
    def frame(self) -> pd.DataFrame:
        """One line per cell, with the columns of `table.csv`, in the order of `results`."""
        return cells_frame(self.results)

    @cached_property
    def last(self) -> "Run":
        """The cells of the last command alone, in its order."""
        order = {key: at for at, key in enumerate(self.about.get("keys", ()))}
        rows = [row for row in self.rows if row["key"] not in self.earlier]
        rows.sort(key=lambda row: order.get(row["key"], len(order)))
        return replace(self, rows=tuple(rows), earlier=frozenset())

    @cached_property
    def sweep_positions(self) -> SweepPositions:
        """Positions of specs in bias sweeps, from `table.csv`."""
        return read_sweep_positions(self.folder / "table.csv")


@dataclass(frozen=True, eq=False)
class Sweep(Folder):
    """Results of `shadowbench stress`: each row is measured at one value of one axis."""


def read_folders(folders: Sequence[Path], fields: Set[str] | None = None) -> tuple[list[Run], list[Sweep]]:
    """Read folders of `run` and of `stress`, labelled by name, or by path if names collide. Raises InputError.

    fields: those to keep of each row, besides the ones that this module reads; None for all.
    """
    paths = list(dict.fromkeys(folder.resolve() for folder in folders))
    names = [path.name for path in paths]
    # Escaped, since a path need not be valid UTF-8.
    labels = [printable(str(path) if names.count(path.name) > 1 else path.name) for path in paths]
    found = [_read(path, label, fields) for path, label in zip(paths, labels, strict=True)]
    return [one for one in found if isinstance(one, Run)], [one for one in found if isinstance(one, Sweep)]


def read_runs(folders: Sequence[Path], fields: Set[str] | None = None) -> list[Run]:
    """Read folders of `run` as `read_folders` does. Raises InputError for any other folder."""
    runs, sweeps = read_folders(folders, fields)
    if sweeps:
        raise InputError(f"{sweeps[0].folder}: found a sweep of `shadowbench stress`; allowed: a folder of a run")
    return runs


def write_cells(folder: Path, positions: SweepPositions) -> Run:
    """Write `table.csv`, a line per cell of the folder, which is returned; positions: of specs in new bias sweeps."""
    run = _read(folder, folder.name, None, empty=True)
    assert isinstance(run, Run)
    names = ["spec", "map_size"]
    cells = pd.DataFrame([[row[name] for name in names] for row in run.rows], columns=names)
    factors = add_factor_columns(cells, {**run.sweep_positions, **positions}).drop(columns=names)
    write_table(folder / "table.csv", (frame.join(factors) for frame in cells_frames(run.results)))
    return run


def rows_file(folder: Path) -> Path:
    """The `rows.jsonl` of a folder. Raises InputError if there is none."""
    file = folder / "rows.jsonl"
    if not file.exists():
        what = "found no rows.jsonl" if folder.is_dir() else "no such folder"
        raise InputError(f"{folder}: {what}; allowed: a folder that `shadowbench run` or `shadowbench stress` wrote")
    return file


def _rows(folder: Path, fields: Set[str] | None, empty: bool) -> tuple[list[Record], list[Record], bool]:
    """Scores and times of a folder, and whether the last line is incomplete. Raises InputError."""
    file = rows_file(folder)
    wanted = None if fields is None else _READ_HERE | fields
    found: dict[str, list[Record]] = {"score": [], "time": []}
    complete = 0
    for row, end in stream_rows(file):
        complete = end
        kept = row if wanted is None else {name: value for name, value in row.items() if name in wanted}
        found[row["kind"]].append(kept)
    if not found["score"] and not empty:
        raise InputError(f"{file}: found no cell; allowed: rows of a run or a sweep that measured something")
    if len({"axis" in row for row in found["score"]}) > 1:
        raise InputError(f"{file}: found cells of `run` and of `stress`; allowed: those of one, in a folder of its own")
    return found["score"], found["time"], complete < file.stat().st_size


def _read(folder: Path, label: str, fields: Set[str] | None, empty: bool = False) -> Run | Sweep:
    """A folder; empty: whether it may be without cells. Raises InputError."""
    scores, times, cut_off = _rows(folder, fields, empty)
    about, table = read_run_file(folder / "run.json"), _table_keys(folder / "table.csv")
    keys = set(about["keys"]) if "keys" in about else table
    last, count = _with_keys(scores, keys), len({row["key"] for row in scores})
    if scores and "axis" in scores[0]:
        points = _points(scores if table is None else _with_keys(scores, table), last)
        return Sweep(label, folder, about, tuple(points), count - len(points), cut_off)
    machine = about.get("machine_key") or (times[-1].get("machine") if times else None)
    ours = [row for row in times if row.get("machine") == machine]
    latest: dict[str, Record] = {}
    previous: dict[str, Record] = {}
    for row in ours:
        if row["key"] in latest:
            previous[row["key"]] = latest[row["key"]]
        latest[row["key"]] = row
    cells = _with_renderers(_cells(scores, table, keys), last)
    of_studies = {row["key"] for row in cells if keys is not None and "content" not in row}
    earlier = frozenset(of_studies - {row["key"] for row in last})
    older, foreign = count - len(cells), len(times) - len(ours)
    return Run(label, folder, about, tuple(cells), older, cut_off, latest, previous, foreign, earlier)


def _table_keys(table: Path) -> set[str] | None:
    """Keys of a `table.csv`; None if there is no table."""
    if not table.is_file():
        return None
    try:
        return set(pd.read_csv(table, usecols=["key"], dtype=str)["key"])
    except ValueError:
        raise InputError(f"{table}: found no column `key`; allowed: the table that a command wrote, or none") from None


def _with_keys(scores: Sequence[Record], keys: Set[str] | None) -> list[Record]:
    """The rows with these keys, except those of other renderers, which `score` appends outside of any study."""
    return [row for row in scores if keys is not None and row["key"] in keys and "content" not in row]


def _cells(scores: Sequence[Record], table: Set[str] | None, keys: Set[str] | None) -> list[Record]:
    """The last row of every cell, in the order of their first rows; those with the keys of a table count as later.

    A cell measured before gets no new row, so its last row in the file may be of another version of the scene.

    After a change of a default, one spelling of a spec has two identities; only the last of these counts. So do, of a
    view that was measured with hard and with soft shadows (`--sun`), only those of the last row.
    """
    identified = {id(row): identity(row) for row in scores}
    cells: dict[tuple[Any, ...], Record] = {}
    spelled: dict[tuple[Any, ...], tuple[Any, ...]] = {}
    soft: dict[tuple[Any, ...], bool] = {}
    for row in chain(scores, _with_keys(scores, table), _with_keys(scores, keys)):
        cell = identified[id(row)]
        cells[cell] = row
        spelled[row["spec"], *cell[1:]] = cell
        if row["status"] == "ok":
            soft[_view_of(row)] = is_soft(row["metrics"])
    return [
        row
        for cell, row in cells.items()
        if spelled[row["spec"], *cell[1:]] == cell
        and (row["status"] != "ok" or soft[_view_of(row)] == is_soft(row["metrics"]))
    ]


def _with_renderers(cells: Sequence[Record], last: Sequence[Record]) -> list[Record]:
    """The cells, with all rows of one that the last command measured on several renderers."""
    found: dict[tuple[Any, ...], dict[str, Record]] = {}
    for row in last:
        found.setdefault(identity(row), {})[row["renderer"]] = row
    return [row for cell in cells for row in found.get(identity(cell), {cell["renderer"]: cell}).values()]


def _points(shown: Sequence[Record], last: Sequence[Record]) -> list[Record]:
    """Points of the last command, and earlier ones of other ranges: each range comes from a single command."""
    swept = set(map(_range_of, last))
    rows = [*(row for row in shown if _range_of(row) not in swept), *last]
    return list({(*_range_of(row), row["axis_value"]): row for row in rows}.values())
