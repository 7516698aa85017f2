"""From counted work to milliseconds on a device: a law fitted to the times that were submitted for it.

A frame of a technique takes, beyond `unshadowed`, nanoseconds for each vertex, texture read and byte of its maps, the
same for all techniques, and for each frame, fragment and triangle of the casters, each kind of them its own. None is
below zero (non-negative least squares, Lawson and Hanson 1974), and errors count relative to the times.

A frame's share is what is the same in every scene, such as waiting for bounds that are read back; a triangle's is
mostly that of a silhouette on the CPU, so that of another computer differs. Counts are beyond `unshadowed`, too. Times
by the GPU's timer are as if `unshadowed`, the same picture in every view, took its median beside all cells: it tells
how fast the clocks ran.
"""

import re
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy.optimize import nnls

from shadowbench.errors import InputError
from shadowbench.gl.clock import QUERIES
from shadowbench.measure.rows import Record
from shadowbench.results.submission import (
    SHORTEST_MS,
    Submission,
    beside_work,
    counted_work,
    kind_of,
    known_submissions,
)
from shadowbench.scores.metrics import is_soft
from shadowbench.techniques.unshadowed import Unshadowed

SHARED = ("vertices", "reads", "gpu_bytes")
OWN = ("frames", "fragments", "triangles")
WORST = 1.5
"""Median factor in scenes left out above which a law gives no times: what such techniques do is not counted."""
LEAST_SCENES = 3
_FLOOR = Unshadowed.name
_BYTES = 4  # of the mask, which `unshadowed` draws too, a pixel
_LEAST_MS = 0.2  # below which errors of a fit are absolute


@dataclass(frozen=True)
class Error:
    """Factors between predicted and measured times in scenes left out of the fit: their median and 90th percentile."""

    median: float
    most: float
    cells: int
    scenes: int

    @property
    def holds(self) -> bool:
        """Whether a law may be used."""
        return self.median <= WORST and self.scenes >= LEAST_SCENES


@dataclass(frozen=True)
class Law:
    """A device's nanoseconds for each count, by name: `reads`, or of one kind of technique `cascades fragments`.

    errors: by kind, as by `kind_of`.
    """

    device: str
    nanoseconds: Mapping[str, float]
    errors: Mapping[str, Error]

    def holds(self, kind: str) -> bool:
        """Whether it gives times of a kind of technique."""
        return kind == _FLOOR or (kind in self.errors and self.errors[kind].holds)

    def milliseconds(self, kind: str, counts: Mapping[str, float]) -> float:
        """Time of a frame beyond `unshadowed`, SHORTEST_MS or more, of a kind of technique for which the law holds.

        counts: those of SHARED, vertices being those of geometry shaders too, and `fragments` and `triangles`.
        """
        return 0.0 if kind == _FLOOR else max(self.share(kind, counts), SHORTEST_MS)

    def share(self, kind: str, counts: Mapping[str, float]) -> float:
        """Milliseconds of a frame and of the counts that are given, however short."""
        if kind == _FLOOR:
            return 0.0
        shared = sum(self.nanoseconds[name] * counts.get(name, 0) for name in SHARED)
        own = sum(self.nanoseconds[f"{kind} {name}"] * {"frames": 1, **counts}.get(name, 0) for name in OWN)
        return (shared + own) / 1e6

    def of_row(self, row: Record) -> float | None:
        """Milliseconds of a score row that a software renderer drew; None where the law gives no time."""
        kind = kind_of(row["spec"])
        known = "triangles" in row and "vertices" in row["work"] and not is_soft(row["metrics"])
        return self.milliseconds(kind, counts_of(row, row["triangles"])) if known and self.holds(kind) else None


def counts_of(row: Record, triangles: int) -> dict[str, float]:
    """What a law takes of a score row that a software renderer drew; triangles: of the scene."""
    work = {"reads": 0, **row["work"], "gpu_bytes": row["gpu_bytes"]}
    return _beyond_floor(work, row["view_size"]) | {"triangles": triangles}


