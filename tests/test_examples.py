"""The plug-ins in examples/, measured by `run`."""

import csv
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).resolve().parents[1]
PLUGINS = {
    "exponential_shadow_map.py": "exponential-shadow-map",
    "sphere_proxies.py": "sphere-proxies",
    "variance_shadow_map.py": "variance-shadow-map",
}
NO_PLUGINS = {"vtk_shadows.py"}  # plays the engine in tests/engines/test_real_masks.py
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


def test_every_example_is_tested() -> None:
    assert {file.name for file in (ROOT / "examples").glob("*.py")} == {*PLUGINS, *NO_PLUGINS}


@pytest.mark.slow
def test_variance_shadow_map_draws_the_lamp_s_shadow_nearly_as_a_hard_map_does(iou: Callable[..., Any]) -> None:
    found = iou("spot-lamp", "variance_shadow_map.py", "variance-shadow-map", "shadow-map", "unshadowed")
    assert found["unshadowed"] == 0
    assert 1 - found["variance-shadow-map"] < 0.2
    assert found["variance-shadow-map"] < found["shadow-map"], "light bleeds where casters lie over each other"


def test_variance_shadow_map_draws_a_sun_s_shadow_too(iou: Callable[..., Any]) -> None:
    assert iou("cube-on-plane", "variance_shadow_map.py", "variance-shadow-map")["variance-shadow-map"] > 0.8


@pytest.mark.parametrize("scene", ["cube-on-plane", pytest.param("spot-lamp", marks=pytest.mark.slow)])
def test_exponential_shadow_map_is_about_as_right_as_a_depth_map(iou: Callable[..., Any], scene: str) -> None:
    found = iou(
        scene, "exponential_shadow_map.py", "exponential-shadow-map", "exponential-shadow-map:c=5.0", "shadow-map"
    )
    assert 1 - found["exponential-shadow-map"] < 1.5 * (1 - found["shadow-map"])
    assert found["exponential-shadow-map:c=5.0"] < found["exponential-shadow-map"], "a blunt exponential leaks"


def test_a_map_technique_with_contents_of_its_own_takes_50_lines() -> None:
    assert len((ROOT / "examples" / "exponential_shadow_map.py").read_text(encoding="utf-8").splitlines()) <= 50


def test_sphere_proxies_are_right_for_a_ball_and_wrong_for_a_cube(iou: Callable[..., Any], tmp_path: Path) -> None:
    (tmp_path / "ball.toml").write_text(BALL, encoding="utf-8")
    exact = f"sphere-proxies:scale={3**-0.5!r}"  # the half diagonal of a ball's bounds is √3 of its radius
    assert iou(tmp_path / "ball.toml", "sphere_proxies.py", exact)[exact] > 0.98
    assert 0.3 < iou("cube-on-plane", "sphere_proxies.py", "sphere-proxies")["sphere-proxies"] < 0.8
