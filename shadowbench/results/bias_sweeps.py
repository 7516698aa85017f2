"""Positions of specs in bias sweeps, which tables keep in the columns `bias_of` and `bias_factor`."""

from collections.abc import Iterable, Mapping
from pathlib import Path

import pandas as pd

from shadowbench.errors import InputError
from shadowbench.strict import short

_ALSO, _TIMES = "; ", " × "  # no spec has either in it


SweepPoint = tuple[str, float]
"""The spec whose bias was multiplied, as written in tables, and the factor."""

SweepPositions = Mapping[tuple[str, int | None], tuple[SweepPoint, ...]]
"""Positions of a spec in bias sweeps, one per sweep, its own sweep first; by spec, as written in tables, and map size,
None for any."""


def positions_in_sweeps(points: Iterable[tuple[tuple[str, int | None], SweepPoint]]) -> SweepPositions:
    """Position of each spec in sweeps; in several if multiplied biases coincide. points: of specs and map sizes."""
    found: dict[tuple[str, int | None], dict[str, float]] = {}
    for key, (base, factor) in points:
        _add(found.setdefault(key, {}), base, factor)
    return {key: _own_first(bases) for key, bases in found.items()}


def add_factor_columns(frame: pd.DataFrame, found: SweepPositions) -> pd.DataFrame:
    """Add the columns `bias_of` (the spec whose bias was multiplied) and `bias_factor` to a frame of `table.csv`.

    A spec in several sweeps has that of factor 1, else the first, in these columns; the others are in `bias_also`, a
    column that is present only if needed: `shadow-map × 2; …`.
    """
    if not found:
        return frame
    positions = [positions_of(found, spec, None if pd.isna(size) else int(size)) for spec, size in _lines(frame)]
    columns = {
        "bias_of": [points[0][0] if points else None for points in positions],
        "bias_factor": [points[0][1] if points else None for points in positions],
    }
    if any(len(points) > 1 for points in positions):
        columns["bias_also"] = [
            _ALSO.join(f"{base}{_TIMES}{factor!r}" for base, factor in points[1:]) or None for points in positions
        ]
    return frame.join(pd.DataFrame(columns, index=frame.index))


def read_sweep_positions(table: Path) -> SweepPositions:
    """Read positions in bias sweeps from a `table.csv`; empty without sweeps or without a table. Raises InputError."""
    if not table.is_file():
        return {}
    names = ("spec", "map_size", "bias_of", "bias_factor", "bias_also")
    try:
        frame = pd.read_csv(table, usecols=lambda name: name in names, dtype={"spec": str, "bias_of": str})
        if "bias_of" not in frame:
            return {}
        swept = frame[frame["bias_of"].notna()]
        also = swept["bias_also"] if "bias_also" in swept else pd.Series(float("nan"), index=swept.index)
        return {
            (str(spec), None if pd.isna(size) else int(size)): ((str(base), float(factor)), *_others(others))
            for (spec, size), base, factor, others in zip(
                _lines(swept), swept["bias_of"], swept["bias_factor"], also, strict=True
            )
        }
    except OSError as error:
        raise InputError(f"{table}: cannot be read ({error.strerror})") from None
    except (ValueError, KeyError, OverflowError) as error:
        raise InputError(f"{table}: found no sweep in it ({short(error)}); allowed: what a command wrote") from None


def _lines(frame: pd.DataFrame) -> list[tuple[str, float | None]]:
    sizes = frame["map_size"] if "map_size" in frame else [None] * len(frame)
    return list(zip(frame["spec"], sizes, strict=True))


def _others(text: object) -> tuple[SweepPoint, ...]:
    parts = [part.rsplit(_TIMES, 1) for part in text.split(_ALSO)] if isinstance(text, str) else []
    return tuple((base, float(factor)) for base, factor in parts)


def positions_of(found: SweepPositions, spec: str, size: int | None) -> tuple[SweepPoint, ...]:
    """Positions of a spec at one map size, its own sweep first."""
    bases: dict[str, float] = {}
    for key in dict.fromkeys([(spec, size), (spec, None)]):
        for base, factor in found.get(key, ()):
            _add(bases, base, factor)
    return _own_first(bases)


def _add(bases: dict[str, float], base: str, factor: float) -> None:
    """Keep one factor per sweep, preferably 1: several factors of a bias of 0 give the same spec."""
    if factor == 1 or base not in bases:
        bases[base] = factor


def _own_first(bases: Mapping[str, float]) -> tuple[SweepPoint, ...]:
    return tuple(sorted(bases.items(), key=lambda point: point[1] != 1))
