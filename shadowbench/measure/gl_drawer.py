"""Cells drawn by OpenGL: calls of a worker process, groups of cells that are timed together, and campaigns of them."""

import atexit
import os
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager, suppress
from functools import cache
from importlib.metadata import entry_points
from itertools import islice
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Concatenate

from shadowbench.errors import InputError, ShadowbenchError, Unsupported
from shadowbench.files import PACKAGE
from shadowbench.measure.campaign import (
    UNSHADOWED,
    Block,
    Campaign,
    Cell,
    LogReporter,
    Reporter,
    reference_name,
    status_of,
)
from shadowbench.measure.pictures import Rendering, Surface
from shadowbench.measure.session import CellRequest, Session
from shadowbench.measure.time_rows import Samples, Times
from shadowbench.measure.worker import CellFailed, DeviceInfo, Limits, MemoryExceeded, P, R, Worker
from shadowbench.plugin.spec import Spec
from shadowbench.plugin.stage import ShaderText
from shadowbench.scenes.model import View

_GROUP_SHARE = 0.5  # share of the memory limit for the cells of a group
_CELL_SHARE = 0.5  # share of the memory limit for the textures and buffers of a cell
_KEPT_SHARE = 0.25  # share of the memory limit for cells that were drawn and wait to be timed
_FLOOR = Cell(UNSHADOWED)
DRAWERS = "shadowbench.drawers"  # group of entry points


@contextmanager
def drawer_of(worker: Worker) -> Iterator["GLDrawer"]:
    """The drawer of a worker's techniques, inside those that entry points name: they draw what is not ours."""
    with ExitStack() as stack:
        drawer = GLDrawer(worker)
        for point in entry_points(group=DRAWERS):
            drawer = stack.enter_context(point.load()(drawer))
        yield drawer


