"""Frames of a block: their truths, traced while the worker draws, and the scores of a cell over all of them."""

from collections.abc import Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import replace
from functools import cached_property
from math import fsum
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from shadowbench.errors import MetricError
from shadowbench.measure.pictures import Rendering
from shadowbench.measure.points import Points
from shadowbench.measure.rows import Record
from shadowbench.measure.scoring import comparison_record, prepare_truth
from shadowbench.scenes.model import View
from shadowbench.scores.comparison import Comparison, PreparedTruth
from shadowbench.scores.difference import difference_picture
from shadowbench.scores.motion import Motion, Seen
from shadowbench.truths.cache import cached_truth
from shadowbench.truths.trace import Truth

KEPT_BYTES = 1 << 30
"""Memory for truths of a block; beyond it the oldest are read from the cache again."""
_PIXEL_BYTES = 112  # of a truth, what metrics share of it, and points
OF_AREA = ("mae_area",)
"""Metrics that compare with the truth's `area`, which is sampled finely in the first frame alone: they are of it."""
CURVES = ("iou", "rmse")
"""Metrics whose value in each frame is kept in a row."""
FILMED = 48
"""Most frames of a film."""


class Traced(NamedTuple):
    """The truth of a view, the same as the input of metrics, and the points that are followed through its frame."""

    truth: Truth
    prepared: PreparedTruth
    seen: Seen | None


class Truths:
    """Truths of views in order; reading one begins to trace the next in a thread, which `close` ends.

    They are read one after the other, from the first on as often as there are cells.
    """

    def __init__(self, views: Sequence[View]) -> None:
        self.views = tuple(views)
        self._most = max(2, KEPT_BYTES // (views[0].size.pixels * _PIXEL_BYTES))
        self._thread = ThreadPoolExecutor(1)
        self._kept: dict[int, Future[Traced]] = {}

    def close(self) -> None:
        """End the thread, after what it traces now."""
        self._thread.shutdown(cancel_futures=True)

    def __getitem__(self, index: int) -> Traced:
        """The truth of a view, by its index from 0. Raises as `cached_truth`."""
        for each in range(index, min(index + 2, len(self.views))):
            # Behind those that were read before.
            self._kept[each] = self._kept.pop(each) if each in self._kept else self._thread.submit(self._traced, each)
        while len(self._kept) > self._most:
            del self._kept[next(iter(self._kept))]
        return self._kept[index].result()

    @cached_property
    def first(self) -> Truth:
        """The truth of the first view."""
        return cached_truth(self.views[0])

    def _traced(self, index: int) -> Traced:
        truth = cached_truth(self.views[index], 1) if index else self.first
        if index == 0:
            self._points = Points()
        return Traced(truth, prepare_truth(truth), self._points.see(truth) if len(self.views) > 1 else None)


class CellScores:
    """The scores of a cell, drawn frame by frame. filmed: whether pictures of all frames are kept."""

    def __init__(self, truths: Truths, filmed: bool) -> None:
        self._truths, self._filmed = truths, filmed
        self._motion, self._records, self._drawn = Motion(), list[Record](), list[Rendering]()
        self._failure: MetricError | None = None
        self.film: list[NDArray[np.uint8]] = []

    @property
    def first(self) -> Rendering:
        """What was drawn in the first frame."""
        return self._drawn[0]

    def add(self, drawn: Rendering, triangle: NDArray[np.int32] | None) -> None:
        """Score the next frame; triangle: ids that it was drawn over, None if unknown."""
        index = len(self._drawn)
        truth, prepared, seen = self._truths[index]
        if (bright := measured(truth, drawn.measurable)) is not truth:
            truth, prepared = bright, prepare_truth(bright)
        comparison = Comparison(drawn.visibility, prepared)
        try:
            self._records.append(comparison_record(comparison, truth, triangle))
        except MetricError as error:
            self._failure = error
        if seen is not None:
            self._motion.add(comparison, seen)
        if self._filmed and index < FILMED:
            self.film.append(_panel(comparison))
        if index:  # of later frames the numbers alone
            nothing = np.zeros((0, 0), np.float32)
            drawn = replace(drawn, visibility=nothing, picture=np.zeros((0, 0, 3), np.uint8), measurable=None)
        self._drawn.append(drawn)

    def record(self) -> Record:
        """Fields of the score row. Metrics, work and facts of several frames are means; the rest is of the first.

        Raises MetricError if a metric failed in any frame.
        """
        if self._failure is not None:
            raise self._failure
        first, record = self.first, self._records[0]
        fields = {**record, "gpu_bytes": first.gpu_bytes, "work": dict(first.work), "facts": dict(first.facts)}
        if len(self._records) == 1:
            return fields
        values = {name: [one["metrics"][name] for one in self._records] for name in record["metrics"]}
        moving = self._motion.scores()
        pop_frame = moving.pop("pop_frame")
        changes = {name: [None, *curve] for name, curve in self._motion.curves().items()}
        known = [drawn.gpu_bytes for drawn in self._drawn if drawn.gpu_bytes is not None]
        return {
            **fields,
            "metrics": {name: series[0] if name in OF_AREA else _mean(series) for name, series in values.items()}
            | moving,
            "pop_frame": None if pop_frame is None else int(pop_frame),
            "by_frame": {name: values[name] for name in CURVES} | changes,
            "gpu_bytes": max(known, default=None),
            "work": {name: round(_mean([one.work.get(name, 0) for one in self._drawn]) or 0) for name in first.work},
            "facts": {name: _mean([one.facts.get(name) for one in self._drawn]) for name in first.facts},
        }


def _mean(values: Sequence[float | None]) -> float | None:
    known = [value for value in values if value is not None]
    return fsum(known) / len(known) if known else None


def measured(truth: Truth, measurable: NDArray[np.bool_] | None) -> Truth:
    """The truth where an engine's pictures are bright enough; they do not tell what triangles hide from the light."""
    if measurable is None or (truth.facet_shadow is None and not (truth.receivers & ~measurable).any()):
        return truth
    return replace(truth, receivers=truth.receivers & measurable, facet_shadow=None)


def _panel(comparison: Comparison) -> NDArray[np.uint8]:
    """(h, 3 w, 3) truth, mask and their difference side by side, each at most 512 pixels along a side."""
    valid, truth = comparison.truth.valid, comparison.truth.visibility
    greys = [np.where(valid, image, 1.0) for image in (truth, comparison.visibility)]
    images = [np.rint(grey * 255).astype(np.uint8)[..., np.newaxis].repeat(3, axis=-1) for grey in greys]
    every = -(-max(truth.shape) // 512)
    return np.hstack([*images, difference_picture(comparison)])[::every, ::every]
