"""Timing the cells of a view: groups that fit the memory, each with its own reference and floor, taken in turn."""

from collections.abc import Callable, Container, Iterator, Mapping
from dataclasses import dataclass
from typing import Concatenate

from shadowbench.gl.clock import PassTimes, Sample
from shadowbench.measure.cells import Cell, PlacedView
from shadowbench.measure.executor import CellFailed, Executor, MemoryExceeded, P, R, status_of
from shadowbench.measure.references import USUAL, name_of, reference_for
from shadowbench.measure.session import Session, Unsupported
from shadowbench.measure.time_rows import Times, Timing
from shadowbench.scenes.model import Coordinates, LightKind
from shadowbench.techniques.spec import Spec
from shadowbench.techniques.unshadowed import Unshadowed

_SHARE = 0.5  # of the memory limit that the cells of a group may take together


@dataclass(frozen=True)
class Conditions:
    """What a measurement depends on beside the cell and its view.

    rounds: how often a cell is timed, 0 for not at all; reference: what its times are ratios to; time_again: whether
    cells that have a time get another, beside which the old one stays in the rows.
    """

    coordinates: Coordinates = "relative"
    rounds: int = 0
    reference: Spec = USUAL
    time_again: bool = False


def reference_cell(reference: Spec, kind: LightKind) -> Cell:
    """The cell that ratios are over under a kind of light."""
    return Cell(reference_for(reference, kind))


@dataclass(frozen=True, eq=False)
class Untimed:
    """A cell that could not be timed, and why."""

    cell: Cell
    reason: str


def time_cells(
    executor: Executor, at: PlacedView, conditions: Conditions, sizes: Mapping[Cell, int], lacking: Container[Cell] = ()
) -> Iterator[Timing | Untimed]:
    """Time cells of one view; `sizes` are their GPU bytes.

    Those in `lacking` have times and lack only the ratio: they are left out when the reference fails again. An Untimed
    that is none of the cells is the reference: it fails, and the cells have no ratios.
    """
    wanted = reference_cell(conditions.reference, at.view.light.kind)
    reference: Cell | None = wanted
    no_ratio = None
    if wanted not in sizes:
        try:  # one that fails must not take every group with it
            executor.call(Session.draw, at, wanted.request)
        except (CellFailed, Unsupported) as reason:
            yield Untimed(wanted, str(reason))
            reference, no_ratio = None, status_of(reason)
    limit = _SHARE * executor.limits.bytes
    group: list[Cell] = []
    held = 0
    for cell, size in sizes.items():
        if reference is None and cell in lacking:
            continue
        if group and held + size > limit:
            yield from _time_group(executor, at, conditions, group, reference, no_ratio)
            group, held = [], 0
        group.append(cell)
        held += size
    yield from _time_group(executor, at, conditions, group, reference, no_ratio)


class _Culprit(Exception):
    """The cell at which timing a group ended; None when the view could not even be opened."""

    def __init__(self, cell: Cell | None, reason: CellFailed | Unsupported) -> None:
        super().__init__(str(reason))
        self.cell = cell
        self.reason = reason


def _time_group(
    executor: Executor,
    at: PlacedView,
    conditions: Conditions,
    group: list[Cell],
    reference: Cell | None,
    no_ratio: str | None,
) -> Iterator[Timing | Untimed]:
    """One group, all at once; what fails is left out, and the rest is timed again without it."""
    floor = Cell(Spec(Unshadowed, Unshadowed.Params()))
    name = name_of(reference_cell(conditions.reference, at.view.light.kind).spec)
    again = False
    while group:
        cells = list(dict.fromkeys([floor, *([reference] if reference else []), *group]))
        try:
            times = _measure(executor, at, conditions.rounds, cells)
        except _Culprit as culprit:
            _let_go(executor)
            blamed = culprit.cell
            together = blamed is not None and len(group) > 1
            if together and isinstance(culprit.reason, MemoryExceeded):  # which says nothing of this one
                middle = len(group) // 2
                yield from _time_group(executor, at, conditions, group[:middle], reference, no_ratio)
                yield from _time_group(executor, at, conditions, group[middle:], reference, no_ratio)
                return
            if blamed is not None and isinstance(culprit.reason, MemoryExceeded) and not again:
                again = True  # nor of one alone: the worker had drawn others before; the new one has not
                continue
            if blamed is None or blamed not in (*group, reference):  # without view or floor there is no time
                what = "opening the view" if blamed is None else "the floor, unshadowed"
                yield from (Untimed(cell, f"{what}: {culprit}") for cell in group)
                return
            yield Untimed(blamed, str(culprit))
            group = [cell for cell in group if cell != blamed]
            if reference == blamed:
                reference, no_ratio = None, status_of(culprit.reason)
            continue
        for cell in group:
            yield Timing(cell, times[cell], name, times[reference] if reference else None, times[floor], no_ratio)
        return


def _measure(executor: Executor, at: PlacedView, rounds: int, cells: list[Cell]) -> dict[Cell, Times]:
    """Hold all cells, then time them interleaved, round by round; a third of as many rounds for single passes."""
    numbers = range(len(cells))

    def ask(of: int | None, method: Callable[Concatenate[Session, P], R], *arguments: P.args, **options: P.kwargs) -> R:
        try:
            return executor.call(method, *arguments, **options)
        except (CellFailed, Unsupported) as reason:
            raise _Culprit(None if of is None else cells[of], reason) from None

    def sample() -> tuple[list[list[Sample]], list[list[PassTimes]], set[str]]:
        frames = [[ask(n, Session.time_frame, n) for n in numbers] for _ in range(rounds)]
        passes = [[ask(n, Session.time_passes, n) for n in numbers] for _ in range(max(rounds // 3, 1))]
        clocks = {frame.clock for one in frames for frame in one}
        return frames, passes, clocks.union(*(times.clocks for one in passes for times in one))

    ask(None, Session.open, at)
    prepare_ms = [ask(n, Session.hold, at, cells[n].request) for n in numbers]
    frames, passes, clocks = sample()
    if len(clocks) > 1:  # queries were given up midway, and for good: the second time the wall measures everything
        frames, passes, clocks = sample()
    (clock,) = clocks  # times by two clocks have no median
    _let_go(executor)
    return {
        cell: Times([of[n] for of in frames], [of[n] for of in passes], prepare_ms[n], clock)
        for n, cell in enumerate(cells)
    }


def _let_go(executor: Executor) -> None:
    """Have the session release what it holds; one that fails even at that is stopped, and holds nothing either."""
    try:
        executor.call(Session.let_go)
    except CellFailed:
        executor.stop()
