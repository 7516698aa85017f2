"""`repro`: the folder of one row, which makes it again."""

import json
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from shadowbench.results.folder import read_runs
from shadowbench.studies.repro import bibtex

Shadowbench = Callable[..., Any]


@pytest.fixture
def source(shadowbench: Shadowbench, tmp_path: Path) -> Path:
    """A run of two phases of a map, in a scene of a file under a sun of the study."""
    folder = tmp_path / "source"
    folder.mkdir()
    (folder / "box.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n")
    study = 'scenes = ["box.obj"]\nview_size = 64\nrounds = 0\nphases = 2\nsun_at = [120, 40]\n'
    (folder / "study.toml").write_text(study + '[[technique]]\nspec = "shadow-map:size=64,filter=hard"\n')
    assert shadowbench("run", "-s", folder / "study.toml", "-o", folder / "out").code == 0
    return folder / "out"


def rows_of(folder: Path) -> list[dict[str, Any]]:
    return [json.loads(line) for line in (folder / "rows.jsonl").read_text().splitlines()]


def test_a_row_is_made_again_with_its_key_and_mask(source: Path, shadowbench: Shadowbench, tmp_path: Path) -> None:
    row = rows_of(source)[1]
    assert row["phase"] == 1
    folder = tmp_path / "again"
    answer = shadowbench("repro", row["key"][:10], "--of", source, "-o", folder)
    assert answer.code == 0 and "shadowbench check again --baseline ." in answer.out
    assert rows_of(folder) == [row]
    assert (folder / "mask.png").read_bytes() == (source / "masks" / f"{row['key']}.png").read_bytes()
    assert shadowbench("run", "-s", folder / "study.toml", "-o", folder / "again").code == 0
    again = next(one for one in rows_of(folder / "again") if one["key"] == row["key"])
    assert again["mask_sha256"] == row["mask_sha256"] and again["metrics"] == row["metrics"]
    compared = shadowbench("check", folder / "again", "--baseline", folder)
    assert compared.code == 0 and "1 cell compared with" in compared.out and "1 of them identical" in compared.out
    told = (folder / "README.md").read_text()
    assert row["key"] in told and row["renderer"] in told and "box.obj" in told
    assert f"Row {row['key']} of shadowbench" in (folder / "cite.bib").read_text()


def test_a_row_that_cannot_be_made_again_is_refused_in_one_line(
    source: Path, shadowbench: Shadowbench, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    empty = tmp_path / "empty"
    empty.mkdir()
    monkeypatch.chdir(empty)
    key = rows_of(source)[0]["key"]
    (source.parent / "box.obj").unlink()
    for answer, said in (
        (shadowbench("repro", key, "--of", source), "no file"),
        (shadowbench("repro", "", "--of", source), "2 rows begin so"),
        (shadowbench("repro", "fffffff", "--of", source), "no row has this key"),
        (shadowbench("repro", key, "--of", "nowhere"), "no such folder"),
    ):
        assert answer.code == 2 and said in answer.err and answer.err.count("\n") == 1
    assert os.listdir() == []


def test_a_citation_of_an_engine_names_its_version_and_the_renderer_it_drew_on(source: Path) -> None:
    run = read_runs([source])[0]
    row = dict(run.rows[0]) | {"technique": "three", "engine": {"version": "187", "renderer": "ANGLE_ES"}}
    assert "measured with three 187 on ANGLE\\_ES}" in bibtex(run, row)
    assert row["renderer"] not in bibtex(run, row)
