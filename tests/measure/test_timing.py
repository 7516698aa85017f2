"""The order and arithmetic of timing, on a worker that returns known times."""

from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from shadowbench.errors import Unsupported
from shadowbench.gl.clock import QUERIES, WALL, PassTimes, Sample
from shadowbench.measure.campaign import Block, Cell, reference_name
from shadowbench.measure.gl_drawer import GLDrawer
from shadowbench.measure.session import CellRequest
from shadowbench.measure.time_rows import Times, time_row
from shadowbench.measure.worker import CellFailed, Limits, MemoryExceeded
from shadowbench.plugin.registry import techniques
from shadowbench.plugin.spec import Spec, parse_spec
from shadowbench.scenes.model import LightKind

KNOWN = techniques()
FLOOR, REFERENCE, SLOW, FAST = "unshadowed", "shadow-map:size=16", "shadow-map:size=64", "shadow-map:size=32"

# Milliseconds of a frame, round by round. Medians of differences and quotients differ from those of medians.
FRAMES = {
    FLOOR: [1.0, 2.0, 9.0],
    REFERENCE: [10.0, 40.0, 20.0],
    SLOW: [30.0, 20.0, 100.0],
    FAST: [5.0, 4.0, 40.0],
}


def spec(text: str) -> Spec:
    return parse_spec(text, KNOWN)


def cell(text: str) -> Cell:
    return Cell(spec(text), 0)


