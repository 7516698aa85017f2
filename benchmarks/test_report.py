"""The HTML report of a small run in Chromium: the time until something shows, and the size of the file.

pytest benchmarks/test_report.py -rP       prints both
"""

import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pytest_benchmark.fixture import BenchmarkFixture

ROUNDS = 9
PAINT = "performance.getEntriesByName('first-contentful-paint')[0]?.startTime"  # milliseconds since the navigation
STUDY = """
scenes = ["cube-on-plane", "colonnade"]
map_size = [512, 2048]
view_size = 256
rounds = 1
[[technique]]
spec = "unshadowed"
[[technique]]
spec = "shadow-map"
[[technique]]
spec = "cascades"
[[technique]]
spec = "shadow-volume"
"""


@pytest.fixture(scope="module")
def report(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("report")
    study, page = folder / "study.toml", folder / "report.html"
    study.write_text(STUDY, encoding="utf-8")
    for words in (["run", "-s", study, "-o", folder / "run"], ["report", folder / "run", "-o", page]):
        subprocess.run([sys.executable, "-m", "shadowbench", *words, "-q"], check=True)
    return page


@pytest.mark.benchmark(group="report")
def test_first_paint(report: Path, browser: Any, benchmark: BenchmarkFixture) -> None:
    """The benchmark's own time is that of all charts; each round opens the page anew, without a cache."""
    paints = []

    def open_page(measure: Callable[[float], object]) -> None:
        page = browser.new_page(viewport={"width": 1280, "height": 900})
        page.goto(report.as_uri())
        page.evaluate("window.drawn")
        measure(page.wait_for_function(PAINT).json_value())
        page.close()

    benchmark.pedantic(open_page, args=(paints.append,), rounds=ROUNDS, warmup_rounds=1)
    low, median, high = np.percentile(paints[-ROUNDS:], [25, 50, 75])
    benchmark.extra_info |= {"first_paint_ms": float(median), "bytes": report.stat().st_size}
    print(f"first contentful paint {median:.0f} ms (IQR {low:.0f} to {high:.0f}), {report.stat().st_size} bytes")
