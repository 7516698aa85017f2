"""Folders of many cells: `check` and `merge` of two, and a report that opens.

    pytest benchmarks/test_folders.py -rP

CPU seconds, peaks of memory, and the seconds until all charts are drawn.
"""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from pytest_benchmark.fixture import BenchmarkFixture

from benchmarks.synthetic import write_folder

CELLS = 20_000
SHOWN = 2_000
FEW = 100


@pytest.mark.parametrize("command", ["check", "merge"])
@pytest.mark.benchmark(group="folders")
def test_many_cells(
    command: str, tmp_path: Path, smallest: bool, cost: Callable[..., Any], benchmark: BenchmarkFixture
) -> None:
    cells = FEW if smallest else CELLS
    found, before = write_folder(tmp_path / "found", cells), write_folder(tmp_path / "before", cells, seed=1)
    words = (found, "--baseline", before) if command == "check" else (found, "-o", tmp_path / "merged")
    spent = benchmark.pedantic(cost, args=("-m", "shadowbench", command, *words), rounds=1)
    assert spent.returncode in ((0, 1) if command == "check" else (0,))
    benchmark.extra_info |= {"cells": cells, "cpu_s": spent.cpu_s, "peak_bytes": spent.peak_bytes}
    print(f"{command} of {cells} cells: {spent.cpu_s:.1f} CPU s, {spent.peak_bytes / 2**20:.0f} MiB")


@pytest.mark.benchmark(group="folders")
def test_a_report_of_many_cells_opens(
    browser: Any, tmp_path: Path, smallest: bool, cost: Callable[..., Any], benchmark: BenchmarkFixture
) -> None:
    run, file = write_folder(tmp_path / "run", FEW if smallest else SHOWN, pictures=True), tmp_path / "report.html"
    assert cost("-m", "shadowbench", "report", run, "-o", file).returncode == 0

    def open_page() -> None:
        page = browser.new_page(viewport={"width": 1280, "height": 900})
        page.goto(file.as_uri())
        page.evaluate("window.drawn")
        page.close()

    benchmark.pedantic(open_page, rounds=5, warmup_rounds=1)
