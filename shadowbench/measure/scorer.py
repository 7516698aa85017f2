"""Score rows: a cell is drawn by an executor, scored against the truth of its view, and written to disk."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property, partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from shadowbench.measure.bench import Bench
from shadowbench.measure.cells import Cell, CellRequest, PlacedView
from shadowbench.measure.executor import CellFailed, Executor, MemoryExceeded, Unsupported, status_of
from shadowbench.measure.flips import Count, flips
from shadowbench.measure.rendering import Rendering
from shadowbench.measure.rows import CellIdentity, Record
from shadowbench.measure.score_rows import Measurement, identity, score_row
from shadowbench.measure.scoring import mask_record, prepare_truth
from shadowbench.measure.session import Session
from shadowbench.measure.writer import Writer
from shadowbench.scores.prepared import PreparedTruth
from shadowbench.truths.cache import cached_truth
from shadowbench.truths.trace import Truth

FLIP_SAMPLES = 1
"""Samples per pixel of truths that flips are counted with; only the scored one's `area` is sampled more finely."""


@dataclass(frozen=True, eq=False)
class ScoreRequest:
    """A score row to make for a cell, under a key.

    axis_fields, extra_fields: see `score_row`; keep_bytes: bytes that cells kept for timing may take including this
    one, 0 if it is not timed; unsupported: why the cell must not be drawn, None to draw it.
    """

    cell: Cell
    key: str
    axis_fields: Mapping[str, Any] = field(default_factory=dict)
    extra_fields: Mapping[str, Any] = field(default_factory=dict)
    keep_bytes: int = 0
    unsupported: str | None = None


@dataclass(frozen=True, eq=False)
class _ScoringView:
    """A view and the scoring inputs that its cells share, each computed on first use."""

    placed_view: PlacedView
    executor: Executor
    scored: bool

    @cached_property
    def truth(self) -> Truth:
        """The truth; its `area` is only sampled if masks are scored against it."""
        view = self.placed_view.view
        return cached_truth(view) if self.scored else cached_truth(view, FLIP_SAMPLES)

    @cached_property
    def prepared(self) -> PreparedTruth:
        return prepare_truth(self.truth)

    @cached_property
    def surface(self) -> NDArray[np.int32]:
        return self.executor.call(Session.surface, self.placed_view)


class Scorer:
    """Makes score rows on a bench, once each.

    writes_images: whether a row's images are written, with the truth of its view; None for all cells and every view's
    truth.
    """

    def __init__(self, bench: Bench, writes_images: Callable[[Record], bool] | None = None) -> None:
        self.executor, self.store, self.pictures = bench.executor, bench.store, bench.pictures
        self.writes_images = writes_images
        self.renderer = bench.executor.info.renderer

    def rows(
        self,
        frames: Sequence[PlacedView],
        requests: Sequence[ScoreRequest],
        on_made: Callable[[Cell], object] = lambda cell: None,
        count: Count = flips,
    ) -> list[Record]:
        """Score rows in the order of the requests, made now or found in the store.

        frames: the view; several frames are an animation, of which the first is scored and all are checked for flips;
        on_made: called with each cell as its row is made; count: counts the flips.
        """
        views = [_ScoringView(frame, self.executor, scored=frame is frames[0]) for frame in frames]
        missing: dict[str, ScoreRequest] = {}
        for request in requests:
            if self.store.finished_score(request.key) is None:
                missing.setdefault(request.key, request)
        with Writer() as writer:
            if self.pictures is not None and self.writes_images is None:
                writer.add(partial(self.pictures.write_truth, frames[0].view, views[0].truth))
            shading_written = False
            for request in missing.values():
                row, rendering = self._make_row(views, request, writer, count)
                if self.pictures is None or (self.writes_images is not None and not self.writes_images(row)):
                    rendering = None
                elif rendering is not None and not shading_written:
                    shading = self.executor.call(Session.shading, frames[0])
                    writer.add(partial(self.pictures.write_shading, frames[0].view, *shading))
                    shading_written = True
                writer.add(partial(self._write, views[0], row, rendering))
                on_made(request.cell)
        return [self.store.scores[request.key] for request in requests]

    def _make_row(
        self, views: Sequence[_ScoringView], request: ScoreRequest, writer: Writer, count: Count
    ) -> tuple[Record, Rendering | None]:
        """Row of a cell, and the rendering of its first frame; None if the cell was unsupported or failed."""
        first, cell = views[0], _identity(request.cell, views[0].placed_view)
        make = partial(score_row, request.key, cell, self.renderer, axis_fields=request.axis_fields)
        try:
            if request.unsupported is not None:
                raise Unsupported(request.unsupported)
            surface = first.surface
            rendering, *later = [self._draw(view.placed_view, request, writer) for view in views]
        except (Unsupported, CellFailed) as reason:
            return make(status_of(reason)), None
        truth, prepared = first.truth, first.prepared
        mask = mask_record(rendering.visibility, truth, prepared, surface)
        extra_fields = dict(request.extra_fields)
        if later:
            masks = [frame.visibility for frame in (rendering, *later)]
            extra_fields["flips"] = count(masks, [view.truth for view in views])
        measurement = Measurement(mask, rendering.gpu_bytes, rendering.work, rendering.facts)
        return make(measurement, extra_fields=extra_fields), rendering

    def _draw(self, placed_view: PlacedView, request: ScoreRequest, writer: Writer) -> Rendering:
        """Draw a cell, in a new worker if memory runs out; the session keeps it for timing while there is room."""
        try:
            return self._build_and_draw(placed_view, request.cell.request, writer, request.keep_bytes)
        except MemoryExceeded:
            # Cells kept for timing may have taken the memory, or what the driver has not yet freed of earlier ones.
            return self._build_and_draw(placed_view, request.cell.request, writer, 0)

    def _build_and_draw(self, placed_view: PlacedView, request: CellRequest, writer: Writer, keep: int) -> Rendering:
        writer.finish()  # building is timed: nothing may run beside it
        self.executor.call(Session.build, placed_view, request)
        writer.start()
        return self.executor.call(Session.draw, placed_view, request, keep=keep)

    def _write(self, view: _ScoringView, row: Record, rendering: Rendering | None) -> None:
        """Write the images, then the row, whose presence promises them."""
        if rendering is not None and self.pictures is not None:
            self.pictures.write_cell(row["key"], rendering)
            if self.writes_images is not None:
                self.pictures.write_truth(view.placed_view.view, view.truth)
        self.store.append(row)


def _identity(cell: Cell, placed_view: PlacedView) -> CellIdentity:
    spec = cell.spec
    return identity(
        placed_view.view,
        technique=spec.technique.name,
        spec=spec.sizeless_text,
        full_spec=spec.full_text,
        map_size=spec.map_size,
        phase=cell.phase,
        coordinates=placed_view.coordinates,
    )
