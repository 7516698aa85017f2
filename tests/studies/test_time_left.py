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


def test_cells_of_a_technique_take_what_those_before_took() -> None:
    clock = Clock()
    left = TimeLeft(clock.reporter, clock)
    left.expect(STUDY, [CHEAP] * 4 + [DEAR] * 2, [])
    left.stage("cells", 6)
    clock.take(left, 1.0, "stairs unshadowed")
    clock.take(left, 100.0, "stairs shadow-map:size=1024")
    assert left.seconds == pytest.approx(3 * 1.0 + 100.0)
    assert clock.reporter.steps[-1] == "about 2 min left, stairs shadow-map:size=1024"


def test_cells_measured_before_take_no_time_and_teach_none() -> None:
    clock = Clock()
    left = TimeLeft(clock.reporter, clock)
    left.expect(STUDY, [CHEAP] * 2, [])
    left.stage("cells", 3)
    clock.take(left, 9.0, "stairs: measured before")
    clock.take(left, 2.0, "stairs unshadowed")
    assert left.seconds == pytest.approx(2.0)
    clock.take(left, 2.0, "stairs unshadowed")
    assert left.seconds == 0 and clock.reporter.steps[-1] == "stairs unshadowed"


def test_timing_is_extrapolated_apart_and_what_is_not_timed_is_left_out() -> None:
    clock = Clock()
    left = TimeLeft(clock.reporter, clock)
    left.expect(STUDY, [CHEAP], [CHEAP] * 4)
    left.stage("cells", 5)
    clock.take(left, 1.0, "stairs unshadowed")
    clock.take(left, 5.0, "stairs: timed")
    clock.take(left, 0.0, "stairs: nothing to time")
    assert left.seconds == pytest.approx(2 * 5.0)


@pytest.mark.parametrize(("seconds", "text"), [(0.2, "1 s"), (40, "40 s"), (100, "2 min"), (7200, "2.0 h")])
def test_a_duration_is_rough(seconds: float, text: str) -> None:
    assert duration(seconds) == text
