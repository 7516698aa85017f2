"""`merge`: folders of machines and parts become one, unless their scores differ."""

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from shadowbench.errors import InputError
from shadowbench.measure.campaign import Block, LogReporter
from shadowbench.scenes.library import load_scene
from shadowbench.scenes.model import view_of
from shadowbench.scores.masks import write_mask
from shadowbench.studies.run import dealt, names_of
from tests.reports.conftest import POINTS
from tests.results.cells import GOOD, SIDE, WORSE, cell, read, rows, timed

Merge = Callable[..., Any]
LIT = np.ones((SIDE, SIDE), np.float32)


@pytest.fixture
def merge(shadowbench: Callable[..., Any], tmp_path: Path) -> Merge:
    """`merge` of folders into `all`."""
    return lambda *words: shadowbench("merge", *words, "-o", tmp_path / "all")


def described(folder: Path, *records: dict[str, Any], machine: str = "m", **study: Any) -> Path:
    """A folder with a `run.json`."""
    about = {"schema": 1, "machine_key": machine, "assumptions": [f"of {folder.name}"], "study": study}
    about["keys"] = [record["key"] for record in records if record["kind"] == "score"]
    rows(folder, *records)
    (folder / "run.json").write_text(json.dumps(about))
    return folder


def write(folder: Path, name: str, level: float) -> Path:
    """Write an image of one level."""
    file = folder / f"{name}.png"
    file.parent.mkdir(exist_ok=True)
    write_mask(file, level * LIT)
    return file


def test_cells_times_images_and_facts_of_all_folders_are_in_the_result(merge: Merge, tmp_path: Path) -> None:
    mine, yours = cell("shadow-map"), cell("cube-map")
    one = described(tmp_path / "one", mine, timed(mine), scenes=["s"], specs=["shadow-map"], rounds=9, view_size=16)
    two = described(tmp_path / "two", mine, yours, scenes=["s"], specs=["cube-map"], rounds=0, view_size=16)
    for folder, record in ((one, mine), (two, yours)):
        for name in (f"masks/{record['key']}", "truth/s.camera.sun.16"):
            write(folder, name, 1.0)
    answer, merged = merge(one, two), tmp_path / "all"
    assert (answer.code, answer.err) == (0, "")
    assert answer.out.endswith("all: 2 cells, 1 time\n")
    assert read(merged) == [mine, yours] and read(merged, "time") == [timed(mine)]
    about = json.loads((merged / "run.json").read_text())
    assert about["keys"] == [mine["key"], yours["key"]] and about["assumptions"] == ["of one", "of two"]
    assert about["study"] == {"scenes": ["s"], "specs": ["shadow-map", "cube-map"], "view_size": 16}
    found = {str(file.relative_to(merged)) for file in merged.glob("*/*.png")}
    assert found == {f"masks/{mine['key']}.png", f"masks/{yours['key']}.png", "truth/s.camera.sun.16.png"}
    assert len((merged / "table.csv").read_text().splitlines()) == 3
    assert sorted(file.name for file in tmp_path.iterdir()) == ["all", "one", "two"]


@pytest.mark.parametrize(
    ("changed", "what"),
    [
        ({"metrics": WORSE}, ["iou", "ssim"]),
        ({"mask_sha256": "f" * 64}, ["mask"]),
        ({"metrics": GOOD | {"iou": GOOD["iou"] * (1 + 1e-6)}}, ["iou"]),
        ({"status": "unsupported: too large"}, ["status"]),
    ],
)
def test_equal_keys_with_unequal_scores_are_listed_and_nothing_is_written(
    merge: Merge, tmp_path: Path, changed: dict[str, Any], what: list[str]
) -> None:
    same, other = cell("cube-map"), cell("shadow-map")
    folders = rows(tmp_path / "one", same, other), rows(tmp_path / "two", same, other | changed)
    answer = merge(*folders, "--json", "-q")
    told = "shadowbench: nothing was written: 1 cell with unequal scores\n"
    assert (answer.code, answer.err) == (1, told)
    differing = json.loads(answer.out)["differing"]
    assert [one["what"] for one in differing] == what
    assert {one["cell"] for one in differing} == {"s camera sun shadow-map 512 0"}
    assert sorted(file.name for file in tmp_path.iterdir()) == ["one", "two"]
    assert "unequal scores" in merge(*folders).out


def test_scores_that_differ_by_rounding_are_equal(merge: Merge, tmp_path: Path) -> None:
    exact, rounded = GOOD | {"bias": 0.0}, GOOD | {"iou": GOOD["iou"] * (1 + 1e-14), "bias": 1e-17}
    assert merge(rows(tmp_path / "one", cell(metrics=exact)), rows(tmp_path / "two", cell(metrics=rounded))).code == 0
    assert read(tmp_path / "all") == [cell(metrics=exact)]


