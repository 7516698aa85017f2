"""A run folder as one frame: the rows that count, a line each, with the columns of `table.csv`."""

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from itertools import chain
from operator import itemgetter
from pathlib import Path
from typing import Any

import pandas as pd

from shadowbench.errors import InputError, printable
from shadowbench.files import replace_file
from shadowbench.measure.columns import COSTS, MORE, MORE_TIMES, SOMETIMES, TIMES
from shadowbench.measure.columns import IDENTITY as FIRST
from shadowbench.measure.rows import Record, Result, read_rows, read_run_file, size_of
from shadowbench.plugin.params import parameters_of
from shadowbench.scores.metrics import METRICS, is_soft
from shadowbench.strict import short

IDENTITY = (
    "scene",
    "view",
    "light",
    "phase",
    "map_size",
    "view_size",
    "view_width",
    "coordinates",
    "sequence",
    "frames",
)  # and the full spec
_place_of = itemgetter(*IDENTITY)
_view_of = itemgetter("scene", "view", "light", "view_size", "view_width")
_range_of = itemgetter("home_spec", "axis", "light_kind")
_COMMA = re.compile(r",(?![^()]*\))")  # outside parentheses
_WHOLE = ["map_size", "n", "gpu_bytes", "receivers", "undecided", "surface_mismatch", "penumbra", "frames", "pop_frame"]


def identity(record: Record) -> tuple[Any, ...]:
    """Identity of a cell, by which cells of two runs are matched whatever the code and its order of parameters."""
    return _parts_of(record["full_spec"]), *_place_of(record)


def view_name(record: Record) -> str:
    """Name of a row's view, as `View.name`, with which the files of its truth begin."""
    return ".".join([*_view_of(record)[:3], str(size_of(record))])


@lru_cache(1 << 12)
def _parts_of(full_spec: str) -> tuple[str, ...]:
    name, _, parameters = full_spec.partition(":")
    return name, *sorted(_COMMA.split(parameters))


@dataclass(frozen=True, eq=False)
class Run:
    """A folder of measurements, of `shadowbench run` or `stress`.

    label: its name in a report; about: its `run.json`, empty if missing; rows: one score record per cell; times: the
    last time record of each key on the machine of `run.json`, else of the last time record; earlier: keys of rows
    that do not belong to the last command, except rows that `score` added for other renderers; older: number of other
    records of the same cells; foreign: number of time records from other machines; cut_off: whether the last line of
    `rows.jsonl` is incomplete, as a killed writer leaves it.
    """

    label: str
    folder: Path
    about: Record
    rows: tuple[Record, ...]
    times: Mapping[str, Record]
    earlier: frozenset[str]
    older: int
    foreign: int
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
        notes = chain(self.about.get("assumptions", ()), *(row.get("assumptions", ()) for row in self.rows))
        return list(dict.fromkeys(notes))

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


# Reading


def read_folders(folders: Sequence[Path]) -> tuple[list[Run], list[Run]]:
    """Read folders of `run` and of `stress`, labelled by name, or by path if names collide. Raises InputError."""
    paths = list(dict.fromkeys(folder.resolve() for folder in folders))
    names = [path.name for path in paths]
    # Escaped, since a path need not be valid UTF-8.
    labels = [printable(str(path) if names.count(path.name) > 1 else path.name) for path in paths]
    runs: list[Run] = []
    sweeps: list[Run] = []
    for path, label in zip(paths, labels, strict=True):
        run = _read(path, label)
        if not run.rows:
            raise InputError(f"{rows_file(path)}: found no cell; allowed: rows of a run or a sweep that measured one")
        (sweeps if "axis" in run.rows[0] else runs).append(run)
    return runs, sweeps


def read_runs(folders: Sequence[Path]) -> list[Run]:
    """Read folders of `run` as `read_folders` does. Raises InputError for any other folder."""
    runs, sweeps = read_folders(folders)
    if sweeps:
        raise InputError(f"{sweeps[0].folder}: found a sweep of `shadowbench stress`; allowed: a folder of a run")
    return runs


