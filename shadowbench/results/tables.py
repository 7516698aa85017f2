"""Rows as a frame with the columns of `table.csv`, a line per cell; the positions in bias sweeps that it keeps."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import chain
from pathlib import Path
from typing import Any

import pandas as pd

from shadowbench.errors import InputError
from shadowbench.files import replace_file
from shadowbench.measure.columns import COSTS, IDENTITY, MORE, MORE_TIMES, SOMETIMES, TIMES
from shadowbench.measure.rows import Record, Result
from shadowbench.plugin.params import parameters_of
from shadowbench.scores.metrics import METRICS
from shadowbench.strict import short

_WHOLE = ["map_size", "n", "gpu_bytes", "receivers", "undecided", "surface_mismatch", "penumbra"]
_CHUNK = 5000  # lines of a table in memory at a time


def cells_frame(results: Sequence[Result]) -> pd.DataFrame:
    """One line per cell, with the columns of `table.csv`: the promised ones in their order, then additional ones."""
    return _frame(results, _columns(results))


def cells_frames(results: Sequence[Result], lines: int = _CHUNK) -> Iterator[pd.DataFrame]:
    """The lines of `cells_frame` in frames of so many lines, all with the same columns, for tables of any length."""
    columns = _columns(results)
    for start in range(0, max(len(results), 1), lines):
        yield _frame(results[start : start + lines], columns, start)


def over_phases(cells: pd.DataFrame) -> pd.DataFrame:
    """The cells with `phases`, their number, in place of `phase`: numbers are medians, texts those that all share.

    A status is that of the first phase that is not `ok`, and its numbers are those of the others.
    """
    same = ["scene", "view", "light", "spec", "full_spec", "map_size", "view_size", "coordinates", "renderer"]
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
    found = grouped.agg(rules).reset_index()
    found["phases"] = grouped["phase"].nunique().to_numpy()
    return found[["phases" if name == "phase" else name for name in cells]]


def write_table(file: Path, frames: Iterable[pd.DataFrame]) -> None:
    """Write frames of the same columns as one CSV, one after the other; missing values are empty fields."""
    with replace_file(file) as temporary, temporary.open("w", encoding="utf-8", newline="") as stream:
        for index, frame in enumerate(frames):
            stream.write(csv_of(frame, header=index == 0))


def csv_of(frame: pd.DataFrame, header: bool = True) -> str:
    """A frame as CSV. Texts that a spreadsheet would calculate, as formulas, have an apostrophe before them."""
    texts = frame.select_dtypes(["object", "string"]).columns
    safe = frame.assign(**{name: frame[name].map(_no_formula) for name in texts})
    return str(safe.rename(columns=_no_formula).to_csv(index=False, header=header))


def _no_formula(value: Any) -> Any:
    return f"'{value}" if isinstance(value, str) and value.startswith(("=", "+", "-", "@")) else value


def _columns(results: Sequence[Result]) -> list[str]:
    def named(text: str, found: Iterable[Iterable[str]]) -> list[str]:
        return sorted(map(text.format, set(chain.from_iterable(found))))

    passes = named("pass_{}_ms", ((result.time or {}).get("passes", ()) for result in results))
    work = named("work_{}", (result.score.get("work", ()) for result in results))
    facts = named("fact_{}", (result.score.get("facts", ()) for result in results))
    promised = [*IDENTITY, *METRICS, *TIMES, *passes, *work, *COSTS]
    some = dict.fromkeys(chain.from_iterable(_sometimes(result.score) for result in results))
    return [*promised, *MORE, *MORE_TIMES, *facts, *(name for name in SOMETIMES if name in some)]


def _frame(results: Sequence[Result], columns: list[str], start: int = 0) -> pd.DataFrame:
    lines = range(start, start + len(results))
    frame = pd.DataFrame([_cell(result) for result in results], index=lines, columns=columns)
    whole = [*_WHOLE, *(name for name in columns if name.startswith("work_"))]
    # astype leaves a block for each column, and pandas warns of a hundred when one is added; a copy joins them.
    return frame.astype(dict.fromkeys(whole, "Int64")).copy()


def _cell(result: Result) -> dict[str, Any]:
    score, timed = result.score, result.time or {}
    row = {name: score.get(name) for name in [*IDENTITY, *MORE, "gpu_bytes", "command"]}
    row |= {"status": result.status, "assumptions": "; ".join(score.get("assumptions", ())) or None}
    row |= score.get("metrics", {})
    row |= {f"work_{name}": count for name, count in score.get("work", {}).items()}
    row |= {f"fact_{name}": value for name, value in score.get("facts", {}).items()}
    row |= {name: timed.get(name) for name in [*TIMES, "prepare_ms", "machine", *MORE_TIMES]}
    row |= _sometimes(score)
    return row | {f"pass_{name}_ms": value["ms"] for name, value in timed.get("passes", {}).items()}


def _sometimes(score: Record) -> dict[str, Any]:
    """The columns of rows of engines, and of published rows."""
    row = {"commit": score["commit"]} if "commit" in score else {}
    if engine := score.get("engine"):
        sides = parameters_of(score["full_spec"])[1].get("sides")
        row |= {"engine_version": engine.get("version"), "box": engine.get("box"), "sides": sides}
    return row


SweepPoint = tuple[str, float]
"""The spec whose bias was multiplied, as written in tables, and the factor."""

SweepPositions = Mapping[tuple[str, int | None], tuple[SweepPoint, ...]]
"""Positions of a spec in bias sweeps, one per sweep, its own sweep first; by spec, as written in tables, and map size,
None for any."""

_ALSO, _TIMES = "; ", " × "  # no spec has either in it


def positions_in_sweeps(points: Iterable[tuple[tuple[str, int | None], SweepPoint]]) -> SweepPositions:
    """Position of each spec in sweeps; in several if multiplied biases coincide. points: of specs and map sizes."""
    found: dict[tuple[str, int | None], list[SweepPoint]] = {}
    for key, point in points:
        found.setdefault(key, []).append(point)
    return {key: _own_first(several) for key, several in found.items()}


def positions_of(found: SweepPositions, spec: str, size: int | None) -> tuple[SweepPoint, ...]:
    """Positions of a spec at one map size, its own sweep first."""
    return _own_first([*found.get((spec, size), ()), *found.get((spec, None), ())])


def _own_first(points: Sequence[SweepPoint]) -> tuple[SweepPoint, ...]:
    """One point per sweep, those of factor 1 first: several factors of a bias of 0 give the same spec."""
    found: dict[str, float] = {}
    for base, factor in sorted(points, key=lambda point: point[1] != 1):
        found.setdefault(base, factor)
    return tuple(found.items())


def add_factor_columns(frame: pd.DataFrame, found: SweepPositions) -> pd.DataFrame:
    """Add the columns `bias_of` (the spec whose bias was multiplied) and `bias_factor` to a frame of `table.csv`.

    A spec in several sweeps has that of factor 1, else the first, in these columns; the others are in `bias_also`, a
    column that is present only if needed: `shadow-map × 2; …`.
    """
    if not found:
        return frame
    positions = [positions_of(found, spec, size) for spec, size in _specs(frame)]
    first = [points[0] if points else (None, None) for points in positions]
    columns = pd.DataFrame(first, index=frame.index, columns=["bias_of", "bias_factor"])
    if any(len(points) > 1 for points in positions):
        columns["bias_also"] = [
            _ALSO.join(f"{base}{_TIMES}{factor!r}" for base, factor in points[1:]) or None for points in positions
        ]
    return frame.join(columns)


def read_sweep_positions(table: Path) -> SweepPositions:
    """Read positions in bias sweeps from a `table.csv`; empty without sweeps or without a table. Raises InputError."""
    if not table.is_file():
        return {}
    names = ["spec", "map_size", "bias_of", "bias_factor", "bias_also"]
    try:
        frame = pd.read_csv(table, usecols=lambda name: name in names, dtype={"spec": str, "bias_of": str})
        if "bias_of" not in frame:
            return {}
        swept = frame.dropna(subset=["spec", "bias_of", "bias_factor"]).reindex(columns=names)
        also = [text.split(_ALSO) if isinstance(text, str) else [] for text in swept["bias_also"]]
        others = [[part.rsplit(_TIMES, 1) for part in parts] for parts in also]
        return {
            key: ((str(base), float(factor)), *((other, float(times)) for other, times in more))
            for key, base, factor, more in zip(
                _specs(swept), swept["bias_of"], swept["bias_factor"], others, strict=True
            )
        }
    except OSError as error:
        raise InputError(f"{table}: cannot be read ({error.strerror})") from None
    except (ValueError, KeyError, OverflowError) as error:
        raise InputError(f"{table}: found no sweep in it ({short(error)}); allowed: what a command wrote") from None


def _specs(frame: pd.DataFrame) -> list[tuple[str, int | None]]:
    sizes = [None if pd.isna(size) else int(size) for size in frame["map_size"]]
    return list(zip(frame["spec"], sizes, strict=True))
