"""Rows for the cells of blocks: each cell is scored alone, then the successful ones of a view are timed together.

Rows are written to disk as they are made; a cell whose key already has rows is not measured again.
"""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

from shadowbench.measure.attempt import Attempt, Failure
from shadowbench.measure.bench import Bench, Job
from shadowbench.measure.cells import Block, Cell, PlacedView
from shadowbench.measure.flips import Stepped, flips
from shadowbench.measure.keys import cell_key, joint_key, view_key
from shadowbench.measure.machine import machine_key
from shadowbench.measure.rows import Record, Result
from shadowbench.measure.scorer import FLIP_SAMPLES, Scorer, ScoreRequest
from shadowbench.measure.time_rows import time_row
from shadowbench.measure.timing import Conditions, TimingFailure, reference_cell, time_cells
from shadowbench.scenes.model import View
from shadowbench.truths.cache import PIXEL_SAMPLES

_LEAST_CELLS = 8  # in a job, so that it lasts a second or more
_JOBS_EACH = 4  # number of jobs for each that runs at once, so that all end at about the same time
_KEPT_SHARE = 0.25  # share of the memory limit for cells that were drawn and wait to be timed


class Measurer:
    """Measures blocks under given conditions on a bench."""

    def __init__(self, bench: Bench, conditions: Conditions) -> None:
        self.bench, self.conditions = bench, conditions

    def measure(self, blocks: Sequence[Block], failed: list[Failure] | None = None) -> Iterator[list[Result]]:
        """Results of each block's cells, measured now or found. Reports one step per cell and one per timed cell.

        failed: receives blocks that fail, of which only the cells that have a row are in the results; None to raise.
        """
        store, machine = self.bench.store, machine_key(self.bench.executor)
        keys = [BlockJob(block, self.conditions).keys(self.bench.executor.identity) for block in blocks]
        jobs = self._jobs(blocks, keys)
        attempts: list[Job[Mapping[str, str] | Failure]] = []
        for job in (job for of_block in jobs for job in of_block):
            attempts.append(job if failed is None else Attempt(job, "cells", job.block.view.name))
        answers = self.bench.run(attempts)
        for block, of_cells, of_block in zip(blocks, keys, jobs, strict=True):
            untimed: dict[str, str] = {}
            for _, answer in zip(of_block, answers, strict=False):
                if isinstance(answer, Failure):
                    assert failed is not None
                    failed.append(answer)
                else:
                    untimed |= answer
            for _ in range(len(block.cells) - sum(len(job.block.cells) for job in of_block)):
                self.bench.reporter.step(f"{block.scene.name}: measured before")
            found = [key for key in of_cells.values() if failed is None or key in store.scores]
            yield [Result(store.scores[key], store.time_on(machine, key), untimed.get(key)) for key in found]

    def _jobs(self, blocks: Sequence[Block], keys: Sequence[Mapping[Cell, str]]) -> list[list["BlockJob"]]:
        """Jobs for each block's cells that lack a row, at least one per block; blocks are cut for several at once.

        A block that is timed is not cut, since times are only compared with those taken together.
        """
        store, at_once = self.bench.store, self.bench.executor.jobs_at_once
        left = [
            [cell for cell in block.cells if self.conditions.times(cell) or not store.finished_score(of_cells[cell])]
            for block, of_cells in zip(blocks, keys, strict=True)
        ]
        most = max(sum(map(len, left)), 1)
        if at_once > 1 and self.conditions.rounds == 0:
            most = max(math.ceil(most / (at_once * _JOBS_EACH)), _LEAST_CELLS)
            left = [_by_spec(cells) for cells in left]
        return [
            [self._job(block, of_cells, cells[at : at + most]) for at in range(0, max(len(cells), 1), most)]
            for block, of_cells, cells in zip(blocks, keys, left, strict=True)
        ]

    def _job(self, block: Block, keys: Mapping[Cell, str], cells: Sequence[Cell]) -> "BlockJob":
        store, machine = self.bench.store, machine_key(self.bench.executor)
        timed = [keys[cell] for cell in cells if self.conditions.times(cell)]
        known = [row for key in timed for row in (store.finished_score(key), store.time_on(machine, key))]
        return BlockJob(replace(block, cells=tuple(cells)), self.conditions, tuple(filter(None, known)))


def _by_spec(cells: Sequence[Cell]) -> list[Cell]:
    """The cells with those of a spec, at all sizes and phases, next to each other: they share compiled programs."""
    order: dict[str, int] = {}
    for cell in cells:
        order.setdefault(cell.spec.sizeless_text, len(order))
    return sorted(cells, key=lambda cell: order[cell.spec.sizeless_text])