def test_scores_of_engines_are_merged_with_those_of_one_renderer(merge: Merge, tmp_path: Path) -> None:
    engine = cell("my-engine", size=None, renderer="my-engine", content="c")
    folders = [rows(tmp_path / "engine", engine), rows(tmp_path / "run", cell())]
    assert merge(*folders, rows(tmp_path / "gpu", cell(renderer="a GPU"))).code == 2
    assert merge(*folders).code == 0


def test_of_two_truths_the_later_folder_s_is_shown(merge: Merge, tmp_path: Path) -> None:
    """As its rows are the later ones of the table."""
    folders = [described(tmp_path / name, cell(name)) for name in ("one", "two")]
    _, later = (
        write(folder, "truth/s.camera.sun.16", level) for folder, level in zip(folders, (0.0, 1.0), strict=True)
    )
    assert merge(*folders).code == 0
    assert (tmp_path / "all" / "truth" / later.name).read_bytes() == later.read_bytes()


@pytest.mark.parametrize("order", [1, -1])
def test_a_failed_row_gives_way_to_one_that_succeeded(merge: Merge, tmp_path: Path, order: int) -> None:
    failed = cell(status="failed: the worker died")
    parts = [rows(tmp_path / "failed", failed), rows(tmp_path / "ok", failed, cell())]
    assert merge(*parts[::order]).code == 0
    assert [row["status"] for row in read(tmp_path / "all")] == ["ok"]


def test_times_are_kept_by_machine_and_the_table_has_those_of_one(merge: Merge, tmp_path: Path) -> None:
    one, two = cell(size=256), cell(size=512)
    slow = [timed(record, machine="slow", frame_ms=9.0) for record in (one, two)]
    parts = [
        described(tmp_path / "quick", one, timed(one)),
        described(tmp_path / "slow", one, two, *slow, machine="slow"),
    ]
    assert "3 times" in merge(*parts, tmp_path / "slow").out
    assert read(tmp_path / "all", "time") == [timed(one), *slow]
    assert (tmp_path / "all" / "table.csv").read_text().count(",slow,") == 2


@pytest.mark.parametrize(
    ("made", "words"),
    [
        ({"gone": None}, ["gone", "no such folder"]),
        ({"empty": []}, ["empty", "found no cell"]),
        ({"sweep": [POINTS[0].record()]}, ["sweep", "found cells of `stress`; allowed: of `run`, as in "]),
        ({"both": [cell(), POINTS[0].record()]}, ["both", "found cells of `stress`; allowed: of `run`, as in "]),
        ({"other": [cell(renderer="a GPU")]}, ["other", "found cells of a GPU; allowed: of llvmpipe, as in "]),
    ],
)
def test_folders_that_do_not_belong_together_are_one_line(
    merge: Merge, tmp_path: Path, made: dict[str, Any], words: list[str]
) -> None:
    ((name, records),) = made.items()
    if records is not None:
        rows(tmp_path / name, *records)
    answer = merge(rows(tmp_path / "one", cell()), tmp_path / name)
    assert answer.code == 2 and answer.err.count("\n") == 1
    assert [word for word in words if word not in answer.err] == []
    assert not (tmp_path / "all").exists()


def test_an_output_with_other_files_is_one_line_and_an_empty_one_is_taken(merge: Merge, tmp_path: Path) -> None:
    (tmp_path / "all").mkdir()
    part = rows(tmp_path / "part", cell())
    assert merge(part).code == 0 and len(read(tmp_path / "all")) == 1
    answer = merge(part)
    assert (answer.code, "is not empty" in answer.err) == (2, True) and answer.err.count("\n") == 1


def test_parts_share_all_blocks_and_deal_those_of_two_lights_alike_in_any_order() -> None:
    scene, reporter = load_scene("stairs"), LogReporter()
    lights = [replace(scene.lights[0], name=f"sun-{number}") for number in range(12)]
    blocks = [Block((view_of(scene, scene.cameras[0], light, 16),), ()) for light in lights]
    parts = [dealt(blocks, f"{number}/5", names_of, reporter) for number in range(1, 6)]
    assert {block for part in parts for block in part} == set(blocks)
    assert sorted(map(len, parts)) == [2, 2, 2, 3, 3]
    assert set(dealt(blocks[::-1], "1/5", names_of, reporter)) == set(parts[0])
    for text in ("0/0", "4/3", "1/0", "-1/2", "1.5/2", "one", "1", ""):
        with pytest.raises(InputError, match=r"^--part: found '.*'; allowed: K/N, as in 3/16, "):
            dealt(blocks, text, names_of, reporter)
