"""From the cells of a view to their rows: every cell scored alone, then those that held timed together.

Rows go to disk as they are made; a call that finds rows of the same key does nothing again.
"""

from typing import Protocol

from shadowbench.measure.cells import Block, Cell, PlacedView
from shadowbench.measure.executor import Executor
from shadowbench.measure.keys import cell_key, view_key
from shadowbench.measure.machine import machine_key
from shadowbench.measure.pictures import Pictures
from shadowbench.measure.profile import Profile
from shadowbench.measure.row_store import RowStore
from shadowbench.measure.rows import Record, Result
from shadowbench.measure.scorer import Asked, Scorer
from shadowbench.measure.time_rows import time_row
from shadowbench.measure.timing import Conditions, Untimed, reference_cell, time_cells

_KEPT = 0.25  # of the memory limit: cells that were drawn and wait to be timed


class Reporter(Protocol):
    """Who is told how a run goes."""

    def note(self, line: str) -> None:
        """One line that the user should read."""

    def stage(self, name: str, total: int) -> None:
        """A stage of so many steps begins."""

    def step(self, what: str) -> None:
        """One step of the stage is done."""


class Measurer:
    """Makes the rows of cells under some conditions, in a store; without `pictures` the rows alone."""

    def __init__(
        self,
        executor: Executor,
        store: RowStore,
        conditions: Conditions,
        reporter: Reporter,
        pictures: Pictures | None = None,
        profile: Profile | None = None,
    ) -> None:
        self.executor, self.store, self.conditions, self.reporter = executor, store, conditions, reporter
        self.profile = profile or Profile()
        self._scorer = Scorer(executor, store, pictures, profile=self.profile)
        self._machine = machine_key(executor.info)

    def measured(self, block: Block) -> list[Result]:
        """The rows of a block's cells, made now or before: a step for each, and one for each that may have a time."""
        at = PlacedView(block.view, self.conditions.coordinates)
        view = view_key(block.view)
        keys = {cell: self._key(cell, view) for cell in block.cells}
        missing = sum(self.store.done(key) is None for key in keys.values())
        more, room = {"assumptions": list(block.scene.notes)}, int(_KEPT * self.executor.limits.bytes)
        asked = [Asked(cell, key, more=more, keep=room if self.times(cell) else 0) for cell, key in keys.items()]
        self._scorer.rows([at], asked, lambda cell: self.reporter.step(f"{block.scene.name} {cell.spec.text}"))
        for _ in range(len(keys) - missing):
            self.reporter.step(f"{block.scene.name}: measured before")
        untimed = self._time(at, view, keys)
        scores = self.store.scores
        return [Result(scores[key], self._time_of(key), untimed.get(cell)) for cell, key in keys.items()]

    def times(self, cell: Cell) -> bool:
        """Whether a cell is timed: the other phases differ in their errors alone."""
        return self.conditions.rounds > 0 and cell.phase == 0

    def _key(self, cell: Cell, view: str) -> str:
        return cell_key(cell, view, self.conditions.coordinates, self.executor.info.renderer)

    def _time(self, at: PlacedView, view: str, keys: dict[Cell, str]) -> dict[Cell, str]:
        """Time what held and has no time yet. Says what failed."""
        store, name = self.store, at.view.scene.name
        untimed: dict[Cell, str] = {}
        reference = self._key(reference_cell(self.conditions.reference, at.view.light.kind), view)
        wanted = [cell for cell in keys if self.times(cell)]
        held = [cell for cell in wanted if store.scores[keys[cell]]["status"] == "ok"]
        timed = {
            cell: row
            for cell in held
            if not self.conditions.time_again and self._is_timed(row := store.times.get(keys[cell]), reference)
        }
        lacking = {cell for cell, row in timed.items() if _lacks_ratio(row)}
        sizes = {
            cell: int(store.scores[keys[cell]]["gpu_bytes"]) for cell in held if cell in lacking or cell not in timed
        }
        steps = 0
        with self.profile.of("waiting"):
            for timing in time_cells(self.executor, at, self.conditions, sizes, lacking) if sizes else ():
                if isinstance(timing, Untimed):
                    lost = "no time" if timing.cell in sizes else "no ratios to this reference"
                    self.reporter.note(f"{name} {timing.cell.spec.text}: {lost}: {timing.reason}")
                    if timing.cell in sizes:
                        untimed[timing.cell] = timing.reason
                else:
                    with self.profile.of("files"):
                        store.append(time_row(timing, keys[timing.cell], reference, self._machine))
                if timing.cell in sizes:
                    steps += 1
                    self.reporter.step(f"{name}: timed")
        for _ in range(len(wanted) - steps):
            self.reporter.step(f"{name}: nothing to time")
        return untimed

    def _time_of(self, key: str) -> Record | None:
        """The time record of a key; one of another machine may not stand beside this one's."""
        row = self.store.times.get(key)
        return row if row is not None and row.get("machine") == self._machine else None

    def _is_timed(self, row: Record | None, reference: str) -> bool:
        """Whether a time record is as good as is asked for: as many rounds, the same reference, this machine."""
        if row is None or row["n"] < self.conditions.rounds or "reference_ms" not in row:
            return False
        return bool(row.get("reference_key") == reference and row.get("machine") == self._machine)


def _lacks_ratio(row: Record | None) -> bool:
    """Whether a time has no ratio although its reference may answer by now: one that is unsupported never will."""
    return row is not None and row["ratio"] is None and not row["no_ratio"].startswith("unsupported")
