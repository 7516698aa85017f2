"""The time record of a cell: statistics of what was timed beside its reference and its floor."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from shadowbench.gl.clock import QUERIES, Changes, PassTimes, Sample
from shadowbench.measure.cells import Cell

# Which passes are drawn anew in a frame, by what has moved since the last: see Changes.
REDRAWN: dict[str, tuple[Changes, ...]] = {
    "still": ("frame",),
    "camera": ("view", "frame"),
    "light": ("light", "view", "frame"),
}


@dataclass(frozen=True, eq=False)
class Times:
    """What a cell took, a value a round, all by one clock. Frames and passes come from different rounds."""

    frames: list[Sample]
    passes: list[PassTimes]
    prepare_ms: float
    clock: str

    @property
    def frames_ms(self) -> NDArray[np.float64]:
        """Milliseconds of whole frames, a value a round."""
        return np.array([frame.ms for frame in self.frames])


@dataclass(frozen=True, eq=False)
class Timing:
    """What a cell took, beside the reference and the floor of its own group.

    `no_ratio` is the reference's status where it has no times.
    """

    cell: Cell
    times: Times
    reference: str
    reference_times: Times | None
    floor: Times
    no_ratio: str | None = None


def time_row(timing: Timing, key: str, reference_key: str, machine: str) -> dict[str, Any]:
    """The time record of a cell's key: milliseconds as medians with their IQR; ratios are medians over rounds.

    reference_key: of the reference in the same view; machine: as `machine_key` gives it.

    `still_ms`, `camera_ms`, `light_ms`: the passes' medians summed over those that REDRAWN names; None for a technique
    that times no pass.
    `reference_ms`: the median of the reference in the same group.
    `wall_ms` is there when queries measured: a GPU's timer does not see what the CPU does, such as a fit.
    """
    times, reference = timing.times, timing.reference_times
    frames = times.frames_ms
    frame_ms, frame_iqr = _median_iqr(frames)
    wall_ms = float(np.median([frame.wall_ms for frame in times.frames]))
    passes = _passes(times.passes)
    record: dict[str, Any] = {
        "kind": "time",
        "key": key,
        "reference_key": reference_key,
        "machine": machine,
        "clock": times.clock,
        "n": len(frames),
        "frame_ms": frame_ms,
        "frame_iqr_ms": frame_iqr,
        "wall_ms": wall_ms if times.clock == QUERIES else None,
        "added_ms": float(np.median(frames - timing.floor.frames_ms)),
        "reference": timing.reference,
        "reference_ms": None,
        "ratio": None,
        "ratio_iqr": None,
        "ratio_quartiles": None,
        "no_ratio": timing.no_ratio,
        "prepare_ms": times.prepare_ms,
        "passes": passes,
    }
    record |= {
        f"{moved}_ms": sum((one["ms"] for one in passes.values() if one["changes"] in redrawn), 0.0) if passes else None
        for moved, redrawn in REDRAWN.items()
    }
    if reference is not None:
        record["reference_ms"] = float(np.median(reference.frames_ms))
        ratios = frames / reference.frames_ms
        record["ratio"], record["ratio_iqr"] = _median_iqr(ratios)
        record["ratio_quartiles"] = [float(end) for end in np.percentile(ratios, [25, 75])]
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
