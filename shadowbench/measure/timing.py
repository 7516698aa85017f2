"""Timing of the cells of a view: interleaved in groups that fit in memory, each with a reference and a floor."""

from collections.abc import Callable, Container, Iterator, Mapping
from dataclasses import dataclass
from typing import Concatenate

from shadowbench.measure.cells import Cell, PlacedView
from shadowbench.measure.executor import CellFailed, Executor, MemoryExceeded, P, R, Unsupported, status_of
from shadowbench.measure.flips import Step
from shadowbench.measure.references import DEFAULT_REFERENCE, reference_for, reference_name
from shadowbench.measure.session import Session
from shadowbench.measure.time_rows import Times, Timing
from shadowbench.scenes.model import Coordinates, LightKind
from shadowbench.techniques.spec import Spec
from shadowbench.techniques.unshadowed import Unshadowed

_GROUP_SHARE = 0.5  # share of the memory limit for the cells of a group


@dataclass(frozen=True)
class Conditions:
    """Settings of a measurement besides the cell and its view.

    rounds: how often each cell is timed, 0 for no timing; reference: spec that times are divided by; time_again: time
    cells again that have a time; the rows keep both; step: what moves to count flips, None to count none.
    """

    coordinates: Coordinates = "relative"
    rounds: int = 0
    reference: Spec = DEFAULT_REFERENCE
    time_again: bool = False
    step: Step | None = None

    def times(self, cell: Cell) -> bool:
        """Whether a cell is timed. Only phase 0 is: other phases have other errors but the same cost."""
        return self.rounds > 0 and cell.phase == 0


def reference_cell(reference: Spec, kind: LightKind) -> Cell:
    """Reference cell under a kind of light."""
    return Cell(reference_for(reference, kind))


@dataclass(frozen=True, eq=False)
class TimingFailure:
    """A cell that could not be timed, and the reason."""

    cell: Cell
    reason: str


def time_cells(
    executor: Executor,
    placed_view: PlacedView,
    conditions: Conditions,
    sizes: Mapping[Cell, int],
    without_ratio: Container[Cell] = (),
) -> Iterator[Timing | TimingFailure]:
    """Time cells of one view; sizes: GPU bytes of each.

    without_ratio: cells that have times but no ratio, which are skipped if the reference fails again. A TimingFailure
    of a cell not in `sizes` is that of the reference; the cells then have no ratios.
    """
    reference: Cell | None = reference_cell(conditions.reference, placed_view.view.light.hard_kind)
    no_ratio = None
    if reference is not None and reference not in sizes:
        try:  # now, so that a failing reference does not fail every group
            executor.call(Session.draw, placed_view, reference.request)
        except (CellFailed, Unsupported) as reason:
            yield TimingFailure(reference, str(reason))
            reference, no_ratio = None, status_of(reason)
    limit = _GROUP_SHARE * executor.limits.bytes
    group: list[Cell] = []
    group_bytes = 0
    for cell, size in sizes.items():
        if reference is None and cell in without_ratio:
            continue
        if group and group_bytes + size > limit:
            yield from _time_group(executor, placed_view, conditions, group, reference, no_ratio)
            group, group_bytes = [], 0
        group.append(cell)
        group_bytes += size
    yield from _time_group(executor, placed_view, conditions, group, reference, no_ratio)


class _GroupFailed(Exception):
    """Raised when timing a group fails; cell: the one that failed, None if opening the view did."""

    def __init__(self, cell: Cell | None, reason: CellFailed | Unsupported) -> None:
        super().__init__(str(reason))
        self.cell = cell
        self.reason = reason


def _time_group(
    executor: Executor,
    placed_view: PlacedView,
    conditions: Conditions,
    group: list[Cell],
    reference: Cell | None,
    no_ratio: str | None,
) -> Iterator[Timing | TimingFailure]:
    """Time one group together. A cell that fails is dropped, and the rest is timed again without it."""
    floor = Cell(Spec(Unshadowed, Unshadowed.Params()))
    name = reference_name(reference_cell(conditions.reference, placed_view.view.light.hard_kind).spec)
    retried = False
    while group:
        cells = list(dict.fromkeys([floor, *([reference] if reference else []), *group]))
        try:
            times = _measure(executor, placed_view, conditions.rounds, cells)
        except _GroupFailed as failure:
            _release_timed(executor)
            failed_cell = failure.cell
            together = failed_cell is not None and len(group) > 1
            if together and isinstance(failure.reason, MemoryExceeded):  # perhaps not its own fault
                middle = len(group) // 2
                yield from _time_group(executor, placed_view, conditions, group[:middle], reference, no_ratio)
                yield from _time_group(executor, placed_view, conditions, group[middle:], reference, no_ratio)
                return
            if failed_cell is not None and isinstance(failure.reason, MemoryExceeded) and not retried:
                retried = True  # the worker may have held memory of earlier cells; a fresh one has none
                continue
            if failed_cell is None or failed_cell not in (*group, reference):  # neither view nor floor can be left out
                what = "opening the view" if failed_cell is None else "the floor, unshadowed"
                yield from (TimingFailure(cell, f"{what}: {failure}") for cell in group)
                return
            yield TimingFailure(failed_cell, str(failure))
            group = [cell for cell in group if cell != failed_cell]
            if reference == failed_cell:
                reference, no_ratio = None, status_of(failure.reason)
            continue
        for cell in group:
            yield Timing(cell, times[cell], name, times[reference] if reference else None, times[floor], no_ratio)
        return


def _measure(executor: Executor, placed_view: PlacedView, rounds: int, cells: list[Cell]) -> dict[Cell, Times]:
    """Prepare all cells, then time them interleaved: `rounds` whole frames and a third as many frames pass by pass."""
    indices = range(len(cells))

    def call(
        index: int | None, method: Callable[Concatenate[Session, P], R], *arguments: P.args, **options: P.kwargs
    ) -> R:
        try:
            return executor.call(method, *arguments, **options)
        except (CellFailed, Unsupported) as reason:
            raise _GroupFailed(None if index is None else cells[index], reason) from None

    def sample() -> list[Times]:
        frames = [[call(n, Session.time_frame, n) for n in indices] for _ in range(rounds)]
        passes = [[call(n, Session.time_passes, n) for n in indices] for _ in range(max(rounds // 3, 1))]
        return [Times([row[n] for row in frames], [row[n] for row in passes], prepare_ms[n]) for n in indices]

    call(None, Session.open, placed_view)
    prepare_ms = [call(n, Session.prepare_timing, placed_view, cells[n].request) for n in indices]
    times = sample()
    if any(len(cell.clocks) > 1 for cell in times):  # the clock gave up timer queries midway, for good
        times = sample()
    _release_timed(executor)
    return dict(zip(cells, times, strict=True))


def _release_timed(executor: Executor) -> None:
    """Release the cells prepared for timing; a session that fails even at that is killed."""
    try:
        executor.call(Session.release_timed)
    except CellFailed:
        executor.stop()
