"""Runs a study: truths first, then every cell drawn and scored alone, then those that held timed together.

Phases are scored, and the first of them is timed. Rows go to disk as they are made; a call that finds rows of the same
key does nothing again.
"""

from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, Protocol, Self

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from shadowbench.errors import InputError
from shadowbench.files import replace_file
from shadowbench.measure.drawn import Drawn
from shadowbench.measure.keys import cell_key, view_key
from shadowbench.measure.machine import machine_key
from shadowbench.measure.profile import Profile
from shadowbench.measure.row_store import RowStore
from shadowbench.measure.rows import CellIdentity, Record
from shadowbench.measure.scoring import mask_record, reference_of
from shadowbench.measure.session import DeviceInfo, Unsupported
from shadowbench.measure.timing import BlockStage, Untimed, reference_cell, request_of, time_cells
from shadowbench.measure.worker import AteMemory, CellFailed, Worker
from shadowbench.measure.writer import Writer
from shadowbench.scenes.model import Scene, View
from shadowbench.scenes.views import first_of
from shadowbench.scores.masks import mask_sha256, read_mask, write_mask
from shadowbench.scores.reference import Reference
from shadowbench.studies.study import Block, Cell, Study, scenes_of
from shadowbench.techniques.spec import format_spec
from shadowbench.truth.cache import cached_truth
from shadowbench.truth.trace import Truth

_KEPT = 0.25  # of the memory limit: cells that were drawn and wait to be timed


class Reporter(Protocol):
    """Who is told how a run goes."""

    def note(self, line: str) -> None:
        """One line that the user should read."""

    def stage(self, name: str, total: int) -> None:
        """A stage of so many steps begins."""

    def step(self, what: str) -> None:
        """One step of the stage is done."""


@dataclass(frozen=True, eq=False)
class Result:
    """A cell's rows: its score record, and its time record where it has one; `untimed` says why timing it failed."""

    score: Record
    time: Record | None
    untimed: str | None = None

    @property
    def status(self) -> str:
        """`ok`, `unsupported: …` or `failed: …`, also for a cell that fails only while it is timed."""
        return str(self.score["status"]) if self.untimed is None else f"failed: while timed: {self.untimed}"


