"""The one way to make rows: blocks of cells are drawn, scored against their truths and timed, into a folder."""

import logging
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from functools import cache, partial
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Any, Literal, Protocol, Self
from weakref import WeakKeyDictionary

from shadowbench import versions
from shadowbench.errors import InputError, MetricError, Unsupported, message, quoted
from shadowbench.files import check_folder
from shadowbench.maps.updates import Update
from shadowbench.measure.frames import CellScores, Truths
from shadowbench.measure.keys import cell_key, joint_key, view_key
from shadowbench.measure.machine import machine_key, write_run_file
from shadowbench.measure.pictures import Background, Pictures
from shadowbench.measure.rows import Record, Result, RowStore, identity
from shadowbench.measure.time_rows import time_row
from shadowbench.measure.worker import CellFailed
from shadowbench.plugin.spec import Spec
from shadowbench.scenes.model import Coordinates, LightKind, View
from shadowbench.techniques.cube_map import CubeMap
from shadowbench.techniques.shadow_map import ShadowMap
from shadowbench.techniques.unshadowed import Unshadowed
from shadowbench.truths.cache import cached_truth

if TYPE_CHECKING:
    from shadowbench.measure.gl_drawer import GLDrawer

DEFAULT_REFERENCE = Spec(ShadowMap, ShadowMap.Params(size=1024))
"""Reference of a study that names none."""

UNSHADOWED = Spec(Unshadowed, Unshadowed.Params())
_SUBSTITUTES: Mapping[LightKind, Spec] = {"point": Spec(CubeMap, CubeMap.Params(size=1024))}


@dataclass(frozen=True)
class Cell:
    """One measurement: a spec at one phase.

    home: on an axis of `stress`, the spec that the axis varies, which its row names; None elsewhere.
    """

    spec: Spec
    phase: int = 0
    home: Spec | None = None

    @property
    def skips_draws(self) -> bool:
        """Whether it draws its map in some frames only, so that the time of one frame is not that of another."""
        return any(isinstance(component, Update) and component.remembers for component in self.spec.components)


@dataclass(frozen=True, eq=False)
class Block:
    """A view, or the frames of a sequence in order, and the cells that are drawn in them.

    coordinates: in which the views are drawn; rounds: how often each cell is timed, in the first view, 0 for no timing;
    reference: spec that times are divided by; place: fields of the rows that tell the sequence, or where on an axis the
    block lies.
    """

    views: tuple[View, ...]
    cells: tuple[Cell, ...]
    coordinates: Coordinates = "relative"
    rounds: int = 0
    reference: Spec = DEFAULT_REFERENCE
    place: Mapping[str, Any] = field(default_factory=dict)

    @property
    def view(self) -> View:
        """The view, or the first frame."""
        return self.views[0]

    @property
    def reference_cell(self) -> Cell:
        """The cell that times are divided by: if `reference` does not support the light, `cube-map` or `unshadowed`."""
        kind = self.view.light.hard_kind
        supported = kind in self.reference.technique.lights
        return Cell(self.reference if supported else _SUBSTITUTES.get(kind, UNSHADOWED))

    def times(self, cell: Cell) -> bool:
        """Whether a cell is timed. Other phases than 0 have other errors but the same cost; engines have none here."""
        return self.rounds > 0 and cell.phase == 0 and cell.spec.technique.own and not cell.skips_draws


def reference_name(reference: Spec) -> str:
    """Name of a reference in rows, with its map size even if that is the default: `shadow-map:size=1024`."""
    name = reference.sizeless_text
    return name if reference.map_size is None else f"{name}{',' if ':' in name else ':'}size={reference.map_size}"


def status_of(reason: CellFailed | Unsupported) -> str:
    """Row status of a cell that was unsupported or failed."""
    return f"{'unsupported' if isinstance(reason, Unsupported) else 'failed'}: {reason}"


@dataclass(frozen=True)
class Failure:
    """What failed as a whole and was left out; what: `scene`, `truth`, `cells` or `axis`; where: its name."""

    what: str
    where: str
    reason: str


Shadows = Literal["lit", "in shadow", "with edges"]
"""What a view shows: whether all that is decided is lit, or in shadow."""

_log = logging.getLogger("shadowbench")
_FILMS = 4  # cells of a block whose frames are kept as a film


