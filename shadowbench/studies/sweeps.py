"""What a study's bias sweeps found: acne against contact as the bias grows, and the best of it beside the default."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

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


def curves(rows: Sequence[SummaryRow], sweeps: Sequence[BiasSweep]) -> list[Curve]:
    """The curves of a scene's table; what did not hold is left out."""
    found = []
    for sweep in sweeps:
        names = {format_spec(spec, size=False): factor for factor, spec in sweep.swept}
        own = [row for row in rows if row.spec in names and row.cells and _error(row) is not None]
        for size in dict.fromkeys(row.map_size for row in sorted(own, key=lambda row: row.map_size or 0)):
            at_size = sorted(((names[row.spec], row) for row in own if row.map_size == size), key=lambda pair: pair[0])
            best = min(at_size, key=lambda pair: _error(pair[1]) or 0.0)[0]
            found.append(Curve(format_spec(sweep.home, size=False), size, tuple(at_size), best))
    return found


def with_factors(frame: pd.DataFrame, sweeps: Sequence[BiasSweep]) -> pd.DataFrame:
    """Lines of `table.csv`, of swept specs with `bias_of`, whose bias was multiplied, and `bias_factor`."""
    if not sweeps:
        return frame
    places = {
        format_spec(spec, size=False): (format_spec(sweep.home, size=False), factor)
        for sweep in sweeps
        for factor, spec in sweep.swept
    }
    found = pd.DataFrame(
        [places.get(spec, (None, None)) for spec in frame["spec"]],
        columns=["bias_of", "bias_factor"],
        index=frame.index,
    )
    return frame.join(found)


def _error(row: SummaryRow) -> float | None:
    iou, ssim = row.values["iou"], row.values["ssim"]
    return None if iou is None or ssim is None else math.sqrt((1 - iou.median) * (1 - ssim.median))
