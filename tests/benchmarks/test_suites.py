"""`pytest benchmarks` in a subprocess: a selection is run, saved and compared."""

import csv
import json
import math
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from shadowbench.plugin.registry import techniques
from shadowbench.scores.metrics import METRICS
from shadowbench.studies.study import find_study, read_study

ROOT = Path(__file__).resolve().parents[2]
pytestmark = pytest.mark.slow


def bench(*arguments: str | Path) -> str:
    """Output of a pytest run that succeeds; without the environment variables of xdist."""
    ours = {name: value for name, value in os.environ.items() if not name.startswith("PYTEST_")}
    command = [sys.executable, "-m", "pytest", "-p", "no:cacheprovider", *map(str, arguments)]
    done = subprocess.run(command, cwd=ROOT, env=ours, capture_output=True, text=True, timeout=280)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def entries(file: Path) -> dict[str, dict[str, Any]]:
    """The benchmarks of a JSON file by their names."""
    return {entry["name"]: entry for entry in json.loads(file.read_text())["benchmarks"]}


def test_every_technique_is_timed_at_every_map_size() -> None:
    study = read_study(find_study("trends"), techniques())
    assert {spec.technique.name for spec in study.specs} == set(techniques())
    assert study.map_size == (512, 1024, 2048, 4096)
    listed = bench("benchmarks/test_techniques.py", "--collect-only", "-q")
    for cell in study.cells():
        named = "-".join(filter(None, (cell.spec.technique.name, str(cell.spec.map_size or ""))))
        assert f"[cube-on-plane-{named}]" in listed


def test_a_benchmark_selection_saves_its_scores_and_two_runs_can_be_compared(tmp_path) -> None:
    suite, storage = "benchmarks/test_techniques.py", f"--benchmark-storage={tmp_path / 'saved'}"
    chosen = "cube-on-plane and (unshadowed or (shadow-map and (512 or 1024)))"
    for number in range(2):
        bench(suite, "-k", chosen, "--benchmark-autosave", storage, f"--benchmark-json={tmp_path / f'{number}.json'}")
    first, second = (entries(tmp_path / f"{number}.json") for number in range(2))
    assert {name.partition("[")[2] for name in first} == {
        "cube-on-plane-unshadowed]", "cube-on-plane-shadow-map-512]", "cube-on-plane-shadow-map-1024]",
    }  # fmt: skip
    for name, entry in first.items():
        told = entry["extra_info"]
        assert entry["group"] == "cube-on-plane"
        assert set(METRICS) <= set(told)
        assert (told["ssim"], told["iou"]) == tuple(second[name]["extra_info"][key] for key in ("ssim", "iou"))
        assert told["frame_ms"] / 1e3 <= entry["stats"]["median"] * 1.01
    study = ["run", "cube-on-plane", "-t", "shadow-map:size=512", "--rounds", "0", "-o"]
    command = [sys.executable, "-m", "shadowbench", *study, tmp_path / "run"]
    subprocess.run(command, check=True, capture_output=True, timeout=200)
    (ran,) = csv.DictReader((tmp_path / "run" / "table.csv").read_text().splitlines())
    told = first["test_frame[cube-on-plane-shadow-map-512]"]["extra_info"]
    assert {name: told[name] for name in METRICS} == {name: float(ran[name]) if ran[name] else None for name in METRICS}
    assert (told["mask_sha256"], str(told["work_cost"])) == (ran["mask_sha256"], ran["work_cost"])
    assert len(list((tmp_path / "saved").rglob("*.json"))) == 2
    compared = bench(suite, "-k", chosen, storage, "--benchmark-compare=0001")
    assert "(0001_" in compared and "(NOW)" in compared


def test_the_exponent_of_growth_is_fitted_printed_and_saved(tmp_path) -> None:
    file = tmp_path / "growth.json"
    chosen = "(test_triangles and unshadowed and (1280 or 20480)) or (test_a_cell and (512 or 1024))"
    printed = bench("benchmarks", "-k", chosen, f"--benchmark-json={file}")
    found = entries(file)
    for one, other, sizes in (
        ("test_triangles[1280-unshadowed]", "test_triangles[20480-unshadowed]", [1280, 20480]),
        ("test_a_cell[512]", "test_a_cell[1024]", [512**2, 1024**2]),
    ):
        times = [found[name]["stats"]["median"] for name in (one, other)]
        slope = math.log(times[1] / times[0]) / math.log(sizes[1] / sizes[0])
        for name in (one, other):
            assert found[name]["extra_info"]["exponent"] == pytest.approx(slope, abs=0.001)
            assert found[name]["extra_info"]["exponent_over"] == sizes
    assert found["test_a_cell[1024]"]["extra_info"]["ms_per_megapixel"] == pytest.approx(1e3 * times[1], abs=0.1)
    assert "unshadowed over triangles, 1280 to 20480" in printed


def test_unsupported_cells_are_skipped_with_the_reason() -> None:
    printed = bench("benchmarks/test_techniques.py", "-rs", "-k", "cube-on-plane and cube-map-512")
    assert "a directional light has no position to look around from" in printed
    assert "1 skipped" in printed
