"""Rows as a frame with the columns of `table.csv`, one line per cell."""

from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any

import pandas as pd

from shadowbench.files import replace_file
from shadowbench.measure.flips import FLIPS
from shadowbench.measure.rows import Result
from shadowbench.measure.time_rows import REDRAWN
from shadowbench.scores.metrics import METRICS

_IDENTITY = ["scene", "view", "light", "phase", "technique", "spec", "map_size", "view_size", "renderer", "status"]
TIMES = ["frame_ms", "frame_iqr_ms", "added_ms", "ratio", "n", "clock"]
TOTALS = ["wall_ms", *(f"{moved}_ms" for moved in REDRAWN)]
_MORE_TIMES = ["ratio_iqr", "reference", "reference_ms", *TOTALS]  # additional columns, after the promised ones
TRUTH_ERRORS = ["truth_error", "truth_error_pen"]
_SOFT = [*TRUTH_ERRORS, "penumbra", "width_share", "width_bias"]  # of a soft truth
_MORE = [
    "receivers",
    "undecided",
    "surface_mismatch",
    "coordinates",
    "full_spec",
    "mask_sha256",
    "assumptions",
    "key",
]
_FLIPS = [FLIPS.name, "step"]
_CHUNK = 5000  # lines of a table in memory at a time


def cells_frame(results: Sequence[Result]) -> pd.DataFrame:
    """One line per cell, with the columns of `table.csv`: the promised ones in their order, then additional ones."""
    return _frame(results, _columns(results))


def cells_frames(results: Sequence[Result], lines: int = _CHUNK) -> Iterator[pd.DataFrame]:
    """The lines of `cells_frame` in frames of so many lines, all with the same columns, for tables of any length."""
    columns = _columns(results)
    for start in range(0, max(len(results), 1), lines):
        yield _frame(results[start : start + lines], columns, start)


def write_table(file: Path, frames: Iterable[pd.DataFrame]) -> None:
    """Write frames of the same columns as one CSV, one after the other; missing values are empty fields."""
    with replace_file(file) as temporary, temporary.open("w", encoding="utf-8", newline="") as stream:
        for index, frame in enumerate(frames):
            frame.to_csv(stream, index=False, header=index == 0)


def _columns(results: Sequence[Result]) -> list[str]:
    passes = {name for result in results for name in (result.time or {}).get("passes", ())}
    work = {name for result in results for name in result.score.get("work", ())}
    facts = {name for result in results for name in result.score.get("facts", ())}
    times = [*TIMES, *sorted(f"pass_{name}_ms" for name in passes)]
    promised = [*_IDENTITY, *METRICS, *times, *_prefixed("work", work), "gpu_bytes", "prepare_ms", "machine", "command"]
    return [*promised, *_MORE, *_FLIPS, *_SOFT, *_MORE_TIMES, *_prefixed("fact", facts)]


def _prefixed(prefix: str, names: Iterable[str]) -> list[str]:
    return sorted(f"{prefix}_{name}" for name in names)


def _frame(results: Sequence[Result], columns: list[str], start: int = 0) -> pd.DataFrame:
    lines = range(start, start + len(results))
    frame = pd.DataFrame([_cell(result) for result in results], index=lines, columns=columns)
    work = [name for name in columns if name.startswith("work_")]
    whole = [*work, "map_size", "n", "gpu_bytes", "receivers", "undecided", "surface_mismatch", "penumbra"]
    # astype leaves a block for each column, and pandas warns of a hundred when one is added; a copy joins them.
    return frame.astype(dict.fromkeys(whole, "Int64")).copy()


def _cell(result: Result) -> dict[str, Any]:
    score, timed = result.score, result.time or {}
    row = {name: score.get(name) for name in [*_IDENTITY, *_MORE, *_FLIPS, *_SOFT, "gpu_bytes", "command"]} | {
        "status": result.status
    }
    row |= score.get("metrics", {})
    row["assumptions"] = "; ".join(score.get("assumptions", ())) or None
    row |= {f"work_{name}": count for name, count in score.get("work", {}).items()}
    row |= {f"fact_{name}": value for name, value in score.get("facts", {}).items()}
    row |= {key: timed.get(key) for key in [*TIMES, "prepare_ms", "machine", *_MORE_TIMES]}
    return row | {f"pass_{name}_ms": value["ms"] for name, value in timed.get("passes", {}).items()}
