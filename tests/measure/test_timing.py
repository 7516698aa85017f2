"""The order and arithmetic of timing, on a worker that returns known times."""

from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from shadowbench.errors import Unsupported
from shadowbench.gl.clock import QUERIES, WALL, Changes, PassTimes, Sample
from shadowbench.measure.cells import Block, Cell, reference_name
from shadowbench.measure.drawer import CellFailed, Limits, MemoryExceeded
from shadowbench.measure.gl_drawer import GLDrawer
from shadowbench.measure.session import CellRequest
from shadowbench.measure.time_rows import Times, time_row
from shadowbench.plugin.registry import techniques
from shadowbench.plugin.spec import Spec, parse_spec
from shadowbench.scenes.model import Coordinates, LightKind

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

    def call(self, asked: Callable[..., Any], *arguments: Any) -> Any:
        method, name = asked.__name__, None
        if method in ("draw", "prepare_timing"):
            request: CellRequest = arguments[1]
            name = spec(request.spec).text
        elif method.startswith("time_"):
            name = self.held[arguments[0]]
        self.calls.append((method, name))
        error = self.fails(method, name)
        if error is not None:
            raise error
        return getattr(self, method)(*arguments, name) if name else getattr(self, method)(*arguments)

    def open(self, view: Any, coordinates: Coordinates) -> None:
        pass

    def draw(self, view: Any, request: CellRequest, name: str) -> None:
        pass

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
        for part in (1.0, 2.0):  # drawn twice
            clock = WALL if name in self.on_cpu else self._next_clock()
            times.add("depth", "light", Sample(part * done, part * done, clock))
        times.add("resolve", "view", Sample(5.0, 5.0, WALL if name in self.on_cpu else self._next_clock()))
        return times

    def release_timed(self) -> None:
        self.held.clear()

    def _next_clock(self) -> str:
        self.samples += 1
        return self.clock(self.samples)


Found = dict[str, Times | str]


def block_under(kind: LightKind, reference: str = REFERENCE, rounds: int = 3) -> Block:
    view: Any = SimpleNamespace(light=SimpleNamespace(hard_kind=kind))
    return Block(view, (), rounds=rounds, reference=spec(reference))


def timed(worker: Any, *names: str, rounds: int = 3, reference: str = REFERENCE) -> Found:
    """The result of timing each cell, by spec."""
    block = block_under("directional", reference, rounds)
    return {one.spec.text: found for one, found in GLDrawer(worker).time(block, {cell(name): 1 for name in names})}


def record(worker: Scripted, name: str, **options: Any) -> dict[str, Any]:
    return row_of(timed(worker, name, **options)[name])


def row_of(times: Times | str) -> dict[str, Any]:
    return time_row(times, "key", "the reference's key", "machine")


def test_a_frame_s_time_is_the_median_and_its_spread_the_quartiles() -> None:
    row = record(Scripted(), SLOW)
    assert (row["frame_ms"], row["frame_iqr_ms"], row["n"]) == (30, 65 - 25, 3)


def test_added_time_is_the_time_above_unshadowed_in_the_same_round() -> None:
    assert record(Scripted(), SLOW)["added_ms"] == np.median([30 - 1, 20 - 2, 100 - 9]) == 29
    assert record(Scripted(), FLOOR)["added_ms"] == 0


def test_a_ratio_is_the_cell_time_over_the_reference_time_of_the_same_round() -> None:
    row = record(Scripted(), SLOW)
    assert row["ratio"] == np.median([30 / 10, 20 / 40, 100 / 20]) == 3
    assert row["ratio_iqr"] == (3 + 5) / 2 - (0.5 + 3) / 2
    assert (row["reference"], row["reference_ms"], row["no_ratio"]) == (REFERENCE, 20, None)
    assert row["ratio_quartiles"] == [(0.5 + 3) / 2, (3 + 5) / 2]
    itself = record(Scripted(), REFERENCE)
    assert (itself["ratio"], itself["ratio_iqr"]) == (1, 0)


def test_rounds_visit_all_kept_cells() -> None:
    worker = Scripted()
    timed(worker, SLOW, FAST)
    group = [FLOOR, REFERENCE, SLOW, FAST]
    assert worker.calls == [
        ("draw", REFERENCE),
        ("open", None),
        *(("prepare_timing", name) for name in group),
        *(("time_frame", name) for _ in range(3) for name in group),
        *(("time_passes", name) for name in group),
        ("release_timed", None),
    ]


