"""Rows per second of a study without times: measured here, and by Dask workers on this machine.

    pytest benchmarks/test_cluster.py -rP

Of the whole command, the start of the workers included.
"""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from pytest_benchmark.fixture import BenchmarkFixture

SCENES = ["cube-on-plane", "spot-lamp", "street"]


@pytest.mark.parametrize("dask", ["", "local:1", "local:2"], ids=["plain", "one worker", "two workers"])
@pytest.mark.benchmark(group="cluster")
def test_rows_per_second(
    dask: str, tmp_path: Path, smallest: bool, cost: Callable[..., Any], benchmark: BenchmarkFixture
) -> None:
    scenes, phases, view_size = (SCENES[:1], 1, 64) if smallest else (SCENES, 8, 512)
    words = ["-m", "shadowbench", "run", *scenes, "-q", "--rounds", "0", "--phases", phases, "--view-size", view_size]
    words += ["--dask", dask] if dask else []
    for technique in ("shadow-map:size=512", "shadow-map:size=1024", "shadow-volume"):
        words += ["-t", technique]
    spent = benchmark.pedantic(cost, args=(*map(str, words), "-o", tmp_path / "run"), rounds=1)
    assert spent.returncode == 0
    rows = len((tmp_path / "run" / "table.csv").read_text().splitlines()) - 1
    assert rows == len(scenes) * phases * 3
    benchmark.extra_info |= {"rows": rows, "cpu_s": spent.cpu_s, "peak_bytes": spent.peak_bytes}
    if benchmark.stats is not None:  # --benchmark-disable
        benchmark.extra_info["rows_per_second"] = rows / benchmark.stats.stats.median
        print(f"{dask or 'plain'}: {benchmark.extra_info['rows_per_second']:.2f} rows per second")