class Reporter(Protocol):
    """Receiver of progress messages, which are logged unless it does something else."""

    def note(self, line: str) -> None:
        """Show one line to the user."""
        _log.info(line)

    def stage(self, name: str, total: int | None) -> None:
        """Begin a stage of `total` steps, None if unknown."""
        _log.debug("%s: %s", name, total)

    def step(self, what: str) -> None:
        """Count one step of the stage as done."""
        _log.debug(what)


class LogReporter(Reporter):
    """Reporter that logs progress."""


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
        drawer: "GLDrawer",
        reporter: Reporter,
        *,
        keeps_images: Callable[[Record], object] | None = None,
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
        self._truths: Truths | None = None  # of the last block

    def __enter__(self) -> Self:
        self.store = RowStore(self.folder, self._sweep)
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self.store.close()
        if self._truths is not None:
            self._truths.close()

    def trace(self, blocks: Sequence[Block]) -> list[Shadows | None]:
        """What each block's view shows, whose truth is in the cache then; None for one that fails, if it keeps going.

        Raises InputError for a view that shows nothing. The campaign need not be entered yet: nothing is written.
        """
        self.reporter.stage("truth", len(blocks))
        shows: list[Shadows | None] = [None] * len(blocks)
        for index, result in self._map(trace_view, [block.view for block in blocks]):
            name = blocks[index].view.name
            with self._attempt("truth", name):
                shows[index] = result()
            self.reporter.step(name)
        return shows

    def measure(self, blocks: Iterable[Block]) -> Iterator[list[Result]]:
        """Results of each block's cells, measured now or found. Reports a step for each cell, and one when it is timed.

        Cells of a block that failed are left out if the campaign keeps going.
        """
        for block in blocks:
            with self._attempt(*called(block)):
                self._score(block)
                self._time(block)
            yield self.results(block)

    def results(self, block: Block) -> list[Result]:
        """Rows of a block's cells, without those that have none."""
        scores, machine = self.store.scores, machine_key(self.drawer)
        found = [key for key in self.keys(block).values() if key in scores]
        return [Result(scores[key], self.store.time_on(machine, key)) for key in found]

    def keys(self, block: Block) -> dict[Cell, str]:
        """Keys of the rows of a block's cells."""
        if block not in self._keys:
            views = [view_key(view) for view in block.views]
            self._keys[block] = {
                cell: joint_key(
                    [cell_key(cell, view, block.coordinates, self.drawer.identity(cell)) for view in views],
                    [versions.MOTION if len(views) > 1 else None, dict(block.place), cell.home and cell.home.text],
                )
                for cell in block.cells
            }
        return self._keys[block]

    def unscored(self, block: Block) -> dict[Cell, str]:
        """Keys of the cells of a block that will be drawn: those without a row, and those that failed."""
        return {cell: key for cell, key in self.keys(block).items() if self.store.finished_score(key) is None}

    def finish(self, study: Record, notes: Sequence[str], keys: Iterable[str]) -> None:
        """Write `run.json`; keys: of the cells that the command asked for."""
        write_run_file(self.folder / "run.json", self.drawer, notes, study, keys)

    def _map(self, task: Callable[..., Any], *jobs: Sequence[Any]) -> Iterable[tuple[int, Callable[[], Any]]]:
        """The index of each job, and what gives or raises the result of the task for it."""
        return enumerate(partial(task, *job) for job in zip(*jobs, strict=True))

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
        """Make the score rows that are missing: each frame is scored, and each row written, while the next is drawn."""
        missing, view, pictures = self.unscored(block), block.view, self._pictures
        if self._truths is None or self._truths.views != block.views:
            if self._truths is not None:
                self._truths.close()
            self._truths = Truths(block.views)
        truths, keeps = self._truths, self._keeps_images
        surface = cache(partial(self.drawer.surface, block))

        @cache
        def write_view() -> None:
            pictures.write_truth(view, truths.first)
            pictures.write_shading(view, surface())

        def finish(row: Record, scores: CellScores) -> None:
            row = self._scored(block, row, scores)
            if row["status"] == "ok" and (keeps is None or keeps(row)):
                write_view()
                pictures.write_cell(row["key"], scores.first)
                pictures.write_film(row["key"], scores.film)
            self.store.append(row)  # after the images, which its presence promises

        with Background() as background:
            if keeps is None:
                background.add(lambda: pictures.write_truth(view, truths.first))
            for cell, key in missing.items():
                row, will_be_timed = self._row(block, cell, key), block.times(cell)
                filmed = keeps is None and len(block.views) > 1 and cell in block.cells[:_FILMS]
                scores = CellScores(truths, filmed)
                background.finish()  # which bounds the images in memory
                try:
                    triangle = surface().triangle  # of the first frame, and before: the worker draws frames in order
                    if will_be_timed:
                        self.drawer.build(block, cell)
                    frames = self.drawer.draw(block, cell, keep=will_be_timed)
                    for index in range(len(block.views)):
                        background.begin()
                        drawn = next(frames)
                        background.finish()
                        background.add(
                            partial(scores.add, drawn, triangle if index == 0 and cell.spec.technique.own else None)
                        )
                except (Unsupported, CellFailed) as reason:
                    background.add(partial(self.store.append, {**row, "status": status_of(reason)}))
                else:
                    background.add(partial(finish, row, scores))
                self.reporter.step(f"{view.scene.name} {cell.spec.text}")
        for _ in range(len(block.cells) - len(missing)):
            self.reporter.step(f"{view.scene.name}: measured before")

    def _row(self, block: Block, cell: Cell, key: str) -> Record:
        """What a cell's score row says before it is drawn."""
        spec = cell.spec
        row: dict[str, Any] = {"kind": "score", "key": key}
        row |= identity(block.view, spec.technique.name, spec.sizeless_text, spec.full_text)
        row |= {"phase": cell.phase, "map_size": spec.map_size, "coordinates": block.coordinates, **block.place}
        row |= {"home_spec": cell.home.text} if cell.home else {}
        return row | {"renderer": self.drawer.info.renderer}

    def _scored(self, block: Block, row: Record, scores: CellScores) -> Record:
        """A cell's score row, of a cell that was drawn."""
        try:
            row = {**row, "status": "ok", **scores.record()}
        except MetricError as error:
            return {**row, "status": f"failed: {error}"}
        scene, engine = block.view.scene, scores.first.engine
        row |= {"triangles": scene.geometry.count, "assumptions": list(scene.notes)}
        return row | ({"engine": dict(engine)} if engine else {})

    def _time(self, block: Block) -> None:
        """Time the successful cells that lack a time, or a ratio since their reference failed."""
        for spec in {cell.spec.sizeless_text: None for cell in block.cells if block.rounds and cell.skips_draws}:
            self.reporter.note(f"{spec}: not timed, as some frames draw no map")
        wanted = {cell: key for cell, key in self.keys(block).items() if block.times(cell)}
        if not wanted:
            return
        name, machine = block.view.scene.name, machine_key(self.drawer)
        reference = self.keys(replace(block, cells=(block.reference_cell,)))[block.reference_cell]
        lacking = {cell: key for cell, key in wanted.items() if self._lacks_time(key, block.rounds, reference)}
        sizes = {cell: int(self.store.scores[key]["gpu_bytes"]) for cell, key in lacking.items()}
        for cell, times in self.drawer.time(block, sizes) if sizes else ():
            if isinstance(times, str):
                what = "no time" if cell in sizes else "no ratios to this reference"
                self.reporter.note(f"{name} {cell.spec.text}: {what}: {times}")
            if cell in sizes:
                self.store.append(time_row(times, wanted[cell], reference, machine))
                self.reporter.step(f"{name}: timed")
        for _ in range(len(wanted) - len(lacking)):
            self.reporter.step(f"{name}: nothing to time")

    def _lacks_time(self, key: str, rounds: int, reference: str) -> bool:
        """Whether a cell was scored but not timed here in so many rounds, or has no ratio to this reference."""
        time = self.store.time_on(machine_key(self.drawer), key)
        if self.store.scores[key]["status"] != "ok":
            return False
        if self._time_again or time is None or time.get("n", 0) < rounds or time.get("reference_key") != reference:
            return True
        return time["ratio"] is None and not time["no_ratio"].startswith("unsupported")


def trace_view(view: View) -> Shadows:
    """What a view shows, whose truth is in the cache then."""
    truth = cached_truth(view)
    visibility = truth.visibility[truth.receivers & ~truth.undecided]
    if not (visibility < 1).any():
        return "lit"
    return "with edges" if visibility.any() else "in shadow"


def called(block: Block) -> tuple[str, str]:
    """What a block is, and its name, for a user who reads that it failed."""
    place = block.place
    return ("axis", f"{place['axis']} {place['light_kind']}") if "axis" in place else ("cells", block.view.name)