class Runner:
    """Runs one study into one folder; as a context manager it holds the rows, for blocks to come.

    time_again: whether cells that have a time get another, beside which the old one stays in the rows.
    """

    def __init__(
        self, study: Study, folder: Path, worker: Worker, reporter: Reporter, time_again: bool = False
    ) -> None:
        self.study, self.folder, self.worker, self.reporter = study, folder, worker, reporter
        self.time_again = time_again
        self.profile = Profile()
        self.info: DeviceInfo = worker.call("info")
        self.notes: list[str] = []
        self._machine = machine_key(self.info)
        self._stage = BlockStage(worker, study)

    def __enter__(self) -> Self:
        self._store = RowStore(self.folder)
        return self

    def __exit__(self, *_: object) -> None:
        self._store.close()

    def run(self) -> list[Result]:
        """All cells of the study, measured now or before; raises InputError before anything is written."""
        self._check_sizes()
        blocks = list(self.study.blocks())
        self.notes = [*self.study.notes, *(note for scene in scenes_of(blocks) for note in self._notes_on(scene))]
        for note in self.notes:
            self.reporter.note(note)
        self.reporter.stage("truth", len(blocks))
        for block in blocks:  # all of them before anything is written: a view that shows nothing is bad input
            with self.profile.of("truth"):
                truth = cached_truth(block.view)
            if not (truth.visibility < 0.5).any():
                self.notes.append(f"{block.view.name}: nothing is in shadow, so that most scores say nothing")
                self.reporter.note(self.notes[-1])
            self.reporter.step(block.view.name)
        with self:
            cells = [cell for block in blocks for cell in block.cells]
            timed = [cell for cell in cells if self._wants_time(cell)]
            self.reporter.stage("cells", len(cells) + len(timed))
            return [result for block in blocks for result in self.run_block(block)]

    def _notes_on(self, scene: Scene) -> list[str]:
        first = "file" in self.study.views
        several = first_of(scene.name, "cameras", scene.cameras, "--view or a study") if first else []
        return [*scene.notes, *several]

    def _check_sizes(self) -> None:
        largest = max(self.study.reference.map_size or 0, *(cell.spec.map_size or 0 for cell in self.study.cells()))
        for what, size in (("map size", largest), ("view size", self.study.view_size)):
            if size > self.info.max_map_size:
                raise InputError(f"{what} {size}: {self.info.renderer} allows 1 to {self.info.max_map_size}")

    def run_block(self, block: Block) -> list[Result]:
        """The cells of a block, measured now or before; the folder's rows must be held."""
        view, store = view_key(block.view), self._store
        keys = {cell: self._key(cell, view) for cell in block.cells}
        missing = [cell for cell, key in keys.items() if not _is_done(store.scores.get(key))]
        with self.profile.of("truth"):
            truth = cached_truth(block.view)
        with Writer(self.profile) as writer:
            writer.add(lambda: self._write_truth(block.view, truth))
            if missing:
                with self.profile.of("score"):
                    reference = reference_of(truth)
                for cell in missing:
                    row, drawn = self._score(block, cell, keys[cell], truth, reference, writer)
                    writer.add(partial(self._write_cell, row, drawn))
                    self.reporter.step(f"{block.scene.name} {format_spec(cell.spec)}")
        for _ in range(len(keys) - len(missing)):
            self.reporter.step(f"{block.scene.name}: measured before")
        untimed = self._time_block(block, view, keys)
        return [Result(store.scores[key], self._time(key), untimed.get(cell)) for cell, key in keys.items()]

    def _wants_time(self, cell: Cell) -> bool:
        """Whether the study times a cell: the other phases differ in their errors alone."""
        return self.study.rounds > 0 and cell.phase == 0

    def _key(self, cell: Cell, view: str) -> str:
        return cell_key(cell, view, self.study.coordinates, self.info.renderer)

    def _score(
        self, block: Block, cell: Cell, key: str, truth: Truth, reference: Reference, writer: Writer
    ) -> tuple[dict[str, Any], Drawn | None]:
        """A cell's score record, and what it rests on; None for a cell that did not hold."""
        row = {"kind": "score", "key": key, **identity(self.study, block, cell), "renderer": self.info.renderer}
        try:
            with self.profile.of("waiting"):
                surface, drawn = self._draw(block, cell, writer)
        except Unsupported as reason:
            return row | {"status": f"unsupported: {reason}"}, None
        except CellFailed as reason:
            return row | {"status": f"failed: {reason}"}, None
        with self.profile.of("score"):
            scored = mask_record(drawn.visibility, truth, reference, surface)
        row |= {
            "status": "ok",
            **scored,
            "gpu_bytes": drawn.gpu_bytes,
            "work": drawn.work,
            "facts": drawn.facts,
            "assumptions": list(block.scene.notes),
        }
        return row, drawn

    def _draw(self, block: Block, cell: Cell, writer: Writer) -> tuple[NDArray[np.int32], Drawn]:
        """The view's triangle ids and the cell, which the worker keeps for timing while there is room."""
        keep = int(_KEPT * self.worker.limits.bytes) if self._wants_time(cell) else 0
        try:
            return self._build_and_draw(block, cell, writer, keep)
        except AteMemory:
            if not keep:
                raise
            # The others that were kept may have been too much beside it; the new worker has none.
            return self._build_and_draw(block, cell, writer, 0)

    def _build_and_draw(self, block: Block, cell: Cell, writer: Writer, keep: int) -> tuple[NDArray[np.int32], Drawn]:
        request = request_of(cell)
        surface = self._stage.open(block)
        writer.finish()  # building is timed: nothing runs beside it
        self.worker.call("build", request)
        writer.start()
        return surface, self.worker.call("draw", request, False, False, keep)

    def _write_cell(self, row: Record, drawn: Drawn | None) -> None:
        """Images first: a row says that they are there."""
        if drawn is not None:
            write_mask(self._made("masks") / f"{row['key']}.png", drawn.visibility)
            write_picture(self._made("pictures") / f"{row['key']}.png", drawn.picture)
        self._store.append(row)

    def _time_block(self, block: Block, view: str, keys: dict[Cell, str]) -> dict[Cell, str]:
        """Time what held and has no time yet. Says what failed."""
        store = self._store
        untimed: dict[Cell, str] = {}
        reference = self._key(reference_cell(self.study, block.view.light.kind), view)
        wanted = [cell for cell in keys if self._wants_time(cell)]
        held = [cell for cell in wanted if store.scores[keys[cell]]["status"] == "ok"]
        timed = {
            cell: row
            for cell in held
            if not self.time_again and self._is_timed(row := store.times.get(keys[cell]), reference)
        }
        lacking = {cell for cell, row in timed.items() if _lacks_ratio(row)}
        sizes = {
            cell: int(store.scores[keys[cell]]["gpu_bytes"]) for cell in held if cell in lacking or cell not in timed
        }
        about = {"reference_key": reference, "machine": self._machine}
        steps = 0
        with self.profile.of("waiting"):
            for timing in time_cells(self._stage, block, sizes, lacking) if sizes else ():
                if isinstance(timing, Untimed):
                    lost = "no time" if timing.cell in sizes else "no ratios to this reference"
                    spec = format_spec(timing.cell.spec)
                    self.reporter.note(f"{block.scene.name} {spec}: {lost}: {timing.reason}")
                    if timing.cell in sizes:
                        untimed[timing.cell] = timing.reason
                else:
                    record = {"kind": "time", "key": keys[timing.cell], **about, **timing.record()}
                    with self.profile.of("files"):
                        store.append(record)
                if timing.cell in sizes:
                    steps += 1
                    self.reporter.step(f"{block.scene.name}: timed")
        for _ in range(len(wanted) - steps):
            self.reporter.step(f"{block.scene.name}: nothing to time")
        return untimed

    def _time(self, key: str) -> Record | None:
        """The time record of a key; one of another machine may not stand beside this one's."""
        row = self._store.times.get(key)
        return row if row is not None and row.get("machine") == self._machine else None

    def _is_timed(self, row: Record | None, reference: str) -> bool:
        """Whether a time record is as good as this study asks for: as many rounds, the same reference, this machine."""
        if row is None or row["n"] < self.study.rounds or "reference_ms" not in row:
            return False
        return bool(row.get("reference_key") == reference and row.get("machine") == self._machine)

    def _write_truth(self, view: View, truth: Truth) -> None:
        """Where they differ: a scene that is as it was again measures nothing, but another text's truth is there."""
        folder = self._made("truth")
        for name, mask in ((view.name, truth.visibility), (f"{view.name}.undecided", truth.undecided.astype(float))):
            if not _shows(folder / f"{name}.png", mask):
                write_mask(folder / f"{name}.png", mask)

    def _made(self, name: str) -> Path:
        folder = self.folder / name
        folder.mkdir(exist_ok=True)
        return folder


