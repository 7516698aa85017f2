"""The one way to make rows: blocks are drawn, scored against their truths and timed, into a folder."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from pathlib import Path
from types import TracebackType
from typing import Any, Literal, Protocol, Self
from weakref import WeakKeyDictionary

from shadowbench.errors import InputError, MetricError, Unsupported, message, quoted
from shadowbench.files import check_folder
from shadowbench.measure.cells import Block, Cell
from shadowbench.measure.drawer import Drawer
from shadowbench.measure.failures import CellFailed, Failure, status_of
from shadowbench.measure.flips import Stepped, flips
from shadowbench.measure.gl_drawer import reference_cell
from shadowbench.measure.keys import cell_key, joint_key, view_key
from shadowbench.measure.machine import machine_key, write_run_file
from shadowbench.measure.pictures import Pictures, Writer
from shadowbench.measure.rendering import Rendering
from shadowbench.measure.row_store import RowStore, identity
from shadowbench.measure.rows import Record, Result, StudyFacts
from shadowbench.measure.scoring import mask_record
from shadowbench.measure.time_rows import time_row
from shadowbench.truths.trace import Truth

Uniform = Literal["lit", "in shadow"]


class Reporter(Protocol):
    """Receiver of progress messages."""

    def note(self, line: str) -> None:
        """Show one line to the user."""

    def stage(self, name: str, total: int | None) -> None:
        """Begin a stage of `total` steps, None if unknown."""

    def step(self, what: str) -> None:
        """Count one step of the stage as done."""


class Campaign:
    """Measures blocks with a drawer into a folder, which it locks: a context manager.

    A cell with a row is not measured again, so that a campaign that was stopped goes on. keeps_images: whether images
    of a row are written, with the truth of its view; None for all rows, and the truth of every block; sweep: whether
    the blocks lie on axes; time_again: time cells again that have a time; the rows keep both; keep_going: blocks that
    fail are added to `failures` and left out, rather than raised.
    """

    def __init__(
        self,
        folder: Path,
        drawer: Drawer,
        reporter: Reporter,
        *,
        keeps_images: Callable[[Record], bool] | None = None,
        sweep: bool = False,
        time_again: bool = False,
        keep_going: bool = False,
    ) -> None:
        check_folder(folder)
        self.folder, self.drawer, self.reporter = folder, drawer, reporter
        self.keep_going, self.failures = keep_going, list[Failure]()
        self._sweep, self._keeps_images, self._time_again = sweep, keeps_images, time_again
        self._pictures = Pictures(folder)
        self._keys = WeakKeyDictionary[Block, dict[Cell, str]]()  # a scene takes long to hash

    def __enter__(self) -> Self:
        self.store = RowStore(self.folder, self._sweep)
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self.store.close()

    def trace(self, blocks: Sequence[Block]) -> list[tuple[Block, Uniform | None]]:
        """The blocks, once the truths of their views are in the cache, and which of these show no edge of a shadow.

        Raises InputError for a view that shows nothing; blocks that fail are left out if the campaign keeps going. It
        need not be entered yet: nothing is written into its folder.
        """
        self.reporter.stage("truth", len(blocks))
        traced = []
        for block in blocks:
            with self._attempt("truth", block.view.name):
                traced.append((block, uniform(block.fresh().truth(0))))
            self.reporter.step(block.view.name)
        return traced

    def measure(self, blocks: Iterable[Block]) -> Iterator[dict[Cell, Result]]:
        """Results of each block's cells, measured now or found. Reports a step for each cell, and one when it is timed.

        Cells of a block that failed are left out if the campaign keeps going.
        """
        for block in blocks:
            with self._attempt(*block.called):
                self._score(block)
                self._time(block)
            yield self.results(block)

    def results(self, block: Block) -> dict[Cell, Result]:
        """Rows of a block's cells, without those that have none."""
        scores, machine = self.store.scores, self.machine
        found = {cell: key for cell, key in self.keys(block).items() if key in scores}
        return {cell: Result(scores[key], self.store.time_on(machine, key)) for cell, key in found.items()}

    def keys(self, block: Block) -> dict[Cell, str]:
        """Keys of the rows of a block's cells."""
        if block not in self._keys:
            views, drawer = [view_key(view) for view in block.views], self.drawer.identity
            frames = {cell: [cell_key(cell, view, block.coordinates, drawer) for view in views] for cell in block.cells}
            self._keys[block] = {
                cell: keys[0]
                if len(keys) == 1 and not block.place
                else joint_key([*keys, block.step, dict(block.place), cell.home and cell.home.text])
                for cell, keys in frames.items()
            }
        return self._keys[block]

    def unscored(self, block: Block) -> dict[Cell, str]:
        """Keys of the cells of a block that will be drawn: those without a row, and those that failed."""
        return {cell: key for cell, key in self.keys(block).items() if self.store.finished_score(key) is None}

    @property
    def machine(self) -> str:
        """Key of what times depend on besides the cell."""
        return machine_key(self.drawer)

    def finish(self, study: StudyFacts, notes: Sequence[str], keys: Iterable[str]) -> None:
        """Write `run.json`; keys: of the cells that the command asked for."""
        write_run_file(self.folder / "run.json", self.drawer, notes, study, keys)

    @contextmanager
    def _attempt(self, what: str, where: str) -> Iterator[None]:
        """Keep going after an exception within it, but for errors of the disk, as everything after would be lost."""
        try:
            yield
        except OSError:
            raise
        except Exception as error:
            if not self.keep_going or (isinstance(error, InputError) and what != "truth"):  # of the row store
                raise
            self.failures.append(Failure(what, where, quoted(message(error) or type(error).__name__)))

    def _score(self, block: Block) -> None:
        """Make the score rows that are missing."""
        missing = self.unscored(block)
        name, pictures, shading_written = block.scene.name, self._pictures, False
        with Writer() as writer:
            if self._keeps_images is None:
                writer.add(partial(pictures.write_truth, block.view, block.truth(0)))
            for cell, key in missing.items():
                if block.times(cell):
                    writer.finish()  # its build is timed: nothing may run beside it
                row, rendering = self._score_cell(block, cell, key)
                writer.finish()  # which bounds the images in memory
                writes: list[Callable[[], None]] = []
                if rendering is not None and (self._keeps_images is None or self._keeps_images(row)):
                    if not shading_written:
                        writes.append(partial(pictures.write_truth, block.view, block.truth(0)))
                        writes.append(partial(pictures.write_shading, block.view, *self.drawer.shading(block)))
                        shading_written = True
                    writes.append(partial(pictures.write_cell, key, rendering))
                writer.add(*writes, partial(self.store.append, row))  # after the images, which its presence promises
                self.reporter.step(f"{name} {cell.spec.text}")
        for _ in range(len(block.cells) - len(missing)):
            self.reporter.step(f"{name}: measured before")

    def _score_cell(self, block: Block, cell: Cell, key: str) -> tuple[Record, Rendering | None]:
        """Score row of a cell, and the rendering of its first view; None if the cell was unsupported or failed."""
        row = {"kind": "score", "key": key, **_identity(block, cell), "renderer": self.drawer.info.renderer}
        try:
            surface = self.drawer.surface(block)
            first, *later = self.drawer.draw(block, cell, keep=block.times(cell) and len(block.views) == 1)
        except (Unsupported, CellFailed) as reason:
            return row | {"status": status_of(reason)}, None
        try:
            scores = mask_record(first.visibility, block.truth(0), block.prepared, surface)
        except MetricError as error:
            return row | {"status": f"failed: {error}"}, None
        row |= {"status": "ok", **scores}
        row |= {"gpu_bytes": first.gpu_bytes, "work": dict(first.work), "facts": dict(first.facts)}
        row["assumptions"] = list(block.scene.notes)
        if later:
            truths = [block.truth(index) for index in range(len(block.views))]
            count = Stepped(block.view, block.step).count if block.step else flips
            row["flips"] = count([drawn.visibility for drawn in (first, *later)], truths)
        return row | ({"step": block.step} if block.step else {}), first

    def _time(self, block: Block) -> None:
        """Time the successful cells that lack a time."""
        wanted = {cell: key for cell, key in self.keys(block).items() if block.times(cell)}
        if not wanted:
            return
        store, name = self.store, block.scene.name
        (reference,) = self.keys(replace(block, cells=(reference_cell(block),))).values()
        sizes: dict[Cell, int] = {}
        retried: dict[Cell, int] = {}  # timed before, without a ratio
        for cell, key in wanted.items():
            row, time = store.scores[key], store.time_on(self.machine, key)
            if row["status"] == "ok":
                if time is None or self._time_again or not _suffices(time, block.rounds, reference):
                    sizes[cell] = int(row["gpu_bytes"])
                elif _lacks_ratio(time):
                    retried[cell] = int(row["gpu_bytes"])
        timed = 0
        for timing in self.drawer.time(block, sizes, retried) if sizes or retried else ():
            if timing.failed is not None:
                lacking = "no time" if timing.cell in sizes else "no ratios to this reference"
                self.reporter.note(f"{name} {timing.cell.spec.text}: {lacking}: {timing.failed}")
            if timing.times is not None or timing.cell in sizes:
                store.append(time_row(timing, wanted[timing.cell], reference, self.machine))
            if timing.cell in sizes:
                timed += 1
                self.reporter.step(f"{name}: timed")
        for _ in range(len(wanted) - timed):
            self.reporter.step(f"{name}: nothing to time")


def uniform(truth: Truth) -> Uniform | None:
    """Whether all that is decided is lit, or in shadow; None if there is an edge."""
    visibility = truth.visibility[truth.receivers & ~truth.undecided]
    if not (visibility < 1).any():
        return "lit"
    return None if visibility.any() else "in shadow"


def _suffices(time: Record, rounds: int, reference: str) -> bool:
    """Whether a time record suffices: enough rounds, and the same reference."""
    enough = time.get("n", 0) >= rounds and "reference_ms" in time
    return bool(enough and time.get("reference_key") == reference)


def _lacks_ratio(time: Record) -> bool:
    """Whether a time has no ratio because its reference failed, which may work now; an unsupported one never will."""
    return time["ratio"] is None and not time["no_ratio"].startswith("unsupported")


def _identity(block: Block, cell: Cell) -> dict[str, Any]:
    spec = cell.spec
    named = identity(
        block.view,
        technique=spec.technique.name,
        spec=spec.sizeless_text,
        full_spec=spec.full_text,
        map_size=spec.map_size,
        phase=cell.phase,
        coordinates=block.coordinates,
    )
    return {**named, **block.place, **({"home_spec": cell.home.text} if cell.home else {})}
