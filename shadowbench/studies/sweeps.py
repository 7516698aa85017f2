"""What a study's bias sweeps found: acne against contact as the bias grows, and the best of it beside the default."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import pandas as pd

from shadowbench.studies.study import BiasSweep
from shadowbench.studies.tables import SummaryRow
from shadowbench.techniques.spec import format_spec


@dataclass(frozen=True)
class Curve:
    """A swept spec at a map size in a scene: factors of its bias, rising, and the row of each.

    `best` is the factor at which (1 − IoU) · (1 − SSIM) is least.
    """

    home: str
    map_size: int | None
    rows: tuple[tuple[float, SummaryRow], ...]
    best: float


Places = Mapping[str, tuple[str, float]]
"""By spec, as tables write it: the spec whose bias was multiplied, and by what."""


def places(sweeps: Sequence[BiasSweep]) -> Places:
    """Where each spec of a study's sweeps stands."""
    return {
        format_spec(spec, size=False): (format_spec(sweep.home, size=False), factor)
        for sweep in sweeps
        for factor, spec in sweep.swept
    }


def curves(rows: Sequence[SummaryRow], found: Places) -> list[Curve]:
    """The curves of a scene's table, a map size after the other; what did not hold is left out."""
    held = [row for row in rows if row.spec in found and row.cells and _error(row) is not None]
    made = []
    for home in dict.fromkeys(home for home, _ in found.values()):
        own = [row for row in held if found[row.spec][0] == home]
        for size in sorted({row.map_size for row in own}, key=lambda size: size or 0):
            at_size = sorted(((found[row.spec][1], row) for row in own if row.map_size == size), key=lambda one: one[0])
            best = min(at_size, key=lambda pair: _error(pair[1]) or 0.0)[0]
            made.append(Curve(home, size, tuple(at_size), best))
    return made


def with_factors(frame: pd.DataFrame, found: Places) -> pd.DataFrame:
    """Lines of `table.csv`, of swept specs with `bias_of`, whose bias was multiplied, and `bias_factor`."""
    if not found:
        return frame
    columns = pd.DataFrame(
        [found.get(spec, (None, None)) for spec in frame["spec"]],
        columns=["bias_of", "bias_factor"],
        index=frame.index,
    )
    return frame.join(columns)


def places_of(table: Path) -> Places:
    """What a table of such lines says; nothing of one without sweeps, or where there is none."""
    if not table.is_file():
        return {}
    frame = pd.read_csv(table)
    if "bias_of" not in frame:
        return {}
    swept = frame[frame["bias_of"].notna()]
    return {
        str(spec): (str(home), float(factor))
        for spec, home, factor in zip(swept["spec"], swept["bias_of"], swept["bias_factor"], strict=True)
    }


def _error(row: SummaryRow) -> float | None:
    iou, ssim = row.values["iou"], row.values["ssim"]
    return None if iou is None or ssim is None else math.sqrt((1 - iou.median) * (1 - ssim.median))
