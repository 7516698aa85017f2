"""The plug-ins in examples/, measured by `run`; tests/plugin/test_plugins.py measures the spheres."""

import csv
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

FILE = Path(__file__).resolve().parents[1] / "examples" / "variance_shadow_map.py"


@pytest.mark.slow
def test_the_variance_filter_is_the_built_in_one_with_another_reduction(
    shadowbench: Callable[..., Any], tmp_path: Path
) -> None:
    specs = [f"shadow-map:filter={one}" for one in ("variance(bleed=0.1)", "vsm(bleed=0.1,min_variance=1e-06)")]
    options = ("--view-size", "256", "--rounds", "1", "-o", tmp_path / "run", "-q")
    answer = shadowbench("run", "cube-on-plane", "-t", specs[0], "-t", specs[1], "--plugin", FILE, *options)
    assert answer.code == 0, answer.err
    with (tmp_path / "run" / "table.csv").open(newline="", encoding="utf-8") as stream:
        iou = {row["spec"]: float(row["iou"]) for row in csv.DictReader(stream)}
    assert iou[specs[0]] == pytest.approx(iou[specs[1]], abs=0.01) and iou[specs[1]] > 0.8
