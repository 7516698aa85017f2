"""`pytest benchmarks` in a subprocess: what it stores. That each suite runs at all, `make test-slow` tries itself."""

import csv
import json
import math
import os
import subprocess
import sys
from pathlib import Path

import pytest

from shadowbench.plugin.registry import techniques
from shadowbench.scores.metrics import METRICS
from shadowbench.studies.study import find_study, read_study

ROOT = Path(__file__).resolve().parents[2]


def test_every_technique_is_timed_at_every_map_size() -> None:
    study = read_study(find_study("trends"), techniques())
    assert {spec.technique.name for spec in study.specs} == set(techniques())
    assert study.map_size == (512, 1024, 2048, 4096)


@pytest.mark.slow
def test_scores_of_the_run_and_exponents_of_growth_are_stored(tmp_path) -> None:
    ours = {name: value for name, value in os.environ.items() if not name.startswith("PYTEST_")}  # not xdist's
    chosen = "cube-on-plane and (cube-map-512 or (shadow-map and (512 or 1024)))"
    words = ["pytest", "-p", "no:cacheprovider", "-rs", "benchmarks/test_techniques.py", "-k", chosen]
    for command in (
        [*words, f"--benchmark-json={tmp_path / 'found.json'}"],
        ["shadowbench", "run", "cube-on-plane", "-t", "shadow-map:size=512", "--rounds", "0", "-o", tmp_path / "run"],
    ):
        done = subprocess.run(
            [sys.executable, "-m", *map(str, command)], cwd=ROOT, env=ours, capture_output=True, text=True, timeout=280
        )
        assert done.returncode == 0, done.stdout + done.stderr
        if command[0] == "pytest":
            assert "a directional light has no position to look around from" in done.stdout
            assert "shadow-map over map size, 512 to 1024" in done.stdout
    found = {entry["name"]: entry for entry in json.loads((tmp_path / "found.json").read_text())["benchmarks"]}
    small, large = (found[f"test_frame[cube-on-plane-shadow-map-{size}]"] for size in (512, 1024))
    told = small["extra_info"]
    assert small["group"] == "cube-on-plane" and told["exponent_over"] == [512, 1024]
    assert told["exponent"] == pytest.approx(math.log2(large["extra_info"]["frame_ms"] / told["frame_ms"]), abs=1e-3)
    (ran,) = csv.DictReader((tmp_path / "run" / "table.csv").read_text().splitlines())
    assert {name: told[name] for name in METRICS} == {name: float(ran[name]) if ran[name] else None for name in METRICS}
    assert (told["mask_sha256"], str(told["work_cost"])) == (ran["mask_sha256"], ran["work_cost"])
