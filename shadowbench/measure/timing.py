"""Timing a block: groups of cells that fit the memory, each with its own reference and floor, and the statistics."""

from collections.abc import Container, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from shadowbench.gl.clock import QUERIES, Changes, PassTimes, Sample
from shadowbench.measure.references import name_of, reference_for
from shadowbench.measure.session import CellRequest, Unsupported
from shadowbench.measure.worker import AteMemory, CellFailed, Worker
from shadowbench.scenes.model import Coordinates, LightKind, View
from shadowbench.studies.study import Block, Cell, Study
from shadowbench.techniques.spec import Spec, format_spec
from shadowbench.techniques.unshadowed import Unshadowed

# Which passes are drawn anew in a frame, by what has moved since the last: see Changes.
REDRAWN: dict[str, tuple[Changes, ...]] = {
    "still": ("frame",),
    "camera": ("view", "frame"),
    "light": ("light", "view", "frame"),
}
_SHARE = 0.5  # of the memory limit that the cells of a group may take together


def request_of(cell: Cell) -> CellRequest:
    """A cell as the worker takes it."""
    return CellRequest(format_spec(cell.spec, full=True), cell.phase)


def reference_cell(study: Study, kind: LightKind) -> Cell:
    """The cell that ratios are over under a kind of light."""
    return Cell(reference_for(study.reference, kind), 0)


class ViewStage:
    """Keeps the worker at a view, also after it was replaced."""

    def __init__(self, worker: Worker) -> None:
        self.worker = worker
        self._scene: tuple[object, ...] = ()
        self._view: tuple[object, ...] = ()
        self._surface: NDArray[np.int32] | None = None

    def open(self, view: View, coordinates: Coordinates) -> NDArray[np.int32]:
        """The G-buffer's triangle ids of a view, (N, N), row 0 at the top."""
        self.worker.ready()
        scene = (self.worker.generation, view.scene, coordinates)
        if self._scene != scene:
            self._scene, self._view = (), ()
            self.worker.call("load", view.scene, coordinates)
            self._scene = scene
        if self._view != (*scene, view) or self._surface is None:
            self._view = ()
            self._surface = self.worker.call("open", view.camera, view.light, view.size)
            self._view = (*scene, view)
        return self._surface


class BlockStage:
    """Keeps the worker at a block's view."""

    def __init__(self, worker: Worker, study: Study) -> None:
        self.worker, self.study = worker, study
        self._views = ViewStage(worker)

    def open(self, block: Block) -> NDArray[np.int32]:
        """The G-buffer's triangle ids of the block's view, (N, N), row 0 at the top."""
        return self._views.open(block.view, self.study.coordinates)


@dataclass(frozen=True, eq=False)
class Times:
    """What a cell took, a value a round, all by one clock. Frames and passes come from different rounds."""

    frames: list[Sample]
    passes: list[PassTimes]
    prepare_ms: float
    clock: str

    @property
    def frames_ms(self) -> NDArray[np.float64]:
        """Milliseconds of whole frames, a value a round."""
        return np.array([frame.ms for frame in self.frames])


@dataclass(frozen=True, eq=False)
class Timing:
    """What a cell took, beside the reference and the floor of its own group.

    `no_ratio` is the reference's status where it has no times.
    """

    cell: Cell
    times: Times
    reference: str
    reference_times: Times | None
    floor: Times
    no_ratio: str | None = None

    def record(self) -> dict[str, Any]:
        """The time record: milliseconds as medians with their IQR; ratios are medians over rounds of one group.

        `still_ms`, `camera_ms`, `light_ms`: the passes' medians summed over those that REDRAWN names; None for a
        technique that times no pass.
        `reference_ms`: the median of the reference in the same group.
        `wall_ms` is there when queries measured: a GPU's timer does not see what the CPU does, such as a fit.
        """
        frames = self.times.frames_ms
        frame_ms, frame_iqr = _median_iqr(frames)
        wall_ms = float(np.median([frame.wall_ms for frame in self.times.frames]))
        passes = self._passes()
        record: dict[str, Any] = {
            "clock": self.times.clock,
            "n": len(frames),
            "frame_ms": frame_ms,
            "frame_iqr_ms": frame_iqr,
            "wall_ms": wall_ms if self.times.clock == QUERIES else None,
            "added_ms": float(np.median(frames - self.floor.frames_ms)),
            "reference": self.reference,
            "reference_ms": None,
            "ratio": None,
            "ratio_iqr": None,
            "ratio_quartiles": None,
            "no_ratio": self.no_ratio,
            "prepare_ms": self.times.prepare_ms,
            "passes": passes,
        }
        record |= {
            f"{moved}_ms": sum((one["ms"] for one in passes.values() if one["changes"] in redrawn), 0.0)
            if passes
            else None
            for moved, redrawn in REDRAWN.items()
        }
        if self.reference_times is not None:
            record["reference_ms"] = float(np.median(self.reference_times.frames_ms))
            ratios = frames / self.reference_times.frames_ms
            record["ratio"], record["ratio_iqr"] = _median_iqr(ratios)
            record["ratio_quartiles"] = [float(end) for end in np.percentile(ratios, [25, 75])]
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


