"""Run folders that are not ours, cannot be written or hold another's rows: one line, and nothing in them changes."""

import json
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from tests.promises.conftest import Record, Study, study_text

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


RUN = ("run", "cube-on-plane", "-t", "unshadowed", "--view-size", "16", "--rounds", "0")


class Killed(BaseException):
    """Ends a command as a kill does: nothing is written any more, whatever it tries."""


class Killer:
    """Kills at the first write to a folder after some others, counted by what Python tells of its calls."""

    folder, left = "", 0

    def __call__(self, event: str, arguments: tuple[object, ...]) -> None:
        if not self.folder:
            return
        writes = event in ("os.rename", "os.remove", "os.mkdir", "os.rmdir", "shutil.copyfile", "shutil.rmtree")
        writes |= event == "open" and set(str(arguments[1])) & set("wax+") != set()
        if writes and any(self.folder in str(argument) for argument in arguments):
            self.left -= 1
            if self.left < 0:
                raise Killed


def test_a_killed_update_leaves_the_baseline_as_it_was_or_is_to_be_with_all_its_masks(
    shadowbench: Any, records: Callable[..., list[Record]], tmp_path: Path
) -> None:
    runs, kept = (tmp_path / "old", tmp_path / "new"), tmp_path / "baseline"
    for run, specs in zip(runs, (("unshadowed",), ("unshadowed", "shadow-map:size=16")), strict=True):
        flags = [word for spec in specs for word in ("-t", spec)]
        light = ["--sun-at", "30,60"] if run.name == "new" else []
        assert shadowbench(*RUN[:2], *flags, *light, *RUN[4:], "-o", run).code == 0
    update = ("check", "--baseline", kept, "--update", "--masks")
    whole = {}
    for run in runs:
        assert shadowbench(*update, run).code == 0
        whole[run.name] = (kept / "rows.jsonl").read_bytes()
    killer, writes, found = Killer(), 0, set()
    sys.addaudithook(killer)  # for the rest of this process, but idle without a folder
    while True:
        assert shadowbench(*update, runs[0]).code == 0
        killer.folder, killer.left = str(kept), writes
        try:
            assert shadowbench(*update, runs[1]).code == 0
            break
        except Killed:
            writes += 1
        finally:
            killer.folder = ""
        (now,) = [name for name, text in whole.items() if text == (kept / "rows.jsonl").read_bytes()]
        found.add(now)
        for row in records(kept, "score"):
            mask = f"masks/{row['key']}.png"
            assert (kept / mask).read_bytes() == (tmp_path / now / mask).read_bytes()
    assert found == {"old", "new"} and writes > 4
    assert sorted(file.name for file in (kept / "masks").iterdir()) == sorted(
        f"{row['key']}.png" for row in records(runs[1], "score")
    )
