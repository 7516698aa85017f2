"""Run folders that are not ours, cannot be written or hold another's rows: one line, and nothing in them changes."""

import json
from pathlib import Path
from typing import Any

import pytest

from tests.promises.conftest import Study, study_text

SMALL = study_text("unshadowed", rounds=0, view_size=16)


@pytest.mark.parametrize("other", ["run", "stress"])
def test_a_folder_of_the_other_command_is_refused_before_anything_is_measured(
    study: Study, shadowbench: Any, other: str
) -> None:
    sweep = ("stress", "--quick", "--axis", "lamp-distance", "-t", "unshadowed", "-o", study.folder, "-q")
    commands = {"run": lambda: study.run(SMALL), "stress": lambda: shadowbench(*sweep)}
    assert commands.pop(other)().code == 0
    before = {file: file.read_bytes() for file in study.folder.rglob("*") if file.is_file()}
    ((name, refused),) = commands.items()
    answer = refused()
    assert answer.code == 2 and answer.err.count("\n") == 1
    assert f"found cells of `{other}`; allowed: a folder of `{name}`, or a new one" in answer.err
    assert {file: file.read_bytes() for file in study.folder.rglob("*") if file.is_file()} == before


def test_a_folder_that_cannot_be_written_is_one_line(shadowbench: Any, tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    (tmp_path / "run" / "rows.jsonl").mkdir(parents=True)
    for folder in (tmp_path / "file", tmp_path / "file" / "below", tmp_path / "run"):
        answer = shadowbench("run", "cube-on-plane", "-t", "unshadowed", "--view-size", "16", "-o", folder)
        assert answer.code == 2 and answer.err.count("\n") == 1 and str(folder) in answer.err
        assert "cannot be written" in answer.err or "is not a file" in answer.err


def test_an_image_that_cannot_be_written_ends_the_run_without_a_row_that_promises_it(study: Study) -> None:
    assert study.added(SMALL) == (1, 0)
    (mask,) = (study.folder / "masks").iterdir()
    mask.unlink()
    mask.mkdir()
    (study.folder / "rows.jsonl").write_text("")
    answer = study.run(SMALL)
    assert (answer.code, answer.err.count("\n")) == (2, 1) and f"{mask}: is a folder" in answer.err
    assert study.rows("score") == []
    mask.rmdir()
    assert study.added(SMALL) == (1, 0)


def test_run_json_is_written_anew_and_says_whose_rows_there_are(study: Study) -> None:
    assert study.run(SMALL).code == 0
    (study.folder / "run.json").write_text("[" * 200_000)
    assert study.added(SMALL) == (0, 0)
    about = json.loads((study.folder / "run.json").read_text())
    (row,) = study.rows("score")
    assert about["schema"] == 1 and about["keys"] == [row["key"]]
    assert about["command"].startswith("shadowbench run -s ")
    assert about["clock"] == about["device"]["clock"]
    assert {"shadowbench", "python", "moderngl", "numpy", "embreex"} <= set(about["versions"])
    assert {"processor", "cores", "memory_gib", "system"} == set(about["machine"])
    assert (about["study"]["specs"], about["study"]["view_size"], about["study"]["rounds"]) == (["unshadowed"], 16, 0)
    assert about["device"]["renderer"] == row["renderer"]
    assert (", arithmetic " in row["renderer"]) == about["device"]["software"]
