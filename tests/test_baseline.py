"""The committed baseline: its contents, and that the current sources are no worse."""

import json
import os
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from shadowbench.maps.biases import Bias
from shadowbench.maps.filters import Filter
from shadowbench.maps.fits import Fit, Split
from shadowbench.plugin.params import Component
from shadowbench.plugin.registry import techniques
from shadowbench.results.frame import IDENTITY, identity
from shadowbench.studies.study import read_study
from tests.samples import sampled, todays

BASELINE = Path(__file__).resolve().parents[1] / "results" / "baseline"
ROWS = [json.loads(line) for line in (BASELINE / "rows.jsonl").read_text(encoding="utf-8").splitlines()]
STUDY = read_study(BASELINE / "study.toml", techniques())
HELD = [row for row in ROWS if row["status"] == "ok"]


def named(full_spec: str) -> tuple[Any, ...]:
    return identity({"full_spec": full_spec, **dict.fromkeys(IDENTITY)})


def test_the_baseline_has_the_cells_of_its_study() -> None:
    assert len({row["scene"] for row in ROWS}) == len(STUDY.scenes)
    for scene in {row["scene"] for row in ROWS}:
        cells = {named(cell.spec.full_text) for cell in STUDY.cells()}
        assert {named(row["full_spec"]) for row in ROWS if row["scene"] == scene} == cells
    assert not [row for row in ROWS if row["status"].startswith("failed")]


@pytest.mark.parametrize("family", [Bias, Filter, Fit, Split])
def test_every_component_occurs_in_the_baseline(family: type[Component]) -> None:
    names = {name for name, row in family.table.items() if row.__module__.startswith("shadowbench.")}
    held = {name for name in names for row in HELD if re.search(rf"[=+]{name}\b", row["full_spec"])}
    assert held == names


# Processors that are not this one: what Mesa's software renderer and Numba compile for, and on how many threads.
OF_AVX2 = {
    "GALLIUM_OVERRIDE_CPU_CAPS": "avx",  # AVX2 and fused multiply-add, without AVX-512
    "LP_NATIVE_VECTOR_WIDTH": "128",
    "MESA_SHADER_CACHE_DISABLE": "true",  # it does not know the width
    "LP_NUM_THREADS": "8",
    "NUMBA_NUM_THREADS": "8",
}
OF_SSE = {
    "GALLIUM_OVERRIDE_CPU_CAPS": "sse4.1",
    "LP_NATIVE_VECTOR_WIDTH": "128",
    "MESA_SHADER_CACHE_DISABLE": "true",
    "LP_NUM_THREADS": "1",
    "NUMBA_CPU_NAME": "generic",
    "NUMBA_CPU_FEATURES": "",
    "NUMBA_NUM_THREADS": "1",
}
# Scores that rounding moves by more than their tolerance, since these settings magnify it. Without fused multiply-add
# half of the masks change, all others by less; these by 1.2 tolerances.
MAGNIFIED = {
    # Without a bias each lit pixel's comparison is decided by rounding: 34 of 17,418 receivers change.
    ("kilometre", "shadow-map:depth=d16,bias=none,filter=hard"): {"ssim_edge", "mae_lit", "mae_area", "mae"},
    # A moment of 16 bits that rounds to its other neighbour moves visibility by up to 0.016. With 32 bits the sum of
    # all changes is a fifth.
    ("deep-street", "shadow-map:filter=msm(bits=16)"): {"bleed"},
}
PROCESSORS = {"this": {}, "AVX2": OF_AVX2, "SSE": OF_SSE}
RUNS = [("this", "1/1"), *((name, part) for name in ("AVX2", "SSE") for part in ("1/4", "2/4", "3/4", "4/4"))]


@pytest.mark.slow
@pytest.mark.timeout(900)
@pytest.mark.parametrize(("name", "part"), sampled(RUNS, [RUNS[0], *todays(RUNS[1:], len(RUNS) - 1)]))
def test_the_sources_do_as_well_as_the_baseline(name: str, part: str, tmp_path: Path) -> None:
    def shadowbench(*words: str | Path) -> subprocess.CompletedProcess[str]:
        command = [sys.executable, "-m", "shadowbench", *map(str, words)]
        return subprocess.run(command, capture_output=True, text=True, env=os.environ | PROCESSORS[name])

    run = shadowbench("run", "-s", BASELINE / "study.toml", "--part", part, "-o", tmp_path)
    assert run.returncode == 0, run.stderr
    check = shadowbench("check", tmp_path, "--baseline", BASELINE, "--json")
    assert check.returncode in (0, 1), check.stderr
    found = json.loads(check.stdout)
    assert (check.returncode == 1) == bool(found["regressed"]) and found["compared"] >= len(ROWS) // 6
    for change in (one for one in found["regressed"] if part == "1/1" or one["after"] != "missing"):
        allowed = MAGNIFIED.get((change["scene"], change["spec"]), set()) if name == "SSE" else set()
        assert change["what"] in allowed and change["tolerances"] < 1.5, change