class GLDrawer:
    """What draws cells, by calls of a worker process that has limits and is replaced after a failure.

    identity, machine: of a worker elsewhere.
    """

    def __init__(
        self, worker: Worker, identity: Mapping[str, str] | None = None, machine: Mapping[str, Any] | None = None
    ) -> None:
        self.worker, self._identity, self._machine = worker, identity, machine

    @property
    def info(self) -> DeviceInfo:
        """Facts about the worker's device."""
        return self.worker.info

    def identity(self, cell: Cell) -> Mapping[str, str]:
        """What draws a cell and traces, by which keys of rows differ: the renderer, and how Embree rounds there."""
        assert cell.spec.drawn_here
        return self.device_identity

    @property
    def device_identity(self) -> Mapping[str, str]:
        """The renderer, and how Embree rounds on this computer, which traces for some techniques and for the truth."""
        from shadowbench.truths.embree import answers_digest

        return self._identity or {"renderer": self.info.renderer, "embree": answers_digest()}

    @property
    def machine(self) -> Mapping[str, Any]:
        """The computer, as by `measure.machine.machine`."""
        from shadowbench.measure.machine import machine  # the worker's start does not wait for this import

        return self._machine or machine()

    def _request(self, block: Block, cell: Cell) -> CellRequest:
        room = int(_CELL_SHARE * self.worker.limits.bytes)
        return CellRequest(cell.spec.full_text, cell.phase, block.coordinates, room)

    def build(self, block: Block, cell: Cell) -> None:
        """Build a cell that will be drawn and then timed, as its build is: nothing else may run. Raises as `draw`."""
        with suppress(MemoryExceeded):  # `draw` builds it again, in a new worker
            self.worker.call(Session.build, block.view, self._request(block, cell))

    def draw(self, block: Block, cell: Cell, keep: bool = False) -> Iterator[Rendering]:
        """A cell drawn in each view of a block, in their order. Raises Unsupported and CellFailed.

        keep: it will be timed, so that what `build` made stays if there is room. If memory runs out, it is drawn
        in a new worker, from the first view on, as it may remember those before.
        """
        room, drawn = int(_KEPT_SHARE * self.worker.limits.bytes) if keep else 0, 0
        try:
            for rendering in self._frames(block, cell, room):
                yield rendering
                drawn += 1
        except MemoryExceeded:
            # Cells kept for timing may have taken the memory, or what the driver has not yet freed of earlier ones.
            yield from islice(self._frames(block, cell, 0), drawn, None)

    def _frames(self, block: Block, cell: Cell, room: int) -> Iterator[Rendering]:
        request = self._request(block, cell)
        for index, view in enumerate(block.views):
            yield self.worker.call(Session.draw, view, request, keep=room, index=index)

    def surface(self, block: Block) -> Surface:
        """What masks of a block's view are drawn over. Raises CellFailed."""
        return self.worker.call(Session.surface, block.view, block.coordinates)

    def shaders(self, block: Block, cell: Cell) -> list[ShaderText]:
        """GLSL of a cell as passed to the driver, with all includes and defines resolved. Raises as `draw` does."""
        return self.worker.call(Session.shaders, block.view, self._request(block, cell))

    def time(self, block: Block, sizes: Mapping[Cell, int]) -> Iterator[tuple[Cell, Times | str]]:
        """Times of cells of a block, or why one has none; sizes: their GPU bytes. Also why a reference failed.

        They are timed in groups that fit in memory, each with the reference and `unshadowed`. A cell that fails is
        dropped, and the rest of its group is timed again without it. Where memory runs out, each is timed alone.
        """
        name, no_ratio = reference_name(block.reference_cell.spec), None
        reference = [block.reference_cell]
        if reference[0] not in sizes:
            try:  # now, so that a failing reference does not fail every group
                self.worker.call(Session.draw, block.view, self._request(block, reference[0]))
            except (CellFailed, Unsupported) as reason:
                yield reference[0], str(reason)
                reference, no_ratio = [], status_of(reason)
        groups, alone = _groups(sizes, _GROUP_SHARE * self.worker.limits.bytes), set[Cell]()
        while groups:
            group = groups.pop(0)
            try:
                times = self._measure(block, list(dict.fromkeys([_FLOOR, *reference, *group])))
            except _GroupFailed as failure:
                self._release_timed()
                failed = failure.cell
                if isinstance(failure.reason, MemoryExceeded) and not (len(group) == 1 and failed in alone):
                    # Also if it was alone: the worker may have held memory of earlier cells, and a new one has none.
                    alone |= {failed} if len(group) == 1 else set()
                    groups[:0] = [[cell] for cell in group]
                elif failed not in (*group, *reference):  # no other can be left out
                    yield from ((cell, f"the floor, unshadowed: {failure}") for cell in group)
                else:
                    yield failed, str(failure)
                    if failed in reference:
                        reference, no_ratio = [], status_of(failure.reason)
                    if left := [cell for cell in group if cell != failed]:
                        groups.insert(0, left)
            else:
                of_reference = times[reference[0]] if reference else None
                for cell in group:
                    yield cell, Times(times[cell], times[_FLOOR], name, of_reference, no_ratio)

    def _measure(self, block: Block, cells: list[Cell]) -> dict[Cell, Samples]:
        """Prepare all cells, then time them in turn: whole frames in each round, passes in a third as many."""
        indices = range(len(cells))

        def call(
            index: int, method: Callable[Concatenate[Session, P], R], *arguments: P.args, **options: P.kwargs
        ) -> R:
            try:
                return self.worker.call(method, *arguments, **options)
            except (CellFailed, Unsupported) as reason:
                raise _GroupFailed(cells[index], reason) from None

        def sample() -> list[Samples]:
            frames = [[call(n, Session.time_frame, n) for n in indices] for _ in range(block.rounds)]
            passes = [[call(n, Session.time_passes, n) for n in indices] for _ in range(max(block.rounds // 3, 1))]
            return [Samples([row[n] for row in frames], [row[n] for row in passes], prepare_ms[n]) for n in indices]

        prepare_ms = [call(n, Session.prepare_timing, block.view, self._request(block, cells[n])) for n in indices]
        call(0, Session.raise_clocks)
        times = sample()
        if any(len(cell.clocks) > 1 for cell in times):  # the clock gave up timer queries midway, for good
            times = sample()
        self._release_timed()
        return dict(zip(cells, times, strict=True))

    def _release_timed(self) -> None:
        """Release the cells prepared for timing; a session that fails even at that is killed."""
        try:
            self.worker.call(Session.release_timed)
        except CellFailed:
            self.worker.stop()


class _GroupFailed(Exception):
    """Raised when timing a cell of a group fails."""

    def __init__(self, cell: Cell, reason: CellFailed | Unsupported) -> None:
        super().__init__(str(reason))
        self.cell, self.reason = cell, reason


def _groups(sizes: Mapping[Cell, int], limit: float) -> list[list[Cell]]:
    """Cells in groups of at most `limit` bytes each, or of a single cell."""
    groups: list[list[Cell]] = []
    total = limit
    for cell, size in sizes.items():
        if not groups or total + size > limit:
            groups.append([])
            total = 0
        groups[-1].append(cell)
        total += size
    return groups


def render(
    view: View, spec: Spec, worker: Worker, *, name: str, with_map: bool = False, tint: bool = False
) -> Rendering:
    """Draw a view with a technique.

    name: the spec in error messages; with_map: return the shadow map too, if the technique has one; tint: colour the
    picture by the technique's debug colours, such as cascades. Raises InputError for a map larger than the device
    allows and for a view that the technique does not support; ShadowbenchError if it fails.
    """
    largest = worker.info.max_map_size
    if (spec.map_size or 0) > largest:
        raise InputError(f"map size {spec.map_size}: this device allows 1 to {largest}")
    try:
        return worker.call(Session.draw, view, CellRequest(spec.full_text), with_map=with_map, tinted=tint)
    except Unsupported as reason:
        raise InputError(f"{name} does not support {view.scene.name}: {reason}") from None
    except CellFailed as reason:
        raise ShadowbenchError(f"{name} on {view.scene.name} failed: {reason}") from None


_lock = threading.RLock()
_shared: dict[tuple[tuple[Path, ...], Limits], Worker] = {}  # at most one


def close() -> None:
    """End the worker process, after the calls of other threads; the next drawing call starts another."""
    with _lock:
        _end_workers()


@atexit.register
def _end_workers() -> None:  # without the lock: a daemon thread's call is not waited for
    while _shared:
        _shared.popitem()[1].stop()


@contextmanager
def shared_worker(plugins: tuple[Path, ...], limits: Limits | None = None) -> Iterator[Worker]:
    """The worker process that all calls share, started with the plug-ins and limits of the last one; by turns."""
    settings = plugins, limits or Limits()
    with _lock:
        if settings not in _shared:
            _end_workers()
            _shared[settings] = Worker(*settings)
        yield _shared[settings]


@cache
def compile_beside() -> None:
    """Compile half of the loops in a process beside, unless a score was computed before, or Numba caches elsewhere."""
    folder, quiet = PACKAGE / "scores" / "__pycache__", subprocess.DEVNULL
    here = "NUMBA_CACHE_DIR" not in os.environ and os.access(folder.parent, os.W_OK)
    if here and not any(folder.glob("loops.ssim_map-*.nbi")):
        command = [sys.executable, "-P", "-m", "shadowbench.measure.session"]
        atexit.register(subprocess.Popen(command, stdin=quiet, stdout=quiet, stderr=quiet).poll)


def _import_beside(scores: bool) -> None:
    """Import what tables need, and scores, which takes a second, while the worker starts."""
    import pandas  # noqa: F401

    if scores:
        from shadowbench.scores import loops  # noqa: F401


@contextmanager
def campaign_in(
    folder: Path | None,
    reporter: Reporter | None = None,
    plugins: Sequence[Path] = (),
    limits: Limits | None = None,
    *,
    worker: Worker | None = None,
    dask: str | None = None,
    renderer: str | None = None,
    **options: Any,
) -> Iterator[Campaign]:
    """A campaign in a folder, a temporary one for None; without a reporter it logs its progress.

    worker: the one that draws, else one of its own, with these plug-ins and limits; dask, renderer: a cluster that
    measures instead, and the renderer of its workers; options: see `Campaign`.
    """
    compile_beside()
    # Where there are rows, nothing may be left to score.
    threading.Thread(target=_import_beside, args=[folder is None or not (folder / "rows.jsonl").exists()]).start()
    with ExitStack() as stack:
        if folder is None:
            folder = Path(stack.enter_context(TemporaryDirectory(prefix="shadowbench-")))
        reporter = reporter or LogReporter()
        if dask is not None:
            from shadowbench.measure.dask_blocks import dask_campaign

            setup = tuple(plugin.resolve() for plugin in plugins), limits or Limits()
            yield stack.enter_context(dask_campaign(folder, dask, renderer, setup, reporter, **options))
            return
        here = worker or stack.enter_context(Worker(plugins, limits))
        yield Campaign(folder, stack.enter_context(drawer_of(here)), reporter, **options)