def identity(study: Study, block: Block, cell: Cell) -> CellIdentity:
    """What names a cell for people and for `check`, whatever its sources."""
    return {
        "scene": block.scene.name,
        "view": block.view.camera.name,
        "light": block.view.light.name,
        "phase": cell.phase,
        "technique": cell.spec.technique.name,
        "spec": format_spec(cell.spec, size=False),
        "full_spec": format_spec(cell.spec, full=True),
        "map_size": cell.spec.map_size,
        "view_size": study.view_size,
        "coordinates": study.coordinates,
    }


def write_picture(file: Path, picture: NDArray[np.uint8]) -> None:
    """A (H, W, 3) sRGB or (H, W) grey image as a PNG."""
    with replace_file(file) as beside:
        Image.fromarray(picture).save(beside, format="PNG", compress_level=1)


def _shows(file: Path, mask: NDArray[np.floating]) -> bool:
    try:
        return mask_sha256(read_mask(file)) == mask_sha256(mask)
    except InputError:  # absent, or no mask
        return False


def _is_done(row: Record | None) -> bool:
    """A cell that failed is tried again: what killed it may have been the machine."""
    return row is not None and not row["status"].startswith("failed")


def _lacks_ratio(row: Record | None) -> bool:
    """Whether a time has no ratio although its reference may answer by now: one that is unsupported never will."""
    return row is not None and row["ratio"] is None and not row["no_ratio"].startswith("unsupported")