@pytest.mark.parametrize(("rounds", "passes"), [(1, 1), (5, 1), (6, 2), (9, 3)])
def test_passes_are_timed_in_a_third_of_the_rounds(rounds: int, passes: int) -> None:
    worker = Scripted()
    row = record(worker, SLOW, rounds=rounds)
    assert Counter(worker.calls)["time_frame", SLOW] == row["n"] == rounds
    assert Counter(worker.calls)["time_passes", SLOW] == row["passes"]["depth"]["n"] == passes


def test_a_pass_that_is_drawn_twice_is_summed_before_the_median() -> None:
    passes = record(Scripted(), SLOW, rounds=9)["passes"]
    assert passes["depth"] == {"ms": 6, "iqr_ms": (6 + 9) / 2 - (3 + 6) / 2, "n": 3, "changes": "light"}
    assert passes["resolve"] == {"ms": 5, "iqr_ms": 0, "n": 3, "changes": "view"}


def test_passes_are_totalled_by_what_must_be_drawn_anew() -> None:
    class Three(Scripted):
        def time_passes(self, number: int, name: str) -> PassTimes:
            times = PassTimes()
            passes: list[tuple[str, Changes, float]]
            passes = [("map", "light", 1.0), ("fit", "view", 2.0), ("blur", "view", 4.0), ("noise", "frame", 8.0)]
            for part, changes, ms in passes:
                times.add(part, changes, Sample(ms, ms, WALL))
            return times

    row = record(Three(), SLOW)
    assert (row["still_ms"], row["camera_ms"], row["light_ms"]) == (8, 8 + 2 + 4, 8 + 2 + 4 + 1)
    row = record(Scripted(), SLOW)  # depth: light, resolve: view
    assert (row["still_ms"], row["camera_ms"], row["light_ms"]) == (0, 5, 5 + 3)


def test_a_technique_that_times_no_pass_has_no_totals() -> None:
    class Whole(Scripted):
        def time_passes(self, number: int, name: str) -> PassTimes:
            return PassTimes()

    row = record(Whole(), SLOW)
    assert row["passes"] == {}
    assert (row["still_ms"], row["camera_ms"], row["light_ms"]) == (None, None, None)


def test_each_cell_has_its_own_preparation() -> None:
    found = timed(Scripted(), SLOW, FAST)
    assert [row_of(one)["prepare_ms"] for one in found.values()] == [300, 400]


def test_wall_time_is_recorded_only_beside_a_query() -> None:
    queried = record(Scripted(clock=lambda number: QUERIES), SLOW)
    assert (queried["clock"], queried["frame_ms"], queried["wall_ms"]) == (QUERIES, 30, 37)
    walled = record(Scripted(), SLOW)
    assert (walled["clock"], walled["frame_ms"], walled["wall_ms"]) == (WALL, 30, None)


def test_what_the_cpu_draws_is_compared_with_others_by_the_wall() -> None:
    worker = Scripted(clock=lambda number: QUERIES)
    worker.on_cpu = {SLOW}
    found = timed(worker, SLOW, FAST)
    slow, fast = (row_of(one) for one in found.values())
    assert (slow["clock"], fast["clock"]) == (WALL, QUERIES)
    assert Counter(worker.calls)["time_frame", SLOW] == 3  # two clocks, but each cell has one
    assert slow["added_ms"] == np.median([30 - 8, 20 - 9, 100 - 16])
    assert slow["reference_ms"] == fast["reference_ms"] + 7


def test_a_group_without_a_change_of_clock_is_measured_once() -> None:
    for clock in (QUERIES, WALL):
        worker = Scripted(clock=lambda number, clock=clock: clock)  # type: ignore[misc]
        timed(worker, SLOW)
        assert Counter(worker.calls)["time_frame", SLOW] == 3


# 9 samples are frames of three cells, 9 more are passes.
@pytest.mark.parametrize("last_query", [1, 5, 8, 9, 10, 17])
def test_times_of_two_clocks_are_thrown_away_and_measured_again(last_query: int) -> None:
    worker = Scripted(clock=lambda number: QUERIES if number <= last_query else WALL)
    row = record(worker, SLOW)
    assert (row["clock"], row["wall_ms"]) == (WALL, None)
    assert (row["frame_ms"], row["n"]) == (1030, 3)  # of the second series alone
    assert row["passes"]["depth"]["n"] == 1
    assert row["passes"]["depth"]["ms"] == 6
    assert Counter(worker.calls)["time_frame", SLOW] == 6
    assert Counter(worker.calls)["prepare_timing", SLOW] == 1


