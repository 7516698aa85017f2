"""From a cell in a view to its score row: drawn somewhere, scored against the view's truth, kept on disk."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property, partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from shadowbench.measure.cells import Cell, PlacedView
from shadowbench.measure.executor import CellFailed, Executor, MemoryExceeded, status_of
from shadowbench.measure.flips import flips
from shadowbench.measure.pictures import Pictures
from shadowbench.measure.profile import Profile
from shadowbench.measure.rendering import Rendering
from shadowbench.measure.row_store import RowStore
from shadowbench.measure.rows import CellIdentity, Record
from shadowbench.measure.score_rows import Measured, identity, score_row
from shadowbench.measure.scoring import mask_record, prepare_truth
from shadowbench.measure.session import Session, Unsupported
from shadowbench.measure.writer import Writer
from shadowbench.scores.prepared import PreparedTruth
from shadowbench.truths.cache import cached_truth
from shadowbench.truths.trace import Truth


@dataclass(frozen=True, eq=False)
class Asked:
    """A score row that is wanted: of a cell, under a key, with fields of its own (see `score_row`).

    keep: bytes that the cells kept for timing may take with this one, 0 for one that is not timed; refused: why it is
    not even drawn.
    """

    cell: Cell
    key: str
    axis_fields: Mapping[str, Any] = field(default_factory=dict)
    more: Mapping[str, Any] = field(default_factory=dict)
    keep: int = 0
    refused: str | None = None


@dataclass(frozen=True, eq=False)
class _Seen:
    """A view as its cells share it; what they are scored against is found once, when the first needs it."""

    at: PlacedView
    profile: Profile
    executor: Executor

    @cached_property
    def truth(self) -> Truth:
        with self.profile.of("truth"):
            return cached_truth(self.at.view)

    @cached_property
    def prepared(self) -> PreparedTruth:
        truth = self.truth
        with self.profile.of("score"):
            return prepare_truth(truth)

    @cached_property
    def surface(self) -> NDArray[np.int32]:
        return self.executor.call(Session.surface, self.at)


class Scorer:
    """Makes score rows in a store, once each.

    pictures: where masks, pictures and truths go; None keeps rows alone. shown: of which of the cells; None for all,
    and the truth of every view.
    """

    def __init__(
        self,
        executor: Executor,
        store: RowStore,
        pictures: Pictures | None = None,
        shown: Callable[[Record], bool] | None = None,
        profile: Profile | None = None,
    ) -> None:
        self.executor, self.store, self.pictures, self.shown = executor, store, pictures, shown
        self.profile = profile or Profile()
        self.renderer = executor.info.renderer

    def rows(
        self, frames: Sequence[PlacedView], asked: Sequence[Asked], made: Callable[[Cell], object] = lambda cell: None
    ) -> list[Record]:
        """The rows of cells, made now (`made` is told of each) or before.

        frames: the view; several are a movement, of which the first is scored, and flips are looked for in all.
        """
        seen = [_Seen(at, self.profile, self.executor) for at in frames]
        missing: dict[str, Asked] = {}
        for one in asked:
            if self.store.done(one.key) is None:
                missing.setdefault(one.key, one)
        with Writer(self.profile) as writer:
            if self.pictures is not None and self.shown is None:
                writer.add(partial(self.pictures.write_truth, frames[0].view, seen[0].truth))
            shaded = False
            for one in missing.values():
                row, drawn = self._row(seen, one, writer)
                if self.pictures is None or (self.shown is not None and not self.shown(row)):
                    drawn = None
                elif drawn is not None and not shaded:
                    both = self.executor.call(Session.shading, frames[0])
                    writer.add(partial(self.pictures.write_shading, frames[0].view, *both))
                    shaded = True
                writer.add(partial(self._keep, seen[0], row, drawn))
                made(one.cell)
        return [self.store.scores[one.key] for one in asked]

    def _row(self, seen: Sequence[_Seen], asked: Asked, writer: Writer) -> tuple[Record, Rendering | None]:
        """A cell's row, and what the first frame drew; None for a cell that did not hold."""
        first, cell = seen[0], _named(asked.cell, seen[0].at)
        make = partial(score_row, asked.key, cell, self.renderer, axis_fields=asked.axis_fields)
        try:
            if asked.refused is not None:
                raise Unsupported(asked.refused)
            with self.profile.of("waiting"):
                surface = first.surface
                drawn, *later = [self._draw(one.at, asked, writer) for one in seen]
        except (Unsupported, CellFailed) as reason:
            return make(status_of(reason)), None
        truth, prepared = first.truth, first.prepared
        with self.profile.of("score"):
            mask = mask_record(drawn.visibility, truth, prepared, surface)
        more = dict(asked.more)
        if later:
            masks = [one.visibility for one in (drawn, *later)]
            more["flips"] = flips(masks, [one.truth for one in seen])
        return make(Measured(mask, drawn.gpu_bytes, drawn.work, drawn.facts), more=more), drawn

    def _draw(self, at: PlacedView, asked: Asked, writer: Writer) -> Rendering:
        """A cell, which the session keeps for timing while there is room."""
        try:
            return self._build_and_draw(at, asked, writer, asked.keep)
        except MemoryExceeded:
            if not asked.keep:
                raise
            # The others that were kept may have been too much beside it; the new worker has none.
            return self._build_and_draw(at, asked, writer, 0)

    def _build_and_draw(self, at: PlacedView, asked: Asked, writer: Writer, keep: int) -> Rendering:
        request = asked.cell.request
        writer.finish()  # building is timed: nothing runs beside it
        self.executor.call(Session.build, at, request)
        writer.start()
        return self.executor.call(Session.draw, at, request, keep=keep)

    def _keep(self, seen: _Seen, row: Record, drawn: Rendering | None) -> None:
        """Images first: a row says that they are there."""
        if drawn is not None and self.pictures is not None:
            self.pictures.write_cell(row["key"], drawn)
            if self.shown is not None:
                self.pictures.write_truth(seen.at.view, seen.truth)
        self.store.append(row)


def _named(cell: Cell, at: PlacedView) -> CellIdentity:
    spec = cell.spec
    return identity(
        at.view,
        technique=spec.technique.name,
        spec=spec.sizeless_text,
        full_spec=spec.full_text,
        map_size=spec.map_size,
        phase=cell.phase,
        coordinates=at.coordinates,
    )
