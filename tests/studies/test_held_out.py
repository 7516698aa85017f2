"""Held-out scenes: nothing else uses them, and the table says how much a setting loses there."""

import json
import re
from pathlib import Path
from typing import Any

import held_out
import pytest

from shadowbench.plugin.registry import techniques
from shadowbench.scenes.library import builtin_names, hard_names, load_scene
from shadowbench.studies.study import read_study, study_names

STUDY = held_out.STUDY
ROOT = STUDY.parents[1]
SCENES = sorted((STUDY.parent / "held-out").glob("*.toml"))
OWN = {STUDY, *SCENES, Path(held_out.__file__)}
OTHERS = [
    file
    for folder in ("benchmarks", "docs", "examples", "results", "scenes", "shadowbench", "tools")
    for file in sorted((ROOT / folder).rglob("*"))
    if file.suffix in (".toml", ".py") and file not in OWN
]
NAMED = re.compile(r"held-out[-/]\d")  # a scene, or its file


def test_no_other_study_or_tool_uses_their_scenes() -> None:
    assert not [file for file in OTHERS if NAMED.search(file.read_text(encoding="utf-8"))]
    assert {"benchmarks", "published", "baseline"} <= {file.parent.name for file in OTHERS}
    assert not any(map(NAMED.match, builtin_names()))
    assert NAMED.search(STUDY.read_text(encoding="utf-8"))


def test_no_baseline_and_no_published_row_has_them() -> None:
    for file in (ROOT / "results").rglob("rows.jsonl"):
        scores = [
            row for row in map(json.loads, file.read_text(encoding="utf-8").splitlines()) if row["kind"] == "score"
        ]
        assert scores, file
        assert not [row for row in scores if NAMED.match(row["scene"])], file


def test_the_study_has_all_scenes_with_hard_shadows() -> None:
    study = read_study(STUDY, techniques())
    assert "held-out" in study_names()
    assert {name for name in study.scenes if isinstance(name, str) and "held-out" not in name} == set(hard_names())
    assert [name for name in study.scenes if "held-out" in str(name)] == [str(file) for file in SCENES]
    scenes = [load_scene(file) for file in SCENES]
    assert [scene.lights[0].kind for scene in scenes] == list(held_out.LIGHTS)
    assert all(NAMED.match(scene.name) and not scene.lights[0].soft for scene in scenes)


@pytest.mark.slow
def test_the_scenes_are_those_of_seed_1_and_another_seed_has_others(tmp_path: Path) -> None:
    for seed in (1, 2):
        held_out.write_scenes(tmp_path / str(seed), seed)
    assert (tmp_path / "2" / STUDY.name).read_bytes() == STUDY.read_bytes()
    for file in SCENES:
        first, second = ((tmp_path / str(seed) / "held-out" / file.name).read_text() for seed in (1, 2))
        assert first == file.read_text(encoding="utf-8") != second


def rows_of(spec: str, chosen: float, held_out: float) -> list[dict[str, Any]]:
    """Rows in three scenes of each kind, whose errors, √((1 − IoU) · (1 − SSIM)), are 1, 2 and 3 times those given."""
    values = {f"scene {i}": 1 - i * chosen for i in (1, 2, 3)}
    values |= {f"held-out-1-{i}": 1 - i * held_out for i in (1, 2, 3)}
    return [{"spec": spec, "status": "ok", "scene": at, "metrics": {"iou": x, "ssim": x}} for at, x in values.items()]


def test_a_setting_that_is_good_only_where_it_was_chosen_has_a_ratio_above_1() -> None:
    reference = rows_of("shadow-map", 0.01, 0.02)  # held-out scenes are twice as hard
    tuned = rows_of("tuned", 0.005, 0.02)  # half the error, but not in held-out scenes
    lines = held_out.table([*reference, *tuned])
    cells = [[cell.strip() for cell in line.strip("|").split("|")] for line in lines]
    mean = 6 ** (1 / 3)  # of the scenes' difficulties
    assert cells[2] == ["`shadow-map`", f"{0.01 * mean:.4f}", f"{0.02 * mean:.4f}", "1.00", "1.00", ""]
    assert cells[3][3:] == ["0.50", "1.00", "2 [2, 2]"]