def crash(wanted: str, of: str | None = None, error: Exception | None = None) -> Callable[..., Exception | None]:
    """Fails a method, of one cell or of all."""
    error = error or CellFailed("crashed: SIGSEGV")
    return lambda method, name: error if method == wanted and of in (None, name) else None


def test_a_view_that_cannot_be_opened_costs_the_times_of_its_cells() -> None:
    for error in (CellFailed("crashed: SIGSEGV"), MemoryExceeded("ate memory")):
        worker = Scripted(fails=crash("open", error=error))
        found = timed(worker, SLOW, FAST, FLOOR, reference=FLOOR)
        assert found == dict.fromkeys([SLOW, FAST, FLOOR], f"opening the view: {error}")
        assert Counter(worker.calls)["open", None] == 1


@pytest.mark.parametrize("method", ["prepare_timing", "time_frame", "time_passes"])
def test_a_failing_unshadowed_reference_costs_only_times(method: str) -> None:
    found = timed(Scripted(fails=crash(method, FLOOR)), SLOW, FAST)
    assert found == dict.fromkeys([SLOW, FAST], "the floor, unshadowed: crashed: SIGSEGV")


@pytest.mark.parametrize("method", ["prepare_timing", "time_frame", "time_passes"])
def test_a_cell_that_fails_costs_its_own_time(method: str) -> None:
    slow, fast = (timed(Scripted(fails=crash(method, SLOW)), SLOW, FAST)[name] for name in (SLOW, FAST))
    assert row_of(slow)["status"] == "failed: crashed: SIGSEGV"
    assert row_of(fast)["ratio"] is not None


@pytest.mark.parametrize("method", ["draw", "prepare_timing", "time_frame"])
@pytest.mark.parametrize(
    ("error", "status"),
    [(CellFailed("crashed: SIGSEGV"), "failed: crashed: SIGSEGV"), (Unsupported("a point"), "unsupported: a point")],
)
def test_a_row_says_why_it_has_no_ratio(method: str, error: Exception, status: str) -> None:
    found = timed(Scripted(fails=crash(method, REFERENCE, error)), SLOW)
    assert isinstance(found[REFERENCE], str)
    row = row_of(found[SLOW])
    assert (row["ratio"], row["ratio_iqr"], row["no_ratio"], row["n"]) == (None, None, status, 3)


def test_a_worker_that_does_not_exit_is_killed_and_its_times_are_kept() -> None:
    worker = Scripted(fails=crash("release_timed"))
    assert isinstance(timed(worker, SLOW)[SLOW], Times)
    assert worker.calls[-2:] == [("release_timed", None), ("stop", None)]


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


@pytest.mark.parametrize(("times", "fails_at_last"), [(1, False), (2, True)])
def test_a_cell_alone_that_eats_memory_is_tried_in_a_fresh_worker(times: int, fails_at_last: bool) -> None:
    def fails(method: str, name: str | None) -> Exception | None:
        often = Counter(worker.calls)["prepare_timing", SLOW]
        return MemoryExceeded("ate memory") if (method, name) == ("prepare_timing", SLOW) and often <= times else None

    worker = Scripted(fails=fails)
    (found,) = timed(worker, SLOW).values()
    assert isinstance(found, str) == fails_at_last
    assert Counter(worker.calls)["prepare_timing", SLOW] == 2


@pytest.mark.parametrize(
    ("chosen", "names"),
    [
        ("shadow-map", {"directional": "shadow-map:size=1024", "spot": "shadow-map:size=1024"}),
        ("shadow-map:fit=scene,size=64", {"spot": "shadow-map:fit=scene,size=64"}),
        ("cascades:size=512", {"directional": "cascades:size=512", "spot": "unshadowed"}),
        ("cube-map:size=64", {"directional": "unshadowed", "point": "cube-map:size=64"}),
        ("ray-traced", {"directional": "ray-traced", "spot": "ray-traced", "point": "ray-traced"}),
    ],
)
def test_a_kind_of_light_that_the_reference_does_not_answer_has_its_own(
    chosen: str, names: dict[LightKind, str]
) -> None:
    at_a_point: dict[LightKind, str] = {"point": "cube-map:size=1024"}
    for kind, name in (at_a_point | names).items():
        assert reference_name(block_under(kind, chosen).reference_cell.spec) == name
