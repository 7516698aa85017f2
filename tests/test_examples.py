"""The plug-ins in examples/, measured by `run`."""

import csv
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).resolve().parents[1]
BALL = """
name = "ball"
camera = { position = [2.0, 3.0, 4.0], target = [0.3, 0.3, 0.0] }
light = { kind = "directional", direction = [0.8, -1.0, -0.3] }
mesh = [{ shape = "plane", scale = 6.0 }, { shape = "sphere", translate = [0.0, 1.0, 0.0] }]
"""


@pytest.fixture
def iou(shadowbench: Callable[..., Any], tmp_path: Path) -> Callable[..., dict[str, float]]:
    """The IoU of specs on a scene, by spec, as `run` writes it."""

    def run(scene: str | Path, file: str, *specs: str, view_size: int = 256) -> dict[str, float]:
        asked = [part for spec in specs for part in ("-t", spec)]
        folder = tmp_path / f"run of {Path(scene).stem}"
        options = ("--view-size", str(view_size), "--rounds", "1", "-o", folder, "-q")
        answer = shadowbench("run", scene, *asked, "--plugin", ROOT / "examples" / file, *options)
        assert answer.code == 0, answer.err
        with (folder / "table.csv").open(newline="", encoding="utf-8") as stream:
            rows = list(csv.DictReader(stream))
        assert [row["status"] for row in rows] == ["ok"] * len(specs)
        return {row["spec"]: float(row["iou"]) for row in rows}

    return run


def test_the_variance_filter_is_the_built_in_one_with_another_reduction(iou: Callable[..., Any]) -> None:
    specs = [f"shadow-map:filter={one}" for one in ("variance(bleed=0.1)", "vsm(bleed=0.1,min_variance=1e-06)")]
    found = iou("cube-on-plane", "variance_shadow_map.py", *specs)
    assert found[specs[0]] == pytest.approx(found[specs[1]], abs=0.01) and found[specs[1]] > 0.8


@pytest.mark.slow
def test_sphere_proxies_are_right_for_a_ball_and_wrong_for_a_cube(iou: Callable[..., Any], tmp_path: Path) -> None:
    (tmp_path / "ball.toml").write_text(BALL, encoding="utf-8")
    exact = f"sphere-proxies:scale={3**-0.5!r}"  # the half diagonal of a ball's bounds is √3 of its radius
    assert iou(tmp_path / "ball.toml", "sphere_proxies.py", exact)[exact] > 0.98
    assert 0.3 < iou("cube-on-plane", "sphere_proxies.py", "sphere-proxies")["sphere-proxies"] < 0.8
