"""A technique's cells of the committed baseline's study score as they do there; run by test_faults.py alone."""

import json

import pytest

from shadowbench.plugin.registry import techniques
from shadowbench.scenes.library import load_scene
from shadowbench.studies.study import read_study

from .test_faults import CELLS, ROOT

BASELINE = ROOT / "results" / "baseline"


@pytest.mark.parametrize("cells", CELLS)
def test_the_cells_score_as_in_the_baseline(cells, shadowbench, tmp_path) -> None:
    name, _, scenes = cells.partition(" on ")
    study = read_study(BASELINE / "study.toml", techniques())
    files = [file for file in study.scenes if load_scene(file).name in scenes.split(", ")]
    specs = dict.fromkeys(cell.spec.full_text for cell in study.cells() if cell.spec.technique.name == name)
    lines = (BASELINE / "rows.jsonl").read_text(encoding="utf-8").splitlines(keepends=True)
    rows = {line: json.loads(line) for line in lines}
    mine = [line for line, row in rows.items() if row["technique"] == name and row["scene"] in scenes.split(", ")]
    (tmp_path / "rows.jsonl").write_text("".join(mine), encoding="utf-8")
    options = [word for spec in specs for word in ("-t", spec)]
    run = shadowbench("run", *files, *options, "-s", BASELINE / "study.toml", "-o", tmp_path / "now")
    if run.code:
        raise RuntimeError(f"it does not even run, which anything would catch: {run.err}")
    found = json.loads(shadowbench("check", tmp_path / "now", "--baseline", tmp_path, "--json").out)
    assert found["compared"] == len(mine) > 0 and not found["regressed"], f"worst: {found['regressed'][:1]}"
