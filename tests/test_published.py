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
from tests.reports.conftest import CELLS, run_file, write_folder

FOLDERS = sorted(folder for folder in publish.PUBLISHED.iterdir() if folder.is_dir())
MOST = 3_600_000  # bytes of all that is published
PLACE = re.compile(r"/tmp\b|/root\b|/home\b|/work\b|https?:")


def rows_of(folder: Path) -> list[dict[str, Any]]:
    rows = [json.loads(line) for line in (folder / "rows.jsonl").read_text(encoding="utf-8").splitlines()]
    return [row for row in rows if row["kind"] == "score"]


def test_a_page_has_the_range_of_undecided_pixels_in_hard_views() -> None:
    rows = [row for row in rows_of(publish.PUBLISHED / "techniques") if row["status"] == "ok"]
    shares = [row["undecided"] / row["receivers"] for row in rows if "penumbra" not in row]
    page = (publish.PUBLISHED.parents[1] / "docs" / "explanation" / "truth-and-scores.md").read_text(encoding="utf-8")
    assert f"They are few: {min(shares):.3%} to {max(shares):.3%} of the\nreceivers in the hard views" in page


def test_published_files_are_those_of_the_digests_few_bytes_and_name_no_folder_of_the_machine() -> None:
    assert (publish.PUBLISHED / "SHA256SUMS").read_text(encoding="utf-8") == "".join(publish.digests(publish.PUBLISHED))
    assert sum(file.stat().st_size for file in publish.PUBLISHED.rglob("*") if file.is_file()) <= MOST
    for folder in FOLDERS:
        for file in ("rows.jsonl", "run.json"):
            assert not PLACE.search((folder / file).read_text(encoding="utf-8"))
        rows = rows_of(folder)
        assert all(f"-o results/published/{folder.name}" in row["command"] and row["commit"] for row in rows)
        (run,) = read_runs([folder])
        assert len(run.rows) == len(rows) and run.about["keys"] == [row["key"] for row in rows]


@pytest.mark.parametrize("study", sorted(publish.STUDIES.glob("*.toml")), ids=lambda study: study.stem)
def test_all_cells_of_a_study_are_published(study: Path) -> None:
    (run,) = read_runs([publish.PUBLISHED / study.stem])
    published = {(row["scene"], row["full_spec"], row["phase"]) for row in run.rows}
    cells = [(block, cell) for block in read_study(study, techniques()).blocks() for cell in block.cells]
    assert published == {(block.view.scene.name, cell.spec.full_text, cell.phase) for block, cell in cells}


def test_what_is_condensed_says_what_was_measured_and_is_the_same_when_condensed_again(tmp_path: Path) -> None:
    about = run_file(True, "A") | {"machine": {"processor": "A", "system": "Linux 6.1.0-host x86_64"}}
    records = [record | {"command": f"run -o {tmp_path}/a"} for cell in CELLS for record in cell.records()]
    again = [record | {"key": "f" * 24, "command": f"run -o {tmp_path}/ab"} for record in CELLS[1].records()]
    folder = write_folder(tmp_path / "a", records, about, True)
    target = tmp_path / "published"
    publish.condense([folder, write_folder(tmp_path / "ab", again, {}, False)], target, "abc")
    kept = rows_of(target)
    assert len(kept) == len(CELLS) and kept[1]["key"] == "f" * 24, "of a cell in several folders the last"
    assert {row["command"] for row in kept} == {f"run -o {target}"} and {row["commit"] for row in kept} == {"abc"}
    (run,), (was,) = read_runs([target]), read_runs([folder])
    assert run.about["machine"]["system"] == "Linux x86_64"
    assert run.frame["iou"].equals(was.frame["iou"]) and run.frame["frame_ms"].equals(was.frame["frame_ms"])
    masks = {file.stem for file in (target / "masks").iterdir()}
    assert masks == {one.key for one in CELLS if one.status == "ok" and one.map_size in (None, 1024)}
    for key in masks:
        levels = (read_mask(place / "masks" / f"{key}.png") for place in (target, folder))
        assert np.abs(np.subtract(*levels)).max() <= 1 / 8
    before = list(publish.digests(target))
    publish.condense([target], target, "another")
    assert list(publish.digests(target)) == before
