"""Rows for the cells of a view: each cell is scored alone, then the successful ones are timed together.

Rows are written to disk as they are made; a cell whose key already has rows is not measured again.
"""

from typing import Protocol

from shadowbench.measure.cells import Block, Cell, PlacedView
from shadowbench.measure.executor import Executor
from shadowbench.measure.flips import Stepped, flips
from shadowbench.measure.keys import cell_key, counting_digest, joint_key, view_key
from shadowbench.measure.machine import machine_key
from shadowbench.measure.pictures import Pictures
from shadowbench.measure.profile import Profile
from shadowbench.measure.row_store import RowStore
from shadowbench.measure.rows import Record, Result
from shadowbench.measure.scorer import Scorer, ScoreRequest
from shadowbench.measure.time_rows import time_row
from shadowbench.measure.timing import Conditions, TimingFailure, reference_cell, time_cells

_KEPT_SHARE = 0.25  # share of the memory limit for cells that were drawn and wait to be timed


class Reporter(Protocol):
    """Receiver of progress messages."""

    def note(self, line: str) -> None:
        """Show one line to the user."""

    def stage(self, name: str, total: int | None) -> None:
        """Begin a stage of `total` steps, None if unknown."""

    def step(self, what: str) -> None:
        """Count one step of the stage as done."""


class Measurer:
    """Measures cells under given conditions into a row store, and images into `pictures` if given."""

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

    def measure(self, block: Block) -> list[Result]:
        """Results of a block's cells, measured now or found. Reports one step per cell and one per timed cell."""
        placed_view = PlacedView(block.view, self.conditions.coordinates)
        view = view_key(block.view)
        stepped = Stepped(block.view, self.conditions.step) if self.conditions.step else None
        frames = [placed_view, *([PlacedView(stepped.view, self.conditions.coordinates)] if stepped else [])]
        keys = {cell: self._key(cell, view) for cell in block.cells}
        if stepped:
            after = [view_key(stepped.view), counting_digest()]
            keys = {cell: joint_key([key, *after]) for cell, key in keys.items()}
        missing = sum(self.store.finished_score(key) is None for key in keys.values())
        assumptions, keep_bytes = list(block.scene.notes), int(_KEPT_SHARE * self.executor.limits.bytes)
        requests = [
            ScoreRequest(
                cell,
                key,
                extra_fields={"assumptions": assumptions} | ({"step": stepped.step} if stepped else {}),
                keep_bytes=keep_bytes if self.is_timed(cell) and not stepped else 0,
            )
            for cell, key in keys.items()
        ]
        name = block.scene.name
        count = stepped.count if stepped else flips
        self._scorer.rows(frames, requests, lambda cell: self.reporter.step(f"{name} {cell.spec.text}"), count)
        for _ in range(len(keys) - missing):
            self.reporter.step(f"{name}: measured before")
        failures = self._time(placed_view, view, keys)
        scores = self.store.scores
        return [Result(scores[key], self._time_of(key), failures.get(cell)) for cell, key in keys.items()]

    def is_timed(self, cell: Cell) -> bool:
        """Whether a cell is timed. Only phase 0 is: other phases have other errors but the same cost."""
        return self.conditions.rounds > 0 and cell.phase == 0

    def _key(self, cell: Cell, view: str) -> str:
        return cell_key(cell, view, self.conditions.coordinates, self.executor.info.renderer)

    def _time(self, placed_view: PlacedView, view: str, keys: dict[Cell, str]) -> dict[Cell, str]:
        """Time the successful cells that lack a time. Returns why timing failed, by cell."""
        store, name = self.store, placed_view.view.scene.name
        failures: dict[Cell, str] = {}
        reference = self._key(reference_cell(self.conditions.reference, placed_view.view.light.hard_kind), view)
        wanted = [cell for cell in keys if self.is_timed(cell)]
        succeeded = [cell for cell in wanted if store.scores[keys[cell]]["status"] == "ok"]
        timed = {
            cell: row
            for cell in succeeded
            if not self.conditions.time_again and self._suffices(row := store.times.get(keys[cell]), reference)
        }
        without_ratio = {cell for cell, row in timed.items() if _lacks_ratio(row)}
        sizes = {
            cell: int(store.scores[keys[cell]]["gpu_bytes"])
            for cell in succeeded
            if cell in without_ratio or cell not in timed
        }
        steps = 0
        with self.profile.activity("waiting"):
            for timing in (
                time_cells(self.executor, placed_view, self.conditions, sizes, without_ratio) if sizes else ()
            ):
                if isinstance(timing, TimingFailure):
                    missing_time = "no time" if timing.cell in sizes else "no ratios to this reference"
                    self.reporter.note(f"{name} {timing.cell.spec.text}: {missing_time}: {timing.reason}")
                    if timing.cell in sizes:
                        failures[timing.cell] = timing.reason
                else:
                    with self.profile.activity("files"):
                        store.append(time_row(timing, keys[timing.cell], reference, self._machine))
                if timing.cell in sizes:
                    steps += 1
                    self.reporter.step(f"{name}: timed")
        for _ in range(len(wanted) - steps):
            self.reporter.step(f"{name}: nothing to time")
        return failures

    def _time_of(self, key: str) -> Record | None:
        """Time record of a key, if measured on this machine; times of other machines are not comparable."""
        row = self.store.times.get(key)
        return row if row is not None and row.get("machine") == self._machine else None

    def _suffices(self, row: Record | None, reference: str) -> bool:
        """Whether a time record suffices: enough rounds, the same reference, this machine."""
        if row is None or row["n"] < self.conditions.rounds or "reference_ms" not in row:
            return False
        return bool(row.get("reference_key") == reference and row.get("machine") == self._machine)


def _lacks_ratio(row: Record | None) -> bool:
    """Whether a time has no ratio because its reference failed, which may work now; an unsupported one never will."""
    return row is not None and row["ratio"] is None and not row["no_ratio"].startswith("unsupported")
