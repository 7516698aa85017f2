"""Masks of real renderers: ours, good and bad, raise no false alarm; those of VTK work with `export` and `score`."""

import json
import re
import subprocess
from collections.abc import Callable
from pathlib import Path

import pytest

from shadowbench.engines.programs import install
from shadowbench.masks.accuracy import detect_encoding, misorientation
from shadowbench.plugin.registry import engines
from shadowbench.scores.masks import read_mask
from tests.samples import daily

ROOT = Path(__file__).resolve().parents[2]

pytestmark = [pytest.mark.slow, pytest.mark.timeout(900)]

SCENES = ["cube-on-plane", "stairs", "spot-lamp", "railings", "terrain", "pebbles", "street"]
STUDY = """
map_size = [256, 1024]
view_size = 256
rounds = 0
[[technique]]
spec = "unshadowed"
[[technique]]
spec = "planar-projection"
[[technique]]
spec = "shadow-map:fit=scene"
bias = ["none", "constant", "constant(units=0.2)", "slope(max=0.05,min=0.005)", "texel"]
filter = ["hard", "pcf(taps=5)"]
"""


@pytest.mark.parametrize("scene", daily(SCENES, 2))
def test_no_mask_of_ours_is_taken_for_turned_shifted_or_encoded(
    scene: str, shadowbench: Callable, comparison: Callable, tmp_path: Path
) -> None:
    (tmp_path / "study.toml").write_text(f'scenes = ["{scene}"]{STUDY}')
    assert shadowbench("run", "-s", tmp_path / "study.toml", "-o", tmp_path / "run", "-q").code == 0
    rows = [json.loads(line) for line in (tmp_path / "run" / "rows.jsonl").read_text().splitlines()]
    held = [row for row in rows if row["kind"] == "score" and row["status"] == "ok"]
    assert len(held) > 20
    alarms = []
    for row in held:
        one = comparison(read_mask(tmp_path / "run" / "masks" / f"{row['key']}.png"), scene)
        reading = detect_encoding(one)
        found = misorientation(one.visibility, one.truth), reading.shift, reading.srgb_encoded or None, reading.umbra
        if any(found):
            alarms.append((row["spec"], row["map_size"], found))
    assert alarms == []


def test_vtk_goes_through_export_and_score(shadowbench: Callable, tmp_path: Path) -> None:
    """VTK leaves some of the light in its shadows: a fifth of it on a plane."""
    python = install(engines()["vtk"]) / "bin" / "python"
    assert shadowbench("export", "cube-on-plane", tmp_path, "--view-size", "256").code == 0
    subprocess.run([python, ROOT / "examples" / "vtk_shadows.py", tmp_path], check=True)
    pictures = ("--lit", tmp_path / "lit.png", "--shadowed", tmp_path / "shadowed.png")
    answer = shadowbench("score", "cube-on-plane", *pictures, "--json", "-o", tmp_path / "run", "--name", "vtk")
    scored = json.loads(answer.out)
    (warning,) = scored["warnings"]
    assert re.search(r"its shadow is 0\.1[5-9], not 0; scored as it is; --ambient takes ambient light off$", warning)
    assert 0.93 < scored["metrics"]["iou"] < 1
    (row,) = [json.loads(line) for line in (tmp_path / "run" / "rows.jsonl").read_text().splitlines()]
    assert row["metrics"] == scored["metrics"] and row["renderer"] == "external: vtk"
    assert (tmp_path / "run" / "pictures" / f"{row['key']}.png").exists()
