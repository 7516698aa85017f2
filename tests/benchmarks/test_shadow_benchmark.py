"""The pytest plug-in's `shadow_benchmark`, used in a folder of its own, as by who writes a technique."""

import json
import os
import subprocess
import sys
from contextlib import chdir
from pathlib import Path

import pytest
from typer.testing import CliRunner

from shadowbench.commands import app
from shadowbench.scores.metrics import METRICS

SUITE = """
from pathlib import Path
import pytest

MINE = {"scene": "stairs", "view_size": 64, "plugin": "my-shadows.py"}

def test_mine(shadow_benchmark):
    row = shadow_benchmark("my-shadows:size=256", **MINE, rounds=5, min_iou=0.7, baseline="baseline")
    assert row["leak"] < 0.01

def test_inaccurate(shadow_benchmark):
    shadow_benchmark("my-shadows:size=16", **MINE, rounds=1, min_iou=0.999)

def test_regressed(shadow_benchmark):
    worse = Path("my-shadows.py").read_text().replace("shadowed ? 0.0", "shadowed ? 1.0")
    Path("worse.py").write_text(worse)
    shadow_benchmark("my-shadows:size=256", **MINE | {"plugin": "worse.py"}, rounds=1, baseline="baseline")

def test_unknown_to_the_baseline(shadow_benchmark):
    shadow_benchmark("my-shadows:size=64", **MINE, rounds=1, baseline="baseline")

def test_lamp(shadow_benchmark):
    shadow_benchmark("my-shadows", scene="room-with-lamp", plugin="my-shadows.py", view_size=64)

def test_order(benchmark, shadow_benchmark):
    shadow_benchmark("my-shadows", **MINE)
"""


def call(folder: Path, *words: str) -> subprocess.CompletedProcess[str]:
    """pytest in a folder."""
    ours = {name: value for name, value in os.environ.items() if not name.startswith("PYTEST_")}  # not xdist's
    command = [sys.executable, "-m", "pytest", "-p", "no:cacheprovider", *words]
    return subprocess.run(command, cwd=folder, env=ours, capture_output=True, text=True, timeout=240)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a technique, the suite and a baseline."""
    folder = tmp_path_factory.mktemp("own")
    (folder / "test_mine.py").write_text(SUITE)
    with chdir(folder):
        for line in (
            "new-technique my-shadows",
            "run stairs -t my-shadows:size=256 --plugin my-shadows.py --view-size 64 --rounds 0 -o shadows",
            "check shadows --baseline baseline --update --plugin my-shadows.py",
        ):
            done = CliRunner().invoke(app, line.split())
            assert done.exit_code == 0, done.output
    return folder


@pytest.mark.slow
def test_a_suite_is_scored_and_timed_in_frames_of_the_reference(folder: Path) -> None:
    options = ("--benchmark-json=rows.json", "--benchmark-histogram=drawn")
    done = call(folder, "-rs", "--tb=short", *options)
    assert "3 failed, 1 passed, 1 skipped" in (out := done.stdout) and "1 error" in out, out
    assert "my-shadows:size=16 on stairs: iou is " in out and "; min_iou is 0.999" in out
    assert "my-shadows:size=256 on stairs: " in out and " in baseline, now " in out
    assert "baseline: no row of stairs my-shadows:fit=visible(oriented=true),size=64,bias=0.02; it has stairs" in out
    assert "my-shadows on room-with-lamp: unsupported" in out
    assert "Name (time in reference frames)" in out and "benchmark 'stairs'" in out
    assert "Speed in frames of the reference of stairs" in (folder / "drawn-stairs.svg").read_text()
    entries = {one["name"]: one for one in json.loads((folder / "rows.json").read_text())["benchmarks"]}
    row, stats = entries["test_mine"]["extra_info"], entries["test_mine"]["stats"]
    assert stats["rounds"] == 5 and stats["median"] == pytest.approx(row["ratio"]) and row["reference_ms"] > 0
    assert {*METRICS, "work_fragments", "gpu_bytes", "renderer", "frame_ms", "added_ms"} <= row.keys()


@pytest.mark.slow
def test_disabled_benchmarks_still_score(folder: Path) -> None:
    done = call(folder, "--benchmark-disable", "-k", "lamp or regressed")
    assert "1 failed, 1 skipped" in done.stdout, done.stdout
