"""Time record of a cell: statistics of its samples, beside those of its reference and of the unshadowed floor."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from shadowbench.gl.clock import QUERIES, WALL, Changes, PassTimes, Sample

# Passes that are redrawn in a frame, by what has moved since the last one: see Changes.
REDRAWN: dict[str, tuple[Changes, ...]] = {
    "still": ("frame",),
    "camera": ("view", "frame"),
    "light": ("light", "view", "frame"),
}


@dataclass(frozen=True, eq=False)
class Samples:
    """Timing samples of a cell, one per round, all by one clock. Frames and passes come from different rounds."""

    frames: list[Sample]
    passes: list[PassTimes]
    prepare_ms: float

    @property
    def clocks(self) -> set[str]:
        """The clocks used; more than one if the clock gave up timer queries midway."""
        return {frame.clock for frame in self.frames}.union(*(passes.clocks for passes in self.passes))

    def frames_ms(self, clock: str) -> NDArray[np.float64]:
        """(n,) milliseconds of whole frames, one per round, for a comparison with times of this clock."""
        return np.array([frame.ms if clock == QUERIES else frame.wall_ms for frame in self.frames])


class Times(NamedTuple):
    """Samples of a cell, and of the floor and of the reference in the same rounds.

    no_ratio: status of the reference if it has no samples.
    """

    cell: Samples
    floor: Samples
    reference_name: str
    reference: Samples | None
    no_ratio: str | None

    @property
    def common_clock(self) -> str:
        """The clock that cell and reference have in common; timer queries miss what the CPU draws."""
        assert self.reference is not None
        return QUERIES if self.cell.clocks == self.reference.clocks == {QUERIES} else WALL

    @property
    def ratios(self) -> NDArray[np.float64] | None:
        """(n,) frames' times over those of the reference in the same rounds."""
        if self.reference is None:
            return None
        return self.cell.frames_ms(self.common_clock) / self.reference.frames_ms(self.common_clock)


def time_row(times: Times | str, key: str, reference_key: str, machine: str) -> dict[str, Any]:
    """Time record under a cell's key: medians over rounds, in ms and as ratios, with their IQRs; or why it has none.

    reference_key: key of the reference in the same view; machine: a `machine_key`.

    `still_ms`, `camera_ms`, `light_ms`: sums of the medians of the passes in REDRAWN; None for a technique that times
    no pass.
    `reference_ms`: median of the reference in the same group.
    `wall_ms`: only with timer queries, which miss CPU work such as fitting the light's frustum.
    """
    if isinstance(times, str):
        return {"kind": "time", "key": key, "machine": machine, "status": f"failed: {times}"}
    cell, reference = times.cell, times.reference
    (clock,) = cell.clocks  # times of two have no common median
    frames, passes = cell.frames_ms(clock), _passes(cell.passes)
    frame_ms, frame_iqr = _median_iqr(frames)
    record: dict[str, Any] = {
        "kind": "time",
        "key": key,
        "reference_key": reference_key,
        "machine": machine,
        "clock": clock,
        "n": len(frames),
        "frame_ms": frame_ms,
        "frame_iqr_ms": frame_iqr,
        "wall_ms": float(np.median(cell.frames_ms(WALL))) if clock == QUERIES else None,
        "added_ms": float(np.median(frames - times.floor.frames_ms(clock))),
        "reference": times.reference_name,
        "reference_ms": None,
        "ratio": None,
        "ratio_iqr": None,
        "no_ratio": times.no_ratio,
        "prepare_ms": cell.prepare_ms,
        "passes": passes,
    }
    for moved, redrawn in REDRAWN.items():
        total = sum((entry["ms"] for entry in passes.values() if entry["changes"] in redrawn), 0.0)
        record[f"{moved}_ms"] = total if passes else None
    if reference is not None and (ratios := times.ratios) is not None:
        record["reference_ms"] = float(np.median(reference.frames_ms(times.common_clock)))
        record["ratio"], record["ratio_iqr"] = _median_iqr(ratios)
    return record


def _passes(rounds: Sequence[PassTimes]) -> dict[str, dict[str, Any]]:
    found = {}
    for name, changes in rounds[0].changes.items():
        ms, iqr_ms = _median_iqr(np.array([passes.ms[name] for passes in rounds]))
        found[name] = {"ms": ms, "iqr_ms": iqr_ms, "n": len(rounds), "changes": changes}
    return found


def _median_iqr(values: NDArray[np.float64]) -> tuple[float, float]:
    low, middle, high = np.percentile(values, [25, 50, 75])
    return float(middle), float(high - low)
