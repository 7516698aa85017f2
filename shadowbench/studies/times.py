"""Times of a table by one reference time, and the front of costs and errors.

A millisecond of one block, run or load of the machine is no millisecond of another. A ratio to the reference that was
measured in turn with the cell is, so that tables, charts and choices use ratios, and show them as milliseconds by one
time of the reference.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd

WIDE = 1 / 3
"""The IQR of a time, over its median, above which it is marked."""

DRIFT = 1.25
"""The longest time of a reference over its shortest in one view and light, above which a table says so."""

_SCALED = ("added_ms", "wall_ms", "still_ms", "camera_ms", "light_ms")  # and the passes


@dataclass(frozen=True)
class ReferenceTime:
    """What the times of a table are shown by: the reference, and its median over the blocks that timed it, in ms.

    shortest_ms, longest_ms: over the blocks of one view and light, those whose blocks are furthest apart; the reference
    may cost more in another.
    left_out: cells that were timed, but against another reference or without a ratio to any.
    """

    name: str
    ms: float
    shortest_ms: float
    longest_ms: float
    blocks: int
    left_out: int

    @property
    def drifted(self) -> bool:
        """Whether the reference took more than a quarter longer in one block of a view and light than in another."""
        return self.longest_ms > DRIFT * self.shortest_ms


def by_one_reference(table: pd.DataFrame) -> tuple[pd.DataFrame, ReferenceTime | None]:
    """A table of cells with all its times by one time of their reference, and that; None where nothing has a ratio.

    The reference is the one that most cells were timed against; cells with another, or without a ratio, lose their
    times. `frame_ms` is the ratio, and `frame_iqr_ms` the ratio's IQR, times the reference's time; other times, and the
    reference's own IQR, which no ratio to itself has, are scaled by what the reference took in their own block.
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
    for column in map(str, table.columns):
        if column in _SCALED or column.startswith("pass_"):
            shown[column] = table[column].astype(float) * scale
    if name is None:
        return shown, None
    left_out = int((table["frame_ms"].notna() & ~ours).sum())
    spans = reference_ms[ours].groupby([table["view"], table["light"]]).agg(["min", "max"])
    shortest, longest = spans.iloc[(spans["max"] / spans["min"]).to_numpy().argmax()]
    return shown, ReferenceTime(str(name), ms, float(shortest), float(longest), len(blocks), left_out)


def pareto_front(points: Sequence[tuple[float, float]]) -> list[int]:
    """Indices of the points (cost, error) that none beats, by cost: no other is as good in both and better in one."""
    order = sorted(range(len(points)), key=lambda index: points[index])
    front: list[int] = []
    for index in order:
        if not front or points[index][1] < points[front[-1]][1] or points[index] == points[front[-1]]:
            front.append(index)
    return front


def time_notes(reference: ReferenceTime | None, rough: Sequence[bool] = ()) -> list[str]:
    """What the reader of a table must know of its times; `rough`: of each of them whether it is marked."""
    if reference is None:
        return []
    name = reference.name
    whose = "its own time" if reference.blocks == 1 else f"its median over {reference.blocks} measurements"
    notes = [f"ms: time relative to {name}, in interleaved rounds, × {reference.ms:.3g} ms, {whose}"]
    if reference.drifted:
        span = f"{reference.shortest_ms:.3g} to {reference.longest_ms:.3g} ms"
        notes.append(f"the load of the machine varied: {name} took {span}; rely on × ref rather than on ms")
    if any(rough):
        count = f"{sum(rough)} of {len(rough)} times"
        notes.append(f"~: {count} have an interquartile range above a third of their median; more --rounds help")
    if reference.left_out:
        count = f"{reference.left_out} cell{'' if reference.left_out == 1 else 's'}"
        notes.append(f"times of {count} left out: they have no ratio to {name}")
    return notes
