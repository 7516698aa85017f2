"""What the suites share: a session on the device in this process, and how times grow.

    pytest benchmarks                                  # all of them, in less than ten minutes on two cores
    pytest benchmarks -k cascades --benchmark-autosave
    pytest benchmarks -k cascades --benchmark-compare

pytest-benchmark times one cell after the other, where `shadowbench run` takes them in turn: what the machine does
meanwhile falls on some and not on others. Follow one cell over time with these numbers; take ratios from `run`.
"""

import os
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest
from pytest_benchmark.fixture import BenchmarkFixture

from shadowbench.measure.cells import CellRequest, PlacedView
from shadowbench.measure.session import Session, Unsupported
from shadowbench.scenes.model import View

ROUNDS = 9


class Point(NamedTuple):
    """A size, the median seconds at it, and the entry of the report that says so."""

    size: float
    seconds: float
    extra_info: dict[str, Any]


@dataclass
class Growth:
    """Curves of time over size, and the exponent k that fits each best: time ~ size^k."""

    curves: dict[str, list[Point]] = field(default_factory=dict)

    def add(self, curve: str, size: float, benchmark: BenchmarkFixture) -> None:
        """Keep a time. All entries of a curve carry the exponent that fits the points measured by then."""
        if benchmark.stats is None:  # --benchmark-disable
            return
        points = self.curves.setdefault(curve, [])
        points.append(Point(size, benchmark.stats.stats.median, benchmark.extra_info))
        if len(points) > 1:
            for point in points:
                point.extra_info["exponent"] = round(self.exponent(curve), 3)
                point.extra_info["exponent_over"] = [point.size for point in points]

    def exponent(self, curve: str) -> float:
        """The slope of log(time) over log(size)."""
        sizes, seconds, _ = zip(*self.curves[curve], strict=True)
        return float(np.polyfit(np.log(sizes), np.log(seconds), 1)[0])


class Cells:
    """Cells of any view, drawn and timed by the code that `run` has in its worker."""

    def __init__(self) -> None:
        self.session = Session()

    def time(self, benchmark: BenchmarkFixture, view: View, spec: str) -> None:
        """Time a spec's frames, warmed up; skips the test of a cell that is unsupported, with the reason."""
        samples = []
        try:
            prepare_ms = self.session.prepare_timing(PlacedView(view), CellRequest(spec))
        except Unsupported as reason:
            pytest.skip(str(reason))
        try:
            benchmark.pedantic(lambda: samples.append(self.session.time_frame(0)), rounds=ROUNDS)
        finally:
            self.session.release_timed()
        benchmark.extra_info |= {
            "renderer": self.session.device.renderer,
            "clock": samples[-1].clock,
            "frame_ms": float(np.median([sample.ms for sample in samples])),
            "prepare_ms": prepare_ms,
        }


_GROWTH = pytest.StashKey[Growth]()


def pytest_configure(config: pytest.Config) -> None:
    config.stash[_GROWTH] = Growth()


def pytest_terminal_summary(terminalreporter: Any, config: pytest.Config) -> None:
    growth = config.stash[_GROWTH]
    fitted = {curve: points for curve, points in growth.curves.items() if len(points) > 1}
    if fitted:
        terminalreporter.section("how times grow: time ~ size^k")
        for curve, points in fitted.items():
            low, high = points[0].size, points[-1].size
            terminalreporter.line(f"k = {growth.exponent(curve):5.2f}  {curve}, {low:g} to {high:g}")


@pytest.fixture(scope="session")
def growth(request: pytest.FixtureRequest) -> Growth:
    return request.config.stash[_GROWTH]


@pytest.fixture(scope="session")
def scene_file() -> Callable[[str], str | Path]:
    """A built-in's name as it is; a mesh in the folder of larger scenes, which do not travel with the repository."""

    def find(name: str) -> str | Path:
        if "." not in name:
            return name
        file = Path(__file__).resolve().parents[1] / os.environ.get("SHADOWBENCH_SCENES", "../shared/scenes") / name
        if not file.exists():
            pytest.skip(f"no {file}; SHADOWBENCH_SCENES names its folder")
        return file

    return find


@pytest.fixture(scope="session")
def cells() -> Iterator[Cells]:
    cells = Cells()
    yield cells
    cells.session.unload()
