"""Shared fixtures of the benchmark suites: curves of time over size, and what a command takes.

    pytest benchmarks                                  # all of them, in less than ten minutes on two cores
    pytest benchmarks --benchmark-disable              # each once, at the smallest of its sizes: do they still run?
    pytest benchmarks -k cascades --benchmark-autosave
    pytest benchmarks -k cascades --benchmark-compare

Cells are measured by the fixture `shadow_benchmark`, as those of anyone's own technique are: see its how-to page.
Times and memory are those of one machine: they are printed and stored, and no test fails by them.
"""

import shutil
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass, field
from itertools import chain
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import psutil
import pytest
from pytest_benchmark.fixture import BenchmarkFixture


class Point(NamedTuple):
    """A size, what was measured there, and its entry in the benchmark report."""

    size: float
    value: float
    extra_info: dict[str, Any]


@dataclass
class Growth:
    """Curves of time or memory over size, each with its best-fitting exponent k: time ~ size^k."""

    curves: dict[str, list[Point]] = field(default_factory=dict)

    def add(self, curve: str, size: float, benchmark: BenchmarkFixture, entry: str | None = None) -> None:
        """Add a time, or another entry, to a curve, and update the exponent in the report entries of all its points."""
        if benchmark.stats is None:  # --benchmark-disable
            return
        points = self.curves.setdefault(curve, [])
        value = benchmark.stats.stats.median if entry is None else benchmark.extra_info[entry]
        points.append(Point(size, value, benchmark.extra_info))
        if len(points) > 1 and entry in (None, "frame_ms"):
            for point in points:
                point.extra_info["exponent"] = round(self.exponent(curve), 3)
                point.extra_info["exponent_over"] = [point.size for point in points]

    def add_cell(self, curve: str, size: float, benchmark: BenchmarkFixture) -> None:
        """Add the time of a cell's frames, that of its preparation and its memory to curves of their own."""
        for entry, name in (
            ("frame_ms", curve),
            ("prepare_ms", f"prepare_ms of {curve}"),
            ("gpu_bytes", f"gpu_bytes of {curve}"),
        ):
            self.add(name, size, benchmark, entry)

    def exponent(self, curve: str) -> float:
        """Slope of log(value) over log(size)."""
        sizes, values, _ = zip(*self.curves[curve], strict=True)
        return float(np.polyfit(np.log(sizes), np.log(values), 1)[0])


class Cost(NamedTuple):
    """What a command and the processes that it starts take."""

    returncode: int
    cpu_s: float
    peak_bytes: int


_GROWTH = pytest.StashKey[Growth]()


def pytest_configure(config: pytest.Config) -> None:
    config.stash[_GROWTH] = Growth()


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """With --benchmark-disable, leave each test here the smallest of its sizes: of its parameters that are integers."""
    if not config.getoption("benchmark_disable"):
        return
    sizes = {
        item: [((item.function, name), value) for name, value in item.callspec.params.items() if isinstance(value, int)]
        for item in items
        if isinstance(item, pytest.Function) and hasattr(item, "callspec") and item.path.parent == Path(__file__).parent
    }
    least: dict[Any, int] = {}
    for size, value in chain.from_iterable(sizes.values()):
        least[size] = min(value, least.get(size, value))
    items[:] = [item for item in items if all(value == least[size] for size, value in sizes.get(item, ()))]


@pytest.fixture(scope="session")
def smallest(pytestconfig: pytest.Config) -> bool:
    """Whether benchmarks are disabled, for sizes that are no parameters."""
    return bool(pytestconfig.getoption("benchmark_disable"))


def pytest_terminal_summary(terminalreporter: Any, config: pytest.Config) -> None:
    growth = config.stash[_GROWTH]
    fitted = {curve: points for curve, points in growth.curves.items() if len(points) > 1}
    if fitted:
        terminalreporter.section("how times and memory grow: time ~ size^k")
        for curve, points in fitted.items():
            low, high = points[0].size, points[-1].size
            values = ", ".join(f"{point.value:.4g}" for point in points)
            terminalreporter.line(f"k = {growth.exponent(curve):5.2f}  {curve}, {low:g} to {high:g}: {values}")


@pytest.fixture(scope="session")
def growth(request: pytest.FixtureRequest) -> Growth:
    return request.config.stash[_GROWTH]


@pytest.fixture(scope="session")
def cost() -> Callable[..., Cost]:
    """Runs `python WORDS` and says what it took; the last few hundredths of a second of each process are missed."""

    def run(*words: str | Path) -> Cost:
        process = psutil.Popen([sys.executable, *map(str, words)], stdout=subprocess.DEVNULL)
        seconds: dict[int, float] = {}
        peak = 0
        while process.poll() is None:
            resident = 0
            with suppress(psutil.NoSuchProcess):
                for one in (process, *process.children(recursive=True)):
                    with suppress(psutil.NoSuchProcess):
                        times = one.cpu_times()
                        seconds[one.pid] = times.user + times.system
                        resident += one.memory_info().rss
            peak = max(peak, resident)
            time.sleep(0.02)
        return Cost(process.returncode, sum(seconds.values()), peak)

    return run


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    """A headless Chromium, by playwright."""
    playwright = pytest.importorskip("playwright.sync_api", reason="playwright belongs to the extra `test`")
    chromium = shutil.which("chromium")
    if chromium is None:
        pytest.skip("no chromium on the path; `tools/setup.sh chromium` installs it")
    with playwright.sync_playwright() as started:
        # A container's root has no sandbox to give; the page is ours.
        opened = started.chromium.launch(executable_path=chromium, args=["--no-sandbox"])
        yield opened
        opened.close()