def rows_file(folder: Path) -> Path:
    """The `rows.jsonl` of a folder. Raises InputError if there is none."""
    file = folder / "rows.jsonl"
    if not file.exists():
        what = "found no rows.jsonl" if folder.is_dir() else "no such folder"
        raise InputError(f"{folder}: {what}; allowed: a folder that `shadowbench run` or `shadowbench stress` wrote")
    return file


def _read(folder: Path, label: str) -> Run:
    """A folder, which may be without cells. Raises InputError."""
    file = rows_file(folder)
    rows, complete = read_rows(file)
    scores, times = ([row for row in rows if row["kind"] == kind] for kind in ("score", "time"))
    if len({"axis" in row for row in scores}) > 1:
        raise InputError(f"{file}: found cells of `run` and of `stress`; allowed: those of one, in a folder of its own")
    about = read_run_file(folder / "run.json")
    keys = set(about.get("keys", ()))
    last = [row for row in scores if row["key"] in keys and "content" not in row]
    counted = points_that_count(scores, last) if scores and "axis" in scores[0] else rows_that_count(scores, last)
    earlier = {row["key"] for row in counted if "keys" in about and "content" not in row} - {row["key"] for row in last}
    machine = about.get("machine_key") or (times[-1].get("machine") if times else None)
    ours = {row["key"]: row for row in times if row.get("machine") == machine}
    return Run(
        label,
        folder,
        about,
        rows=tuple(counted),
        times=ours,
        earlier=frozenset(earlier),
        older=len({row["key"] for row in scores}) - len(counted),
        foreign=sum(row.get("machine") != machine for row in times),
        cut_off=complete < file.stat().st_size,
    )


def rows_that_count(scores: Sequence[Record], last: Sequence[Record]) -> list[Record]:
    """The row of every cell, by the last command or else the newest, in the order of their first rows.

    A cell measured before gets no new row, so that the last command's row may stand above a newer one, of another
    version of its scene. A row gives way to a later one of the same cell; of the same place and spec as written, which
    a changed default turned into another cell; and of the same view with hard shadows instead of soft ones.
    """
    cells: dict[tuple[Any, ...], Record] = {}
    written: dict[tuple[Any, ...], tuple[Any, ...]] = {}
    soft: dict[tuple[Any, ...], bool] = {}
    for row in chain(scores, last):
        cell = identity(row)
        cells[cell] = row
        written[row["spec"], *_place_of(row)] = cell
        if row["status"] == "ok":
            soft[_view_of(row)] = is_soft(row["metrics"])
    return [
        row
        for cell, row in cells.items()
        if written[row["spec"], *_place_of(row)] == cell
        and (row["status"] != "ok" or soft[_view_of(row)] == is_soft(row["metrics"]))
    ]


def points_that_count(scores: Sequence[Record], last: Sequence[Record]) -> list[Record]:
    """Points of the last command, and the newest of other ranges: the points of a range are of one command."""
    swept = set(map(_range_of, last))
    rows = [*(row for row in scores if _range_of(row) not in swept), *last]
    return list({(*_range_of(row), row["axis_value"]): row for row in rows}.values())


# The frame


def cells_frame(results: Sequence[Result]) -> pd.DataFrame:
    """One line per cell, with the columns of `table.csv`: the promised ones in their order, then additional ones."""

    def named(text: str, groups: Iterable[Iterable[str]]) -> list[str]:
        return sorted(map(text.format, set(chain.from_iterable(groups))))

    passes = named("pass_{}_ms", ((result.time or {}).get("passes", ()) for result in results))
    work = named("work_{}", (result.score.get("work", ()) for result in results))
    facts = named("fact_{}", (result.score.get("facts", ()) for result in results))
    cells = [_cell(result) for result in results]
    present = set(chain.from_iterable(cells))
    columns = [*FIRST, *METRICS, *TIMES, *passes, *work, *COSTS, *MORE, *MORE_TIMES, *facts]
    frame = pd.DataFrame(cells, columns=[*columns, *(name for name in SOMETIMES if name in present)])
    # astype leaves a block for each column, and pandas warns of a hundred when one is added; a copy joins them.
    return frame.astype(dict.fromkeys([*_WHOLE, *work], "Int64")).copy()


