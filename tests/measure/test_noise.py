"""Timing noise, from one cell timed as if it were two; with known times."""

from collections import Counter
from collections.abc import Callable
from typing import Any
from unittest.mock import Mock

import pytest

from shadowbench.gl.clock import QUERIES, WALL, Sample
from shadowbench.measure import doctor
from shadowbench.measure.doctor import ROUNDS, SERIES, SPEC, Noise, measure_noise
from shadowbench.measure.drawer import CellFailed


class Scripted:
    """A worker with scripted times: the first cell takes `apart` times as long in the rounds of the last series."""

    def __init__(self, apart: float = 1.0, queries: int = 0) -> None:
        self.apart, self.queries = apart, queries
        self.calls: list[str] = []

    def call(self, asked: Callable[..., Any], *arguments: Any) -> Any:
        method = asked.__name__
        self.calls.append(method)
        if method == "prepare_timing":
            assert arguments[1].spec == SPEC
        if method != "time_frame":
            return None
        done = Counter(self.calls)["time_frame"]
        last_series = done > 2 * ROUNDS * (SERIES - 1)
        ms = 10 * self.apart if last_series and arguments[0] == 0 else 10.0
        return Sample(ms, ms, QUERIES if done <= self.queries else WALL)


def found(**options: Any) -> tuple[Noise, Scripted]:
    worker = Scripted(**options)
    return measure_noise(worker), worker  # type: ignore[arg-type]  # it lacks what noise does not ask for


def test_equal_times_have_no_noise() -> None:
    told, worker = found()
    assert (told.ratio, told.worst, told.n, told.frame_ms, told.clock) == (1, 1, SERIES * ROUNDS, 10, WALL)
    assert worker.calls == [
        "prepare_timing",
        "prepare_timing",
        "raise_clocks",
        *["time_frame"] * (2 * told.n),
        "release_timed",
    ]


@pytest.mark.parametrize("apart", [1.25, 0.8])
def test_the_worst_series_stands_beside_the_whole_and_a_ratio_is_never_below_one(apart: float) -> None:
    told, _ = found(apart=apart)
    assert told.ratio == 1
    assert told.worst == pytest.approx(1.25)


def test_queries_that_are_given_up_midway_begin_it_again() -> None:
    told, worker = found(queries=7)  # of the fourth round, one holding each
    assert (told.clock, told.n) == (WALL, SERIES * ROUNDS)
    assert Counter(worker.calls)["time_frame"] == 2 * (4 + SERIES * ROUNDS)


@pytest.mark.parametrize(
    ("found", "software", "said"),
    [
        (Noise(1.01, 1.02, 45, 3.0, QUERIES), False, {"noise": 1.01}),
        (Noise(1.01, 1.02, 45, 3.0, WALL), False, {"clock": WALL, "why_this_clock": "the GPU's timer said more"}),
        (Noise(1.06, 1.1, 45, 3.0, QUERIES), True, {"noise_is": "mean nothing"}),
        (CellFailed("crashed: SIGSEGV"), True, {"noise": "not measured: crashed: SIGSEGV"}),
    ],
)
def test_doctor_says_when_a_timer_was_given_up_and_when_noise_is_too_much_or_was_not_measured(
    monkeypatch: pytest.MonkeyPatch, found: Noise | CellFailed, software: bool, said: dict[str, Any]
) -> None:
    monkeypatch.setattr(doctor, "measure_noise", Mock(side_effect=[found]))
    told = doctor.clock_noise(Mock(), Mock(software=software, clock=QUERIES))
    assert all(str(value) in str(told[name]) for name, value in said.items())
    assert ("clock" in told, "mean nothing" in str(told)) == ("clock" in said, "noise_is" in said)
