"""Folders of many cells: `check` and `merge` in a bounded time and memory, and a report that opens at once.

    pytest benchmarks/test_folders.py -rP

CPU seconds, peaks of memory, and the seconds until all charts are drawn.
"""

import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import psutil
import pytest
from pytest_benchmark.fixture import BenchmarkFixture

from benchmarks.synthetic import write_folder

CELLS = 100_000
SHOWN = 10_000
OPEN_S = 3.0

pytestmark = pytest.mark.timeout(1200)


def cost(*words: str | Path) -> tuple[float, int]:
    """CPU seconds and peak bytes of a command, which may exit with 1."""
    process = psutil.Popen([sys.executable, "-m", "shadowbench", *map(str, words)], stdout=subprocess.DEVNULL)
    seconds, peak = 0.0, 0
    while process.poll() is None:
        try:
            times = process.cpu_times()
            seconds, peak = times.user + times.system, max(peak, process.memory_info().rss)
        except psutil.NoSuchProcess:
            break
        time.sleep(0.02)
    assert process.returncode in (0, 1)
    return seconds, peak


@pytest.mark.parametrize(("command", "most_s"), [("check", 20.0), ("merge", 40.0)])
@pytest.mark.benchmark(group="folders")
def test_a_hundred_thousand_cells(command: str, most_s: float, tmp_path: Path, benchmark: BenchmarkFixture) -> None:
    found, before = write_folder(tmp_path / "found", CELLS), write_folder(tmp_path / "before", CELLS, seed=1)
    words = (found, "--baseline", before) if command == "check" else (found, "-o", tmp_path / "merged")
    seconds, peak = benchmark.pedantic(cost, args=(command, *words), rounds=1)
    benchmark.extra_info |= {"cpu_s": seconds, "peak_bytes": peak}
    print(f"{command}: {seconds:.1f} CPU s, {peak / 2**20:.0f} MiB")
    assert seconds <= most_s and peak <= 1 << 30


@pytest.mark.benchmark(group="folders")
def test_a_split_report_of_ten_thousand_cells_opens(browser: Any, tmp_path: Path, benchmark: BenchmarkFixture) -> None:
    run, file = write_folder(tmp_path / "run", SHOWN, pictures=True), tmp_path / "report.html"
    cost("report", run, "--split", "-o", file)

    def open_page() -> None:
        page = browser.new_page(viewport={"width": 1280, "height": 900})
        page.goto(file.as_uri())
        page.evaluate("window.drawn")
        page.close()

    benchmark.pedantic(open_page, rounds=5, warmup_rounds=1)
    if benchmark.stats is not None:
        assert benchmark.stats.stats.median <= OPEN_S
