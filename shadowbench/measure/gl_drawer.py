"""Cells drawn by OpenGL: calls of a worker process, and the groups of cells that are timed together."""

from collections.abc import Callable, Iterator, Mapping
from typing import Any, Concatenate

import numpy as np
from numpy.typing import NDArray

from shadowbench.errors import InputError, ShadowbenchError, Unsupported
from shadowbench.measure.cells import Block, Cell, reference_for, reference_name
from shadowbench.measure.failures import CellFailed, Limits, MemoryExceeded, status_of
from shadowbench.measure.rendering import Rendering
from shadowbench.measure.session import CellRequest, DeviceInfo, Session
from shadowbench.measure.time_rows import Times, Timing
from shadowbench.measure.worker import P, R, Worker
from shadowbench.plugin.spec import Spec
from shadowbench.plugin.stage import ShaderText
from shadowbench.scenes.model import View
from shadowbench.techniques.unshadowed import Unshadowed

_GROUP_SHARE = 0.5  # share of the memory limit for the cells of a group
_CELL_SHARE = 0.5  # share of the memory limit for the textures and buffers of a cell
_KEPT_SHARE = 0.25  # share of the memory limit for cells that were drawn and wait to be timed
_FLOOR = Cell(Spec(Unshadowed, Unshadowed.Params()))


