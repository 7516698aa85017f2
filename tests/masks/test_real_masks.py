"""Masks of real renderers: ours, good and bad, raise no false alarm; those of VTK work with `export` and `score`."""

import json
import re
import subprocess
import sys
import venv
from collections.abc import Callable
from pathlib import Path

import pytest

from shadowbench.masks.accuracy import detect_encoding, misorientation
from shadowbench.scores.masks import read_mask

ROOT = Path(__file__).resolve().parents[2]

pytestmark = [pytest.mark.slow, pytest.mark.timeout(900)]

STUDY = """
scenes = ["cube-on-plane", "stairs", "spot-lamp", "railings", "terrain", "pebbles", "street", "lamp-over-table"]
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
filter = ["hard", "hardware", "pcf(taps=5)"]
"""


def test_no_mask_of_ours_is_taken_for_turned_shifted_or_encoded(
    shadowbench: Callable, comparison: Callable, tmp_path: Path
) -> None:
    (tmp_path / "study.toml").write_text(STUDY)
    assert shadowbench("run", "-s", tmp_path / "study.toml", "-o", tmp_path / "run", "-q").code == 0
    rows = [json.loads(line) for line in (tmp_path / "run" / "rows.jsonl").read_text().splitlines()]
    held = [row for row in rows if row["kind"] == "score" and row["status"] == "ok"]
    assert len(held) > 150
    alarms = []
    for row in held:
        one = comparison(read_mask(tmp_path / "run" / "masks" / f"{row['key']}.png"), row["scene"])
        reading = detect_encoding(one)
        found = misorientation(one.visibility, one.truth), reading.shift, reading.srgb_encoded or None, reading.umbra
        if any(found):
            alarms.append((row["scene"], row["spec"], row["map_size"], found))
    assert alarms == []


@pytest.fixture(scope="module")
def vtk_python(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A separate Python with VTK and without shadowbench."""
    folder = tmp_path_factory.mktemp("vtk")
    venv.create(folder, with_pip=True)
    python = folder / ("Scripts" if sys.platform == "win32" else "bin") / "python"
    subprocess.run([python, "-m", "pip", "install", "--quiet", "-c", ROOT / "constraints.txt", "vtk"], check=True)
    return python


def test_vtk_goes_through_export_and_score(vtk_python: Path, shadowbench: Callable, tmp_path: Path) -> None:
    scene, least, umbra = "cube-on-plane", 0.93, r"0\.1[5-9]"
    assert shadowbench("export", scene, tmp_path, "--view-size", "256").code == 0
    subprocess.run([vtk_python, ROOT / "examples" / "vtk_shadows.py", tmp_path], check=True)
    pictures = ("--lit", tmp_path / "lit.png", "--shadowed", tmp_path / "shadowed.png")
    answer = shadowbench("score", scene, *pictures, "--json", "-o", tmp_path / "run", "--name", "vtk")
    found = json.loads(answer.out)
    (warning,) = found["warnings"]  # VTK leaves some of the light in its shadows: a fifth of it on a plane
    assert re.search(rf"its shadow is {umbra}, not 0; scored as it is; --ambient takes ambient light off$", warning)
    assert least < found["metrics"]["iou"] < 1
    (row,) = [json.loads(line) for line in (tmp_path / "run" / "rows.jsonl").read_text().splitlines()]
    assert row["metrics"] == found["metrics"] and row["renderer"] == "external: vtk"
    assert (tmp_path / "run" / "pictures" / f"{row['key']}.png").exists()
