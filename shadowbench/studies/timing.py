"""Timing a block: groups of cells that fit the memory, each with its own reference and floor, and the statistics."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from shadowbench.gl.clock import PassTimes
from shadowbench.studies.session import CellRequest, Unsupported
from shadowbench.studies.study import Block, Cell, Study
from shadowbench.studies.worker import AteMemory, CellFailed, Worker
from shadowbench.techniques.spec import Spec, format_spec
from shadowbench.techniques.unshadowed import Unshadowed

_SHARE = 0.5  # of the memory limit that the cells of a group may take together


def request_of(cell: Cell) -> CellRequest:
    """A cell as the worker takes it."""
    return CellRequest(format_spec(cell.spec, full=True), cell.phase)


class BlockStage:
    """Keeps the worker at a block's view, also after it was replaced."""

    def __init__(self, worker: Worker, study: Study) -> None:
        self.worker, self.study = worker, study
        self._scene: tuple[int, object] | None = None
        self._view: tuple[int, object] | None = None
        self._surface: NDArray[np.int32] | None = None

    def open(self, block: Block) -> NDArray[np.int32]:
        """The G-buffer's triangle ids of the block's view, (N, N), row 0 at the top."""
        self.worker.ready()
        generation, view = self.worker.generation, block.view
        if self._scene != (generation, view.scene):
            self.worker.call("load", view.scene, self.study.coordinates)
            self._scene, self._view = (generation, view.scene), None
        if self._view != (generation, view) or self._surface is None:
            self._surface = self.worker.call("open", view.camera, view.light, view.size)
            self._view = (generation, view)
        return self._surface


@dataclass(frozen=True, eq=False)
class Times:
    """Milliseconds of a cell, a value a round. Frames and passes come from different rounds."""

    frames: list[float]
    passes: list[PassTimes]
    prepare_ms: float
    clock: str


@dataclass(frozen=True, eq=False)
class Timing:
    """What a cell took, beside the reference and the floor of its own group."""

    cell: Cell
    times: Times
    reference: str
    reference_times: Times | None
    floor: Times

    def record(self) -> dict[str, Any]:
        """The time record: milliseconds as medians with their IQR; ratios are medians over rounds of one group."""
        frames = np.array(self.times.frames)
        frame_ms, frame_iqr = _median_iqr(frames)
        record: dict[str, Any] = {
            "clock": self.times.clock,
            "n": len(frames),
            "frame_ms": frame_ms,
            "frame_iqr_ms": frame_iqr,
            "added_ms": float(np.median(frames - np.array(self.floor.frames))),
            "reference": self.reference,
            "ratio": None,
            "ratio_iqr": None,
            "prepare_ms": self.times.prepare_ms,
            "passes": self._passes(),
        }
        if self.reference_times is not None:
            ratios = frames / np.array(self.reference_times.frames)
            record["ratio"], record["ratio_iqr"] = _median_iqr(ratios)
        return record

    def _passes(self) -> dict[str, dict[str, Any]]:
        rounds = self.times.passes
        found = {}
        for name, changes in rounds[0].changes.items():
            ms, iqr_ms = _median_iqr(np.array([passes.ms[name] for passes in rounds]))
            found[name] = {"ms": ms, "iqr_ms": iqr_ms, "n": len(rounds), "changes": changes}
        return found


@dataclass(frozen=True, eq=False)
class Untimed:
    """A cell that could not be timed, and why."""

    cell: Cell
    reason: str


def time_cells(stage: BlockStage, block: Block, sizes: Mapping[Cell, int]) -> Iterator[Timing | Untimed]:
    """Time cells of one block and phase; `sizes` are their GPU bytes.

    An Untimed that is none of them is the reference: it fails, and the cells have no ratios.
    """
    phase = next(iter(sizes)).phase
    spec = stage.study.reference
    reference: Cell | None = Cell(spec, phase if spec.technique.phased else 0)
    if reference not in sizes:
        assert reference is not None
        try:  # one that fails must not take every group with it
            stage.open(block)
            stage.worker.call("draw", request_of(reference))
        except (CellFailed, Unsupported) as reason:
            yield Untimed(reference, str(reason))
            reference = None
    limit = _SHARE * stage.worker.limits.bytes
    group: list[Cell] = []
    held = 0
    for cell, size in sizes.items():
        if group and held + size > limit:
            yield from _time_group(stage, block, group, reference)
            group, held = [], 0
        group.append(cell)
        held += size
    yield from _time_group(stage, block, group, reference)


class _Culprit(Exception):
    """The cell at which timing a group ended."""

    def __init__(self, cell: Cell, reason: Exception) -> None:
        super().__init__(str(reason))
        self.cell = cell
        self.reason = reason


def _time_group(
    stage: BlockStage, block: Block, group: list[Cell], reference: Cell | None
) -> Iterator[Timing | Untimed]:
    """One group, all at once; what fails is left out, and the rest is timed again without it."""
    floor = Cell(Spec(Unshadowed, Unshadowed.Params()), 0)
    name = format_spec(stage.study.reference)
    while group:
        cells = list(dict.fromkeys([floor, *([reference] if reference else []), *group]))
        try:
            times = _measure(stage, block, cells)
        except _Culprit as culprit:
            stage.worker.call("let_go")
            if isinstance(culprit.reason, AteMemory) and len(group) > 1:  # together, which says nothing of this one
                middle = len(group) // 2
                yield from _time_group(stage, block, group[:middle], reference)
                yield from _time_group(stage, block, group[middle:], reference)
                return
            if culprit.cell not in (*group, reference):
                raise culprit.reason from None  # the floor is ours: without it nothing can be timed
            yield Untimed(culprit.cell, str(culprit))
            group = [cell for cell in group if cell != culprit.cell]
            reference = None if reference == culprit.cell else reference
            continue
        for cell in group:
            yield Timing(cell, times[cell], name, times[reference] if reference else None, times[floor])
        return


def _measure(stage: BlockStage, block: Block, cells: list[Cell]) -> dict[Cell, Times]:
    """Hold all cells, then time them interleaved, round by round; a third of as many rounds for single passes."""
    rounds = stage.study.rounds

    def ask(method: str, number: int, argument: object) -> Any:
        try:
            return stage.worker.call(method, argument)
        except (CellFailed, Unsupported) as reason:
            raise _Culprit(cells[number], reason) from None

    stage.open(block)
    numbers = range(len(cells))
    prepare_ms: list[float] = [ask("hold", number, request_of(cells[number])) for number in numbers]
    frames: list[list[float]] = [[ask("time_frame", n, n) for n in numbers] for _ in range(rounds)]
    passes: list[list[PassTimes]] = [[ask("time_passes", n, n) for n in numbers] for _ in range(max(rounds // 3, 1))]
    clock: str = stage.worker.call("let_go")
    return {
        cell: Times([of[n] for of in frames], [of[n] for of in passes], prepare_ms[n], clock)
        for n, cell in enumerate(cells)
    }


def _median_iqr(values: NDArray[np.float64]) -> tuple[float, float]:
    low, middle, high = np.percentile(values, [25, 50, 75])
    return float(middle), float(high - low)