def _beyond_floor(work: Any, view_size: int) -> dict[str, Any]:
    """Counts beyond those of `unshadowed`: of one cell's counts by name, or of columns of cells."""
    return {
        "vertices": work["vertices"] + work["geometry"],
        "reads": work["reads"],
        "gpu_bytes": work["gpu_bytes"] - _BYTES * view_size**2,
        "fragments": work["fragments"] - view_size**2,
    }


@cache
def laws() -> Mapping[str, Law]:
    """The laws of all devices with times, by their names."""
    return {one.device: law_of(one) for one in known_submissions()}


def law_on_record() -> Law | None:
    """The law of the first device with times, which ranks where none is named and nothing can be timed."""
    return next(iter(laws().values()), None)


def find_law(name: str | None) -> Law | None:
    """The law of the device of this name, or the only one with these words in its name; None for None.

    Raises InputError if it is not one device.
    """
    if name is None:
        return None
    names = {_words(device): law for device, law in laws().items()}
    asked = _words(name)
    found = [law for words, law in names.items() if set(asked) <= set(words)]
    if not asked or (asked not in names and len(found) != 1):
        count = len(found) if asked else 0
        raise InputError(f"--device: {name!r:.60} names {count} devices with times; allowed: {', '.join(laws())}")
    return names.get(asked, found[0])


def _words(name: str) -> tuple[str, ...]:
    return tuple(re.findall(r"\w+", name.lower()))


def law_of(submission: Submission) -> Law:
    """The law of a device, fitted to all its cells; its errors are of scenes left out one at a time."""
    table = beside_work(submission, counted_work())
    table = table[table["kind"] != _FLOOR].reset_index(drop=True).fillna({"reads": 0})
    by_gpu, floor = table["clock"] == QUERIES, table["frame_ms"] - table["added_ms"]
    table = table.assign(
        **_beyond_floor(table, submission.view_size),
        frames=1,
        added_ms=table["added_ms"] * (floor[by_gpu].median() / floor).where(by_gpu, 1.0),
    )
    kinds = sorted(table["kind"].unique())
    features, ms = _features(table, kinds), table["added_ms"].to_numpy(float)
    predicted = np.empty(len(table))
    for scene in table["scene"].unique():
        left_out = (table["scene"] == scene).to_numpy()
        predicted[left_out] = features[left_out] @ _fitted(features[~left_out], ms[~left_out]) / 1e6
    factor = np.exp(np.abs(np.log(np.maximum(predicted, SHORTEST_MS) / np.maximum(ms, SHORTEST_MS))))
    errors = {
        str(kind): Error(
            float(np.median(factor[part.index])),
            float(np.percentile(factor[part.index], 90)),
            len(part),
            part["scene"].nunique(),
        )
        for kind, part in table.groupby("kind")
    }
    names = [*SHARED, *(f"{kind} {count}" for kind in kinds for count in OWN)]
    return Law(submission.device, dict(zip(names, _fitted(features, ms).tolist(), strict=True)), errors)


def _features(table: pd.DataFrame, kinds: list[str]) -> NDArray[np.float64]:
    """(cells, counts) counts of SHARED, then those of OWN for each kind, 0 in the cells of others."""
    its = table["kind"].to_numpy()[:, None] == np.array(kinds)
    own = its[:, :, None] * table[list(OWN)].to_numpy(float)[:, None, :]
    return np.hstack([table[list(SHARED)].to_numpy(float), own.reshape(len(table), -1)])


def _fitted(features: NDArray[np.float64], ms: NDArray[np.float64]) -> NDArray[np.float64]:
    """(counts,) nanoseconds of each count."""
    weight = 1 / np.maximum(ms, _LEAST_MS)
    scale = np.maximum(features.max(axis=0), 1)
    found, _ = nnls(features / scale * weight[:, None], ms * weight)
    return np.asarray(found / scale * 1e6)