@dataclass(frozen=True, eq=False)
class BlockJob(Job[Mapping[str, str]]):
    """Job that measures the cells of a block; returns why timing failed, by key."""

    block: Block
    conditions: Conditions
    known: Sequence[Record] = ()

    def keys(self, drawer: Mapping[str, str]) -> dict[Cell, str]:
        """Row keys of the cells by an executor's identity."""
        keys = {cell: self._key(cell, drawer) for cell in self.block.cells}
        if self._stepped is None:
            return keys
        after = view_key(self._stepped.view)
        return {cell: joint_key([key, after]) for cell, key in keys.items()}

    @property
    def truths(self) -> Sequence[tuple[View, int]]:
        """That of the view, and of the one after the step."""
        first, *after = self._views
        return [(first, PIXEL_SAMPLES), *((view, FLIP_SAMPLES) for view in after)]

    @property
    def _views(self) -> list[View]:
        return [self.block.view, *([self._stepped.view] if self._stepped else [])]

    def _key(self, cell: Cell, drawer: Mapping[str, str]) -> str:
        return cell_key(cell, self._view_key, self.conditions.coordinates, drawer)

    @cached_property
    def _view_key(self) -> str:
        return view_key(self.block.view)

    @cached_property
    def _stepped(self) -> Stepped | None:
        return Stepped(self.block.view, self.conditions.step) if self.conditions.step else None

    def __call__(self, bench: Bench) -> Mapping[str, str]:
        """Measure the cells without rows. Reports one step per cell and one per timed cell."""
        block, conditions, stepped = self.block, self.conditions, self._stepped
        keys = self.keys(bench.executor.identity)
        missing = sum(bench.store.finished_score(key) is None for key in keys.values())
        assumptions, keep_bytes = list(block.scene.notes), int(_KEPT_SHARE * bench.executor.limits.bytes)
        requests = [
            ScoreRequest(
                cell,
                key,
                extra_fields={"assumptions": assumptions} | ({"step": stepped.step} if stepped else {}),
                keep_bytes=keep_bytes if conditions.times(cell) and not stepped else 0,
            )
            for cell, key in keys.items()
        ]
        name = block.scene.name
        Scorer(bench).rows(
            [PlacedView(view, conditions.coordinates) for view in self._views],
            requests,
            lambda cell: bench.reporter.step(f"{name} {cell.spec.text}"),
            stepped.count if stepped else flips,
        )
        for _ in range(len(keys) - missing):
            bench.reporter.step(f"{name}: measured before")
        return self._time(bench, keys)

    def _time(self, bench: Bench, keys: dict[Cell, str]) -> Mapping[str, str]:
        """Time the successful cells that lack a time. Returns why timing failed, by key."""
        store, conditions, view = bench.store, self.conditions, self.block.view
        name, machine = view.scene.name, machine_key(bench.executor)
        failures: dict[str, str] = {}
        reference = self._key(reference_cell(conditions.reference, view.light.hard_kind), bench.executor.identity)
        wanted = [cell for cell in keys if conditions.times(cell)]
        succeeded = [cell for cell in wanted if store.scores[keys[cell]]["status"] == "ok"]
        times = {cell: store.time_on(machine, keys[cell]) for cell in succeeded}
        timed = {
            cell: row
            for cell, row in times.items()
            if row is not None and not conditions.time_again and _suffices(row, conditions.rounds, reference)
        }
        without_ratio = {cell for cell, row in timed.items() if _lacks_ratio(row)}
        sizes = {
            cell: int(store.scores[keys[cell]]["gpu_bytes"])
            for cell in succeeded
            if cell in without_ratio or cell not in timed
        }
        steps, placed_view = 0, PlacedView(view, conditions.coordinates)
        for timing in time_cells(bench.executor, placed_view, conditions, sizes, without_ratio) if sizes else ():
            if isinstance(timing, TimingFailure):
                missing_time = "no time" if timing.cell in sizes else "no ratios to this reference"
                bench.reporter.note(f"{name} {timing.cell.spec.text}: {missing_time}: {timing.reason}")
                if timing.cell in sizes:
                    failures[keys[timing.cell]] = timing.reason
            else:
                store.append(time_row(timing, keys[timing.cell], reference, machine))
            if timing.cell in sizes:
                steps += 1
                bench.reporter.step(f"{name}: timed")
        for _ in range(len(wanted) - steps):
            bench.reporter.step(f"{name}: nothing to time")
        return failures


def _suffices(row: Record, rounds: int, reference: str) -> bool:
    """Whether a time record suffices: enough rounds, and the same reference."""
    return bool(row["n"] >= rounds and "reference_ms" in row and row.get("reference_key") == reference)


def _lacks_ratio(row: Record) -> bool:
    """Whether a time has no ratio because its reference failed, which may work now; an unsupported one never will."""
    return row["ratio"] is None and not row["no_ratio"].startswith("unsupported")
