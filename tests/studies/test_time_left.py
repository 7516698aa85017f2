"""The estimate of the time that a study takes."""

from dataclasses import dataclass, field

import pytest

from shadowbench.measure.cells import Cell
from shadowbench.studies.study import Study
from shadowbench.studies.time_left import TimeLeft, duration
from shadowbench.techniques.registry import techniques
from shadowbench.techniques.spec import parse_spec
from tests.runs import Notebook

CHEAP, DEAR = (Cell(parse_spec(text, techniques())) for text in ("unshadowed", "shadow-map:size=1024"))
STUDY = Study.of(["stairs"], [CHEAP.spec, DEAR.spec], reference=CHEAP.spec, view_size=64, rounds=9)


@dataclass
class Clock:
    now: float = 0.0
    reporter: Notebook = field(default_factory=Notebook)

    def __call__(self) -> float:
        return self.now

    def take(self, left: TimeLeft, seconds: float, what: str) -> None:
        self.now += seconds
        left.step(what)


@dataclass
class Scripted:
    """A study whose steps take as long as told."""

    left: TimeLeft
    clock: Clock

    @classmethod
    def of(cls, cells: list[Cell], timed: list[Cell]) -> "Scripted":
        clock = Clock()
        left = TimeLeft(clock.reporter, clock)
        left.expect(STUDY, cells, timed)
        left.stage("cells", len(cells) + len(timed))
        return cls(left, clock)

    def take(self, seconds: float, what: str) -> str:
        """What is shown after a step."""
        self.clock.take(self.left, seconds, what)
        return self.clock.reporter.steps[-1]


def test_cells_of_a_technique_take_what_those_before_took() -> None:
    run = Scripted.of([CHEAP] * 4 + [DEAR] * 3, [])
    run.take(1.0, "stairs unshadowed")
    run.take(100.0, "stairs shadow-map:size=1024")
    shown = run.take(1.0, "stairs unshadowed")
    assert run.left.seconds == pytest.approx(2 * 1.0 + 2 * 100.0)
    assert shown == "about 3 min left, stairs unshadowed"


def test_nothing_is_told_before_most_of_what_is_left_was_measured() -> None:
    """The first cell of a view takes long, whatever its technique: it says nothing of others, nor of timing."""
    run = Scripted.of([CHEAP] * 2 + [DEAR] * 2, [DEAR] * 4)
    words = ["unshadowed"] * 2 + ["shadow-map:size=1024"] * 2
    shown = [run.take(seconds, f"stairs {word}") for word, seconds in zip(words, (20.0, 0.1, 1.0, 1.0), strict=True)]
    shown += [run.take(seconds, "stairs: timed") for seconds in (40.0, 0.0, 0.0)]
    assert not [line for line in shown if " left, " in line]


def test_views_that_are_timed_at_once_take_as_long_as_those_before() -> None:
    """Three views, each of 4 s of drawing and 40 s of timing, all of whose steps come at its end."""
    run, shown = Scripted.of([DEAR] * 12, [DEAR] * 12), []
    for _ in range(3):
        shown += [run.take(1.0, "stairs shadow-map:size=1024") for _ in range(4)]
        shown += [run.take(seconds, "stairs: timed") for seconds in (40.0, 0.001, 0.001, 0.001)]
    told = [line.partition(",")[0] for line in shown]
    assert told[:8] == shown[:8]
    assert told[8:12] == [f"about {seconds} left" for seconds in ("87 s", "86 s", "85 s", "84 s")]
    assert told[16:20] == [f"about {seconds} s left" for seconds in (43, 42, 41, 40)]


def test_what_a_job_reports_at_once_was_measured_together() -> None:
    run = Scripted.of([CHEAP] * 8 + [DEAR] * 8, [])
    for _ in range(2):
        run.take(50.0, "stairs unshadowed")
        for word in ["unshadowed"] * 3 + ["shadow-map:size=1024"] * 4:
            run.take(1e-4, f"stairs {word}")
    shares = [kind.seconds / kind.modelled for kind in run.left.kinds.values()]
    assert shares[0] == pytest.approx(shares[1])


def test_a_slower_machine_is_noticed() -> None:
    run = Scripted.of([CHEAP] * 200, [])
    for seconds in (1.0, 3.0):
        for _ in range(50):
            run.take(seconds, "stairs unshadowed")
    assert run.left.seconds == pytest.approx(100 * 3.0, rel=0.02)


def test_cells_measured_before_take_no_time_and_teach_none() -> None:
    run = Scripted.of([CHEAP] * 3, [])
    run.take(9.0, "stairs: measured before")
    run.take(2.0, "stairs unshadowed")
    run.take(2.0, "stairs unshadowed")
    assert run.left.seconds == pytest.approx(2.0)
    assert run.take(2.0, "stairs unshadowed") == "stairs unshadowed"


def test_timing_is_extrapolated_apart_and_what_is_not_timed_is_left_out() -> None:
    run = Scripted.of([CHEAP] * 2, [CHEAP] * 4)
    run.take(1.0, "stairs unshadowed")
    run.take(5.0, "stairs: timed")
    run.take(1.0, "stairs unshadowed")
    run.take(0.0, "stairs: nothing to time")
    assert run.left.seconds == pytest.approx(2 * 5.0)


@pytest.mark.parametrize(("seconds", "text"), [(0.2, "1 s"), (40, "40 s"), (100, "2 min"), (7200, "2.0 h")])
def test_a_duration_is_rough(seconds: float, text: str) -> None:
    assert duration(seconds) == text