def _cell(result: Result) -> dict[str, Any]:
    score, timed = result.score, result.time or {}
    cell = {name: score.get(name) for name in [*FIRST, *MORE, "gpu_bytes", "command"]}
    cell |= {"status": result.status, "assumptions": "; ".join(score.get("assumptions", ())) or None}
    cell |= score.get("metrics", {})
    cell |= {f"work_{name}": count for name, count in score.get("work", {}).items()}
    cell |= {f"fact_{name}": value for name, value in score.get("facts", {}).items()}
    cell |= {name: timed.get(name) for name in [*TIMES, "prepare_ms", "machine", *MORE_TIMES]}
    cell |= {f"pass_{name}_ms": value["ms"] for name, value in timed.get("passes", {}).items()}
    cell |= {"commit": score["commit"]} if "commit" in score else {}
    if engine := score.get("engine"):
        sides = parameters_of(score["full_spec"])[1].get("sides")
        cell |= {"engine_version": engine.get("version"), "box": engine.get("box"), "sides": sides}
    return cell


def over_phases(cells: pd.DataFrame) -> pd.DataFrame:
    """The cells with `phases`, their number, in place of `phase`: numbers are medians, texts those that all share.

    A status is that of the first phase that is not `ok`, and its numbers are those of the others.
    """
    same = [*(name for name in IDENTITY if name != "phase"), "spec", "full_spec", "renderer"]
    grouped = cells.groupby(same, sort=False, dropna=False)
    numbers = {name for name in cells if pd.api.types.is_numeric_dtype(cells[name])} - {*same, "phase"}

    def shared(values: pd.Series) -> Any:
        return values.iloc[0] if values.nunique(dropna=False) == 1 else None

    def worst(statuses: pd.Series) -> Any:
        return next((status for status in statuses if status != "ok"), "ok")

    rules = {
        name: "median" if name in numbers else worst if name == "status" else shared
        for name in cells
        if name not in (*same, "phase")
    }
    merged = grouped.agg(rules).reset_index()
    merged["phases"] = grouped["phase"].nunique().to_numpy()
    return merged[["phases" if name == "phase" else name for name in cells]]


# Writing


def write_cells(folder: Path, sweeps: "BiasSweeps") -> Run:
    """Write `table.csv`, a line per cell of the folder, which is returned; sweeps: new ones."""
    run, table = _read(folder, folder.name), folder / "table.csv"
    write_table(table, add_factor_columns(run.frame, {**read_bias_sweeps(table), **sweeps}))
    return run


def write_table(file: Path, frame: pd.DataFrame) -> None:
    """Write a frame as CSV; missing values are empty fields."""
    with replace_file(file) as temporary:
        temporary.write_text(frame.to_csv(index=False), encoding="utf-8", newline="")


# Bias sweeps

BiasSweeps = Mapping[str, tuple[str, float]]
"""By spec, the spec whose bias was multiplied, and the factor; specs as written in tables."""


def add_factor_columns(frame: pd.DataFrame, sweeps: BiasSweeps) -> pd.DataFrame:
    """Add the columns `bias_of` (the spec whose bias was multiplied) and `bias_factor` to a frame of `table.csv`."""
    if not sweeps:
        return frame
    swept = [sweeps.get(spec, (None, None)) for spec in frame["spec"]]
    return frame.join(pd.DataFrame(swept, index=frame.index, columns=["bias_of", "bias_factor"]))


def read_bias_sweeps(table: Path) -> BiasSweeps:
    """Read bias sweeps from a `table.csv`; empty without any, or without a table. Raises InputError."""
    if not table.is_file():
        return {}
    try:
        frame = pd.read_csv(table)
        if "bias_of" not in frame:
            return {}
        swept = frame.dropna(subset=["bias_of"])
        return {
            str(spec): (str(home), float(factor))
            for spec, home, factor in zip(swept["spec"], swept["bias_of"], swept["bias_factor"], strict=True)
        }
    except (OSError, ValueError, KeyError) as error:
        raise InputError(f"{table}: found no sweep in it ({short(error)}); allowed: what a command wrote") from None