def time_cells(
    stage: BlockStage, block: Block, sizes: Mapping[Cell, int], lacking: Container[Cell] = ()
) -> Iterator[Timing | Untimed]:
    """Time cells of one block; `sizes` are their GPU bytes.

    Those in `lacking` have times and lack only the ratio: they are left out when the reference fails again. An Untimed
    that is none of the cells is the reference: it fails, and the cells have no ratios.
    """
    wanted = reference_cell(stage.study, block.view.light.kind)
    reference: Cell | None = wanted
    no_ratio = None
    if wanted not in sizes:
        try:  # one that fails must not take every group with it
            stage.open(block)
            stage.worker.call("draw", request_of(wanted))
        except (CellFailed, Unsupported) as reason:
            yield Untimed(wanted, str(reason))
            reference, no_ratio = None, _status(reason)
    limit = _SHARE * stage.worker.limits.bytes
    group: list[Cell] = []
    held = 0
    for cell, size in sizes.items():
        if reference is None and cell in lacking:
            continue
        if group and held + size > limit:
            yield from _time_group(stage, block, group, reference, no_ratio)
            group, held = [], 0
        group.append(cell)
        held += size
    yield from _time_group(stage, block, group, reference, no_ratio)


def _status(reason: Exception) -> str:
    """As score records state it."""
    return f"{'unsupported' if isinstance(reason, Unsupported) else 'failed'}: {reason}"


class _Culprit(Exception):
    """The cell at which timing a group ended; None when the view could not even be opened."""

    def __init__(self, cell: Cell | None, reason: Exception) -> None:
        super().__init__(str(reason))
        self.cell = cell
        self.reason = reason


def _time_group(
    stage: BlockStage, block: Block, group: list[Cell], reference: Cell | None, no_ratio: str | None
) -> Iterator[Timing | Untimed]:
    """One group, all at once; what fails is left out, and the rest is timed again without it."""
    floor = Cell(Spec(Unshadowed, Unshadowed.Params()), 0)
    name = name_of(reference_cell(stage.study, block.view.light.kind).spec)
    again = False
    while group:
        cells = list(dict.fromkeys([floor, *([reference] if reference else []), *group]))
        try:
            times = _measure(stage, block, cells)
        except _Culprit as culprit:
            _let_go(stage.worker)
            blamed = culprit.cell
            together = blamed is not None and len(group) > 1
            if together and isinstance(culprit.reason, AteMemory):  # which says nothing of this one
                middle = len(group) // 2
                yield from _time_group(stage, block, group[:middle], reference, no_ratio)
                yield from _time_group(stage, block, group[middle:], reference, no_ratio)
                return
            if blamed is not None and isinstance(culprit.reason, AteMemory) and not again:
                again = True  # nor of one alone: the worker had drawn others before; the new one has not
                continue
            if blamed is None or blamed not in (*group, reference):  # without view or floor there is no time
                what = "opening the view" if blamed is None else "the floor, unshadowed"
                yield from (Untimed(cell, f"{what}: {culprit}") for cell in group)
                return
            yield Untimed(blamed, str(culprit))
            group = [cell for cell in group if cell != blamed]
            if reference == blamed:
                reference, no_ratio = None, _status(culprit.reason)
            continue
        for cell in group:
            yield Timing(cell, times[cell], name, times[reference] if reference else None, times[floor], no_ratio)
        return


def _measure(stage: BlockStage, block: Block, cells: list[Cell]) -> dict[Cell, Times]:
    """Hold all cells, then time them interleaved, round by round; a third of as many rounds for single passes."""
    rounds = stage.study.rounds
    numbers = range(len(cells))

    def ask(method: str, number: int, argument: object) -> Any:
        try:
            return stage.worker.call(method, argument)
        except (CellFailed, Unsupported) as reason:
            raise _Culprit(cells[number], reason) from None

    def sample() -> tuple[list[list[Sample]], list[list[PassTimes]], set[str]]:
        frames = [[ask("time_frame", n, n) for n in numbers] for _ in range(rounds)]
        passes = [[ask("time_passes", n, n) for n in numbers] for _ in range(max(rounds // 3, 1))]
        clocks = {frame.clock for one in frames for frame in one}
        return frames, passes, clocks.union(*(times.clocks for one in passes for times in one))

    try:
        stage.open(block)
    except CellFailed as reason:
        raise _Culprit(None, reason) from None
    prepare_ms: list[float] = [ask("hold", number, request_of(cells[number])) for number in numbers]
    frames, passes, clocks = sample()
    if len(clocks) > 1:  # queries were given up midway, and for good: the second time the wall measures everything
        frames, passes, clocks = sample()
    (clock,) = clocks  # times by two clocks have no median
    _let_go(stage.worker)
    return {
        cell: Times([of[n] for of in frames], [of[n] for of in passes], prepare_ms[n], clock)
        for n, cell in enumerate(cells)
    }


def _let_go(worker: Worker) -> None:
    """Have the worker release what it holds; one that fails even at that is stopped, and holds nothing either."""
    try:
        worker.call("let_go")
    except CellFailed:
        worker.stop()


def _median_iqr(values: NDArray[np.float64]) -> tuple[float, float]:
    low, middle, high = np.percentile(values, [25, 50, 75])
    return float(middle), float(high - low)