class GLDrawer:
    """Drawer of a worker process."""

    def __init__(self, worker: Worker) -> None:
        self.worker = worker

    @property
    def limits(self) -> Limits:
        """Limits of each call to the worker."""
        return self.worker.limits

    @property
    def info(self) -> DeviceInfo:
        """Facts about the worker's device."""
        return self.worker.info

    @property
    def identity(self) -> Mapping[str, str]:
        """The renderer, and how Embree rounds on this computer, which traces for some techniques and for the truth."""
        from shadowbench.truths.embree import answers_digest

        return {"renderer": self.info.renderer, "embree": answers_digest()}

    @property
    def machine(self) -> Mapping[str, Any]:
        """This computer."""
        from shadowbench.measure.machine import machine  # the worker's start does not wait for this import

        return machine()

    def _request(self, block: Block, cell: Cell) -> CellRequest:
        room = int(_CELL_SHARE * self.limits.bytes)
        return CellRequest(cell.spec.full_text, cell.phase, block.coordinates, room)

    def unsupported(self, block: Block, cell: Cell) -> str | None:
        """See `Drawer`."""
        return self.worker.call(Session.unsupported, block.view, self._request(block, cell))

    def draw(self, block: Block, cell: Cell, keep: bool = False) -> Iterator[Rendering]:
        """See `Drawer`. In a new worker if memory runs out."""
        room = int(_KEPT_SHARE * self.limits.bytes) if keep else 0
        for view in block.views:
            try:
                yield self.worker.call(Session.draw, view, self._request(block, cell), keep=room)
            except MemoryExceeded:
                # Cells kept for timing may have taken the memory, or what the driver has not yet freed of earlier ones.
                yield self.worker.call(Session.draw, view, self._request(block, cell))

    def surface(self, block: Block) -> NDArray[np.int32]:
        """See `Drawer`."""
        return self.worker.call(Session.surface, block.view, block.coordinates)

    def shading(self, block: Block) -> tuple[NDArray[np.uint8], NDArray[np.uint8]]:
        """See `Drawer`."""
        return self.worker.call(Session.shading, block.view, block.coordinates)

    def shaders(self, block: Block, cell: Cell) -> list[ShaderText]:
        """See `Drawer`."""
        return self.worker.call(Session.shaders, block.view, self._request(block, cell))

    def time(self, block: Block, sizes: Mapping[Cell, int], retried: Mapping[Cell, int]) -> Iterator[Timing]:
        """See `Drawer`. Timed in groups that fit in memory, each with the reference and `unshadowed`."""
        reference: Cell | None = reference_cell(block)
        no_ratio = None
        if reference not in sizes:
            assert reference is not None
            try:  # now, so that a failing reference does not fail every group
                self.worker.call(Session.draw, block.view, self._request(block, reference))
            except (CellFailed, Unsupported) as reason:
                yield Timing(reference, failed=str(reason))
                reference, no_ratio = None, status_of(reason)
        wanted = {**sizes, **(retried if reference else {})}
        limit = _GROUP_SHARE * self.limits.bytes
        group: list[Cell] = []
        group_bytes = 0
        for cell, size in wanted.items():
            if group and group_bytes + size > limit:
                yield from self._time_group(block, group, reference, no_ratio)
                group, group_bytes = [], 0
            group.append(cell)
            group_bytes += size
        yield from self._time_group(block, group, reference, no_ratio)

    def _time_group(
        self, block: Block, group: list[Cell], reference: Cell | None, no_ratio: str | None
    ) -> Iterator[Timing]:
        """Time one group together. A cell that fails is dropped, and the rest is timed again without it."""
        name = reference_name(reference_cell(block).spec)
        retried = False
        while group:
            cells = list(dict.fromkeys([_FLOOR, *([reference] if reference else []), *group]))
            try:
                times = self._measure(block, cells)
            except _GroupFailed as failure:
                self._release_timed()
                failed_cell = failure.cell
                together = failed_cell is not None and len(group) > 1
                if together and isinstance(failure.reason, MemoryExceeded):  # perhaps not its own fault
                    middle = len(group) // 2
                    yield from self._time_group(block, group[:middle], reference, no_ratio)
                    yield from self._time_group(block, group[middle:], reference, no_ratio)
                    return
                if failed_cell is not None and isinstance(failure.reason, MemoryExceeded) and not retried:
                    retried = True  # the worker may have held memory of earlier cells; a fresh one has none
                    continue
                if failed_cell is None or failed_cell not in (*group, reference):  # no other can be left out
                    what = "opening the view" if failed_cell is None else "the floor, unshadowed"
                    yield from (Timing(cell, failed=f"{what}: {failure}") for cell in group)
                    return
                yield Timing(failed_cell, failed=str(failure))
                group = [cell for cell in group if cell != failed_cell]
                if reference == failed_cell:
                    reference, no_ratio = None, status_of(failure.reason)
                continue
            for cell in group:
                yield Timing(cell, times[cell], times[_FLOOR], name, times[reference] if reference else None, no_ratio)
            return

    def _measure(self, block: Block, cells: list[Cell]) -> dict[Cell, Times]:
        """Prepare all cells, then time them in turn: whole frames in each round, passes in a third as many."""
        indices = range(len(cells))

        def call(
            index: int | None, method: Callable[Concatenate[Session, P], R], *arguments: P.args, **options: P.kwargs
        ) -> R:
            try:
                return self.worker.call(method, *arguments, **options)
            except (CellFailed, Unsupported) as reason:
                raise _GroupFailed(None if index is None else cells[index], reason) from None

        def sample() -> list[Times]:
            frames = [[call(n, Session.time_frame, n) for n in indices] for _ in range(block.rounds)]
            passes = [[call(n, Session.time_passes, n) for n in indices] for _ in range(max(block.rounds // 3, 1))]
            return [Times([row[n] for row in frames], [row[n] for row in passes], prepare_ms[n]) for n in indices]

        call(None, Session.open, block.view, block.coordinates)
        prepare_ms = [call(n, Session.prepare_timing, block.view, self._request(block, cells[n])) for n in indices]
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
    """Raised when timing a group fails; cell: the one that failed, None if opening the view did."""

    def __init__(self, cell: Cell | None, reason: CellFailed | Unsupported) -> None:
        super().__init__(str(reason))
        self.cell = cell
        self.reason = reason


def reference_cell(block: Block) -> Cell:
    """The cell that times in a block are divided by."""
    return Cell(reference_for(block.reference, block.view.light.hard_kind))


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