@dataclass
class Scripted:
    """A scripted worker. clock: name of the n-th sample's clock; fails: what a call raises; on_cpu: cells that
    the CPU draws.
    """

    clock: Callable[[int], str] = lambda number: WALL
    fails: Callable[[str, str | None], Exception | None] = lambda method, name: None
    limits: Limits = field(default_factory=Limits)
    calls: list[tuple[str, str | None]] = field(default_factory=list)
    held: list[str] = field(default_factory=list)
    samples: int = 0
    on_cpu: set[str] = field(default_factory=set)

    def stop(self) -> None:
        self.calls.append(("stop", None))
        self.held.clear()

    def call(self, method: Callable[..., Any], *arguments: Any) -> Any:
        name = None
        if method.__name__ in ("draw", "prepare_timing"):
            request: CellRequest = arguments[1]
            name = spec(request.spec).text
        elif method.__name__.startswith("time_"):
            name = self.held[arguments[0]]
        self.calls.append((method.__name__, name))
        error = self.fails(method.__name__, name)
        if error is not None:
            raise error
        scripted = getattr(self, method.__name__, None)
        return scripted and scripted(*arguments, *([name] if name else []))

    def prepare_timing(self, view: Any, request: CellRequest, name: str) -> float:
        self.held.append(name)
        return 100.0 * len(self.held)

    def time_frame(self, number: int, name: str) -> Sample:
        done = Counter(self.calls)["time_frame", name] - 1
        ms = FRAMES[name][done % 3] + 1000 * (done // 3)  # each further series of three is another thousand
        clock = WALL if name in self.on_cpu else self._next_clock()
        return Sample(ms, ms if clock == WALL else ms + 7, clock)

    def time_passes(self, number: int, name: str) -> PassTimes:
        done = Counter(self.calls)["time_passes", name]
        times = PassTimes()
        for part, changes, ms in (("depth", "light", 3.0 * done), ("resolve", "view", 5.0)):
            times.ms[part], times.changes[part] = ms, changes  # type: ignore[assignment]
            times.clocks.add(WALL if name in self.on_cpu else self._next_clock())
        return times

    def release_timed(self) -> None:
        self.held.clear()

    def _next_clock(self) -> str:
        self.samples += 1
        return self.clock(self.samples)


Found = dict[str, Times | str]


def block_under(kind: LightKind, reference: str = REFERENCE, rounds: int = 3) -> Block:
    view: Any = SimpleNamespace(light=SimpleNamespace(hard_kind=kind))
    return Block((view,), (), rounds=rounds, reference=spec(reference))


def timed(worker: Any, *names: str, rounds: int = 3, reference: str = REFERENCE) -> Found:
    """The result of timing each cell, by spec."""
    block = block_under("directional", reference, rounds)
    return {one.spec.text: found for one, found in GLDrawer(worker).time(block, {cell(name): 1 for name in names})}


def record(worker: Scripted, name: str, **options: Any) -> dict[str, Any]:
    return row_of(timed(worker, name, **options)[name])


def row_of(times: Times | str) -> dict[str, Any]:
    return time_row(times, "key", "the reference's key", "machine")


def test_a_time_is_a_median_and_its_quartiles_above_the_floor_and_over_the_reference_in_the_same_rounds() -> None:
    row = record(Scripted(), SLOW)
    assert (row["frame_ms"], row["frame_iqr_ms"], row["n"]) == (30, 65 - 25, 3)
    assert row["added_ms"] == np.median([30 - 1, 20 - 2, 100 - 9]) == 29
    assert row["ratio"] == np.median([30 / 10, 20 / 40, 100 / 20]) == 3
    assert row["ratio_iqr"] == (3 + 5) / 2 - (0.5 + 3) / 2
    assert (row["reference"], row["reference_ms"], row["no_ratio"]) == (REFERENCE, 20, None)
    itself, floor = (record(Scripted(), name) for name in (REFERENCE, FLOOR))
    assert (itself["ratio"], itself["ratio_iqr"], floor["added_ms"]) == (1, 0, 0)


def test_passes_have_medians_and_totals_by_what_must_be_drawn_anew() -> None:
    row = record(Scripted(), SLOW, rounds=9)  # depth: light, resolve: view
    assert row["passes"]["depth"] == {"ms": 6, "iqr_ms": (6 + 9) / 2 - (3 + 6) / 2, "n": 3, "changes": "light"}
    assert row["passes"]["resolve"] == {"ms": 5, "iqr_ms": 0, "n": 3, "changes": "view"}
    assert (row["still_ms"], row["camera_ms"], row["light_ms"]) == (0, 5, 5 + 6)

    class Whole(Scripted):
        def time_passes(self, number: int, name: str) -> PassTimes:
            return PassTimes()

    row = record(Whole(), SLOW)
    assert (row["passes"], row["still_ms"], row["camera_ms"], row["light_ms"]) == ({}, None, None, None)


def test_what_the_cpu_draws_is_compared_with_others_by_the_wall_whose_time_queries_have_beside_their_own() -> None:
    worker = Scripted(clock=lambda number: QUERIES)
    worker.on_cpu = {SLOW}
    found = timed(worker, SLOW, FAST)
    slow, fast = (row_of(one) for one in found.values())
    assert (slow["clock"], fast["clock"]) == (WALL, QUERIES)
    assert (slow["wall_ms"], fast["wall_ms"], fast["frame_ms"]) == (None, 12, 5)
    assert Counter(worker.calls)["time_frame", SLOW] == 3  # two clocks, but each cell has one
    assert slow["added_ms"] == np.median([30 - 8, 20 - 9, 100 - 16])
    assert slow["reference_ms"] == fast["reference_ms"] + 7


# 9 samples are frames of three cells, 6 more are passes.
@pytest.mark.parametrize("last_query", [5, 10])
def test_times_of_two_clocks_are_thrown_away_and_measured_again(last_query: int) -> None:
    worker = Scripted(clock=lambda number: QUERIES if number <= last_query else WALL)
    row = record(worker, SLOW)
    assert (row["clock"], row["wall_ms"]) == (WALL, None)
    assert (row["frame_ms"], row["n"]) == (1030, 3)  # of the second series alone
    assert (row["passes"]["depth"]["n"], row["passes"]["depth"]["ms"]) == (1, 6)
    assert [Counter(worker.calls)[method, SLOW] for method in ("time_frame", "prepare_timing")] == [6, 1]


def crash(wanted: str, of: str | None = None, error: Exception | None = None) -> Callable[..., Exception | None]:
    """Fails a method, of one cell or of all."""
    error = error or CellFailed("crashed: SIGSEGV")
    return lambda method, name: error if method == wanted and of in (None, name) else None


@pytest.mark.parametrize("method", ["prepare_timing", "time_passes"])
def test_a_failing_floor_costs_all_times_and_a_failing_cell_its_own(method: str) -> None:
    found = timed(Scripted(fails=crash(method, FLOOR)), SLOW, FAST)
    assert found == dict.fromkeys([SLOW, FAST], "the floor, unshadowed: crashed: SIGSEGV")
    found = timed(Scripted(fails=crash(method, SLOW)), SLOW, FAST)
    assert row_of(found[SLOW])["status"] == "failed: crashed: SIGSEGV"
    assert row_of(found[FAST])["ratio"] is not None


@pytest.mark.parametrize(
    ("method", "error", "status"),
    [
        ("draw", Unsupported("a point"), "unsupported: a point"),
        ("time_frame", CellFailed("crashed: SIGSEGV"), "failed: crashed: SIGSEGV"),
    ],
)
def test_a_row_says_why_it_has_no_ratio(method: str, error: Exception, status: str) -> None:
    found = timed(Scripted(fails=crash(method, REFERENCE, error)), SLOW)
    assert isinstance(found[REFERENCE], str)
    row = row_of(found[SLOW])
    assert (row["ratio"], row["ratio_iqr"], row["no_ratio"], row["n"]) == (None, None, status, 3)


def test_cells_that_eat_memory_together_are_timed_apart() -> None:
    def fails(method: str, name: str | None) -> Exception | None:
        return (
            MemoryExceeded("ate memory")
            if method == "prepare_timing" and {SLOW, FAST} <= {*worker.held, name}
            else None
        )

    worker = Scripted(fails=fails)
    found = timed(worker, SLOW, FAST)
    assert all(isinstance(one, Times) for one in found.values())
    held = [name for method, name in worker.calls if method == "prepare_timing"]
    assert held == [*(FLOOR, REFERENCE, SLOW, FAST), *(FLOOR, REFERENCE, SLOW), *(FLOOR, REFERENCE, FAST)]


@pytest.mark.parametrize("times", [1, 2])
def test_a_cell_alone_that_eats_memory_is_tried_once_more_in_a_fresh_worker(times: int) -> None:
    def fails(method: str, name: str | None) -> Exception | None:
        often = Counter(worker.calls)["prepare_timing", SLOW]
        return MemoryExceeded("ate memory") if (method, name) == ("prepare_timing", SLOW) and often <= times else None

    worker = Scripted(fails=fails)
    (found,) = timed(worker, SLOW).values()
    assert isinstance(found, str) == (times == 2) and Counter(worker.calls)["prepare_timing", SLOW] == 2


@pytest.mark.parametrize(
    ("chosen", "names"),
    [
        ("shadow-map:fit=scene,size=64", ("shadow-map:fit=scene,size=64",) * 2 + ("cube-map:size=1024",)),
        ("cascades:size=512", ("cascades:size=512", "unshadowed", "cube-map:size=1024")),
        ("cube-map:size=64", ("unshadowed", "cube-map:size=64", "cube-map:size=64")),
    ],
)
def test_a_kind_of_light_that_the_reference_does_not_answer_has_its_own(chosen: str, names: tuple[str, ...]) -> None:
    kinds: tuple[LightKind, ...] = ("directional", "spot", "point")
    assert tuple(reference_name(block_under(kind, chosen).reference_cell.spec) for kind in kinds) == names
