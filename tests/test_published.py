"""What is published: complete, as its digests say, of studies that go on, and condensed from run folders."""

import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import publish
import pytest

from shadowbench.plugin.registry import techniques
from shadowbench.results.frame import read_runs
from shadowbench.scores.masks import read_mask
from shadowbench.studies.study import read_study
from tests.engine_rows import ROWS, row
from tests.reports.conftest import CELLS, run_file, write_folder

FOLDERS = sorted(folder for folder in publish.PUBLISHED.iterdir() if folder.is_dir())
MOST = 3_600_000  # bytes of all that is published
PLACE = re.compile(r"/tmp\b|/root\b|/home\b|/work\b|https?:")


def rows_of(folder: Path) -> list[dict[str, Any]]:
    return [json.loads(line) for line in (folder / "rows.jsonl").read_text(encoding="utf-8").splitlines()]


def test_a_page_has_the_range_of_undecided_pixels_in_hard_views() -> None:
    rows = [
        one for one in rows_of(publish.PUBLISHED / "techniques") if one["kind"] == "score" and one["status"] == "ok"
    ]
    shares = [one["undecided"] / one["receivers"] for one in rows if "penumbra" not in one]
    page = (publish.PUBLISHED.parents[1] / "docs" / "explanation" / "truth-and-scores.md").read_text(encoding="utf-8")
    assert f"They are few: {min(shares):.3%} to {max(shares):.3%} of the\nreceivers in the hard views" in page


def test_files_are_those_of_the_digests_and_few_bytes() -> None:
    assert (publish.PUBLISHED / "SHA256SUMS").read_text(encoding="utf-8") == "".join(publish.digests(publish.PUBLISHED))
    assert sum(file.stat().st_size for file in publish.PUBLISHED.rglob("*") if file.is_file()) <= MOST


@pytest.mark.parametrize("folder", FOLDERS, ids=lambda folder: folder.name)
def test_every_row_names_command_and_commit_and_no_folder_of_the_machine(folder: Path) -> None:
    for file in ("rows.jsonl", "run.json"):
        assert not PLACE.search((folder / file).read_text(encoding="utf-8"))
    scores = [one for one in rows_of(folder) if one["kind"] == "score"]
    assert all(f"-o results/published/{folder.name}" in one["command"] and one["commit"] for one in scores)
    (run,) = read_runs([folder])
    assert len(run.rows) == len(scores) and run.about["keys"] == [one["key"] for one in scores]


@pytest.mark.parametrize("study", sorted(publish.STUDIES.glob("*.toml")), ids=lambda study: study.stem)
def test_all_cells_of_a_study_are_published(study: Path) -> None:
    (run,) = read_runs([publish.PUBLISHED / study.stem])
    published = {(one["scene"], one["full_spec"], one["phase"]) for one in run.rows}
    cells = [(block, cell) for block in read_study(study, techniques()).blocks() for cell in block.cells]
    wanted = {(block.view.scene.name, cell.spec.full_text, cell.phase) for block, cell in cells}
    assert published == wanted


def condensed(tmp_path: Path, *folders: Path) -> Path:
    target = tmp_path / "published"
    publish.condense(folders, target, "abc")
    return target


def test_of_a_cell_in_several_folders_the_last_row_is_kept(tmp_path: Path) -> None:
    about = run_file(True, "A") | {"machine": {"processor": "A", "system": "Linux 6.1.0-host x86_64"}}
    first = [one | {"command": f"measure -o {tmp_path}/a"} for one in ROWS]
    again = [row("three", "street", 0.05, "2") | {"command": f"measure -o {tmp_path}/ab"}]
    folders = [write_folder(tmp_path / "a", first, about, True), write_folder(tmp_path / "ab", again, {}, True)]
    target = condensed(tmp_path, *folders)
    kept = {(one["spec"], one["scene"]): one for one in rows_of(target)}
    assert len(kept) == len(ROWS) and kept["three", "street"]["engine"]["version"] == "2"
    assert {one["command"] for one in kept.values()} == {f"measure -o {target}"} and {*kept[min(kept)]} >= {"commit"}
    assert json.loads((target / "run.json").read_text())["machine"]["system"] == "Linux x86_64"
    assert len(list((target / "masks").iterdir())) < len(ROWS)


def test_condensed_again_it_is_the_same_and_what_it_says_is_what_was_measured(
    tmp_path: Path,
) -> None:
    records = [record | {"command": "run"} for cell in CELLS for record in cell.records()]
    folder = write_folder(tmp_path / "run", records, run_file(True, "A"), True)
    target = condensed(tmp_path, folder)
    before = {line: (target / line.split("  ")[1].strip()).read_bytes() for line in publish.digests(target)}
    (run,), (was,) = read_runs([target]), read_runs([folder])
    assert run.frame["iou"].equals(was.frame["iou"]) and run.frame["frame_ms"].equals(was.frame["frame_ms"])
    masks = {file.stem for file in (target / "masks").iterdir()}
    assert masks == {one.key for one in CELLS if one.status == "ok" and one.map_size in (None, 1024)}
    assert all(
        np.abs(read_mask(target / "masks" / f"{key}.png") - read_mask(folder / "masks" / f"{key}.png")).max() <= 1 / 8
        for key in masks
    )
    publish.condense([target], target, "another")
    assert list(publish.digests(target)) == list(before)
