"""Times normalised to one reference time, and the Pareto front of costs and errors.

Milliseconds of different blocks, runs or loads of the machine are not comparable; ratios to a reference timed in turn
with the cell are. So tables, charts and rankings use ratios, shown as milliseconds by multiplying with one time of the
reference.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd

from shadowbench.errors import counted

ROUGH = 1 / 3  # IQR of a time relative to its median above which the time is marked as rough

DRIFT = 1.25
"""Ratio of the longest to the shortest reference time in one view and light above which a table has a warning."""

_SCALED = ("added_ms", "wall_ms", "still_ms", "camera_ms", "light_ms")  # besides the passes


@dataclass(frozen=True)
class ReferenceTime:
    """Reference time to which the times of a table are normalised: its name, and its median over blocks in ms.

    shortest_ms, longest_ms: range over the blocks of the view and light with the largest spread; left_out: number of
    cells timed against another reference or without a ratio.
    """

    name: str
    ms: float
    shortest_ms: float
    longest_ms: float
    blocks: int
    left_out: int

    @property
    def drifted(self) -> bool:
        """Whether, in one view and light, the reference took over a quarter longer in one block than in another."""
        return self.longest_ms > DRIFT * self.shortest_ms


def normalise_times(table: pd.DataFrame) -> tuple[pd.DataFrame, ReferenceTime | None]:
    """Normalise all times of a table of cells to one reference time, which is returned too; None without any ratio.

    The reference is the one that most cells were timed against; cells with another, or without a ratio, lose their
    times. `frame_ms` and `frame_iqr_ms` are the ratio and its IQR times the reference time. Other times are scaled by
    the reference time over its time in the same block, as is the reference's own IQR, which its ratio of 1 lacks.
    """
    reference_ms, ratio = table["reference_ms"].astype(float), table["ratio"].astype(float)
    has_ratio = ratio.notna() & reference_ms.notna()
    name = next(iter(table.loc[has_ratio, "reference"].mode()), None)
    ours = has_ratio & (table["reference"] == name)
    blocks = reference_ms[ours].unique()
    ms = float(np.median(blocks)) if len(blocks) else np.nan
    scale = (ms / reference_ms).where(ours)
    ratio_iqr = table["ratio_iqr"].astype(float)
    itself = (ratio == 1) & (ratio_iqr == 0)
    shown = table.assign(
        ratio=ratio.where(ours),
        frame_ms=ratio.where(ours) * ms,
        frame_iqr_ms=(ratio_iqr * ms).where(~itself, table["frame_iqr_ms"].astype(float) * scale).where(ours),
    )
    others = [name for name in map(str, table.columns) if name in _SCALED or name.startswith("pass_")]
    shown = shown.drop(columns=others).join(table[others].astype(float).mul(scale, axis=0))[list(table.columns)]
    if name is None:
        return shown, None
    left_out = int((table["frame_ms"].notna() & ~ours).sum())
    spans = reference_ms[ours].groupby([table["view"], table["light"]]).agg(["min", "max"])
    shortest, longest = spans.iloc[(spans["max"] / spans["min"]).to_numpy().argmax()]
    return shown, ReferenceTime(str(name), ms, float(shortest), float(longest), len(blocks), left_out)


def pareto_front(points: Sequence[tuple[float, float]]) -> list[int]:
    """Indices of the Pareto-optimal (cost, error) points, by increasing cost."""
    order = sorted(range(len(points)), key=lambda index: points[index])
    front: list[int] = []
    for index in order:
        if not front or points[index][1] < points[front[-1]][1] or points[index] == points[front[-1]]:
            front.append(index)
    return front


def time_notes(reference: ReferenceTime | None, rough: Sequence[bool] = ()) -> list[str]:
    """Notes on the times of a table; rough: for each time, whether it is marked as rough."""
    if reference is None:
        return []
    name = reference.name
    whose = "its own time" if reference.blocks == 1 else f"its median over {reference.blocks} measurements"
    notes = [f"ms: time relative to {name}, in interleaved rounds, × {reference.ms:.3g} ms, {whose}"]
    if reference.drifted:
        span = f"{reference.shortest_ms:.3g} to {reference.longest_ms:.3g} ms"
        notes.append(f"the load of the machine varied: {name} took {span}; rely on ratios rather than on ms")
    if any(rough):
        wide = f"{sum(rough)} of {len(rough)} times have an interquartile range above a third of their median"
        notes.append(f"~: {wide}; more rounds would narrow it")
    if reference.left_out:
        notes.append(f"times of {counted(reference.left_out, 'cell')} left out: they have no ratio to {name}")
    return notes
