"""What a study's bias sweeps found: acne against contact as the bias grows, and the best of it beside the default."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import pandas as pd

from shadowbench.errors import InputError
from shadowbench.strict import short
from shadowbench.studies.crossing import BiasSweep
from shadowbench.studies.tables import SummaryRow

_ALSO, _TIMES = "; ", " × "  # no spec has either in it


@dataclass(frozen=True)
class Curve:
    """A swept spec at a map size in a scene: factors of its bias, rising, and the row of each.

    `best` is the factor at which (1 − IoU) · (1 − SSIM) is least.
    """

    home: str
    map_size: int | None
    rows: tuple[tuple[float, SummaryRow], ...]
    best: float


SweepPoint = tuple[str, float]
"""The spec whose bias was multiplied, as tables write it, and by what."""

Places = Mapping[tuple[str, int | None], tuple[SweepPoint, ...]]
"""By spec, as tables write it, and map size, None for any: its places in the sweeps, one a sweep, its own first."""


def places(sweeps: Sequence[BiasSweep]) -> Places:
    """Where each spec of a study's sweeps stands; in several sweeps where their biases meet."""
    found: dict[tuple[str, int | None], dict[str, float]] = {}
    for sweep in sweeps:
        for factor, spec in sweep.swept:
            key = spec.sizeless_text, spec.map_size if "size" in spec.named else None
            _add(found.setdefault(key, {}), sweep.home.sizeless_text, factor)
    return {key: _own_first(homes) for key, homes in found.items()}


def curves(rows: Sequence[SummaryRow], found: Places) -> list[Curve]:
    """The curves of a scene's table, a map size after the other; what did not hold is left out."""
    held = [row for row in rows if row.cells and _error(row) is not None]
    points: dict[tuple[str, int | None], list[tuple[float, SummaryRow]]] = {}
    for row in held:
        for home, factor in _at(found, row.spec, row.map_size):
            points.setdefault((home, row.map_size), []).append((factor, row))
    homes = list(dict.fromkeys(home for several in found.values() for home, _ in several))
    made = []
    for home, size in sorted(points, key=lambda key: (homes.index(key[0]), key[1] or 0)):
        at_size = sorted(points[home, size], key=lambda point: point[0])
        best = min(at_size, key=lambda point: _error(point[1]) or 0.0)[0]
        made.append(Curve(home, size, tuple(at_size), best))
    return made


def with_factors(frame: pd.DataFrame, found: Places) -> pd.DataFrame:
    """Lines of `table.csv`, of swept specs with `bias_of`, whose bias was multiplied, and `bias_factor`.

    A spec that stands in several sweeps has its own there, of factor 1, or else the first; `bias_also`, a column where
    there is one, holds the others: `shadow-map × 2; …`.
    """
    if not found:
        return frame
    at = [_at(found, spec, None if pd.isna(size) else int(size)) for spec, size in _lines(frame)]
    columns = {
        "bias_of": [places[0][0] if places else None for places in at],
        "bias_factor": [places[0][1] if places else None for places in at],
    }
    if any(len(places) > 1 for places in at):
        columns["bias_also"] = [
            _ALSO.join(f"{home}{_TIMES}{factor!r}" for home, factor in places[1:]) or None for places in at
        ]
    return frame.join(pd.DataFrame(columns, index=frame.index))


def places_of(table: Path) -> Places:
    """What a table of such lines says; nothing of one without sweeps, or where there is none."""
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
            (str(spec), None if pd.isna(size) else int(size)): ((str(home), float(factor)), *_others(others))
            for (spec, size), home, factor, others in zip(
                _lines(swept), swept["bias_of"], swept["bias_factor"], also, strict=True
            )
        }
    except (ValueError, KeyError, OverflowError) as error:
        raise InputError(f"{table}: found no sweep in it ({short(error)}); allowed: what a command wrote") from None


def _lines(frame: pd.DataFrame) -> list[tuple[str, float | None]]:
    sizes = frame["map_size"] if "map_size" in frame else [None] * len(frame)
    return list(zip(frame["spec"], sizes, strict=True))


def _others(text: object) -> tuple[SweepPoint, ...]:
    parts = [part.rsplit(_TIMES, 1) for part in text.split(_ALSO)] if isinstance(text, str) else []
    return tuple((home, float(factor)) for home, factor in parts)


def _at(found: Places, spec: str, size: int | None) -> tuple[SweepPoint, ...]:
    homes: dict[str, float] = {}
    for key in dict.fromkeys([(spec, size), (spec, None)]):
        for home, factor in found.get(key, ()):
            _add(homes, home, factor)
    return _own_first(homes)


def _add(homes: dict[str, float], home: str, factor: float) -> None:
    """One factor a sweep: a bias of 0 is the same times anything."""
    if factor == 1 or home not in homes:
        homes[home] = factor


def _own_first(homes: Mapping[str, float]) -> tuple[SweepPoint, ...]:
    return tuple(sorted(homes.items(), key=lambda place: place[1] != 1))


def _error(row: SummaryRow) -> float | None:
    iou, ssim = row.values["iou"], row.values["ssim"]
    return None if iou is None or ssim is None else math.sqrt((1 - iou.median) * (1 - ssim.median))
