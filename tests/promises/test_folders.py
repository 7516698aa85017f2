"""Run folders that are not ours, cannot be written or hold another's rows: one line, and nothing in them changes."""

import csv
import json
import os
import shutil
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from tests.promises.conftest import Record, Study, study_text

SMALL = study_text("unshadowed", rounds=0, view_size=16)


@pytest.fixture
def valid(study: Study) -> str:
    """A line of rows.jsonl."""
    assert study.run(SMALL).code == 0
    return (study.folder / "rows.jsonl").read_text()


FOREIGN = {
    "a table": (1, "a,b\n1,2\n"),
    "no newline at all": (1, "no newline at all"),
    "another schema": (1, '{"schema": 2, "kind": "score"}\n'),
    "a row of nothing": (1, '{"schema": 1, "kind": "score"}\n'),
    "a list": (1, "[]\n"),
    "an empty line": (1, "\n"),
    "notes below a row": (2, "notes of mine"),
}


@pytest.mark.parametrize("what", FOREIGN)
def test_a_foreign_file_is_refused_and_left_alone(study: Study, valid: str, what: str) -> None:
    number, text = FOREIGN[what]
    file = study.folder / "rows.jsonl"
    file.write_text(valid * (number - 1) + text)
    before = file.read_bytes()
    answer = study.run(SMALL)
    assert answer.code == 2 and answer.err.startswith(f"shadowbench: {file} line {number}: ")
    assert answer.err.count("\n") == 1 and file.read_bytes() == before


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


def test_a_renamed_folder_goes_on(study: Study, tmp_path: Path) -> None:
    assert study.added(SMALL) == (1, 0)
    study.folder = study.folder.rename(tmp_path / "renamed")
    assert study.added(SMALL) == (0, 0)
    assert study.added(study_text("unshadowed", rounds=1, view_size=16)) == (0, 1)


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
COMMANDS = {
    "run": RUN,
    "stress": ("stress", "--quick", "--axis", "lamp-distance", "-t", "unshadowed"),
    "recommend": ("recommend", "cube-on-plane", "-t", "shadow-volume", "--min-iou", "0.5", "--view-size", "16"),
}


@pytest.mark.parametrize("name", COMMANDS)
def test_a_folder_is_locked_until_all_of_it_is_written(
    shadowbench: Any, tmp_path: Path, name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    locked, replace = {}, os.replace

    def watched(source: Path, target: Path) -> None:
        if Path(target).parent == tmp_path / "out":
            locked[Path(target).name] = (tmp_path / "out" / "writing.lock").exists()
        replace(source, target)

    monkeypatch.setattr(os, "replace", watched)
    assert shadowbench(*COMMANDS[name], "-o", tmp_path / "out").code in (0, 1)
    assert locked == dict.fromkeys(("run.json", "table.csv", *(["ranges.csv"] if name == "stress" else [])), True)


WAITING = """
import os, pathlib, time

link = os.link

def waiting(*arguments):
    pathlib.Path(os.environ["REACHED"]).touch()
    while not os.path.exists(os.environ["GATE"]):
        time.sleep(0.005)
    link(*arguments)

os.link = waiting
"""


def test_of_two_merges_into_one_folder_at_a_time_one_is_refused(start: Any, shadowbench: Any, tmp_path: Path) -> None:
    for name in ("one", "two"):
        assert shadowbench(*RUN[:-1], str(int(name == "two")), "-o", tmp_path / name).code == 0
    (tmp_path / "sitecustomize.py").write_text(WAITING)
    path, reached, gate = os.pathsep.join([str(tmp_path), *sys.path]), tmp_path / "reached", tmp_path / "gate"
    first = start("merge", tmp_path / "one", "-o", tmp_path / "all", PYTHONPATH=path, REACHED=reached, GATE=gate)
    first.until(reached.exists)
    answer = shadowbench("merge", tmp_path / "two", "-o", tmp_path / "all")
    line = f"shadowbench: {tmp_path / 'all'}: another merge writes into it; wait for it, or choose another with -o\n"
    assert (answer.code, answer.err) == (2, line)
    gate.touch()
    code, _, err = first.end()
    assert (code, err) == (0, "")
    assert (tmp_path / "all" / "rows.jsonl").read_bytes() == (tmp_path / "one" / "rows.jsonl").read_bytes()
    assert not [*tmp_path.glob(".all*")]
    assert "found other files" in shadowbench("merge", tmp_path / "two", "-o", tmp_path / "all").err


ESCAPE = "\x1b]0;mine\x07"


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("renderer", ESCAPE), ("scene", "a\nb"), ("status", f"failed: {ESCAPE}"), ("assumptions", ["\x9b1m"]),
        ("facts", {"\x7f": 1.0}), ("engine", {"version": ESCAPE}), ("commit", ESCAPE), ("mine", {"a": [ESCAPE]}),
    ],
)  # fmt: skip
def test_control_characters_of_another_s_rows_are_refused(
    study: Study, shadowbench: Any, valid: str, field: str, value: object
) -> None:
    (study.folder / "rows.jsonl").write_text(json.dumps(json.loads(valid) | {field: value}) + "\n")
    answer = shadowbench("report", study.folder, "-o", study.folder.parent / "report.html")
    assert answer.code == 2 and answer.err.startswith(f"shadowbench: {study.folder / 'rows.jsonl'} line 1: ")
    assert answer.err.count("\n") == 1 and answer.err[:-1].isprintable()


def test_a_command_line_of_several_lines_is_written_escaped_and_read(study: Study) -> None:
    study.folder = study.folder.with_name("o\nut")
    assert study.added(SMALL) == (1, 0)
    assert study.added(SMALL) == (0, 0)
    assert "o\\nut" in study.rows("score")[0]["command"]
    assert "o\\nut" in json.loads((study.folder / "run.json").read_text())["command"]


def test_tables_of_another_s_rows_have_no_formulas_and_reports_no_tags(
    study: Study, shadowbench: Any, valid: str
) -> None:
    formula, tags = '=HYPERLINK("http://a")', "<img src=x> [b](http://a) a|b"
    row = json.loads(valid) | {"renderer": formula, "assumptions": [tags], "command": "@a"}
    (study.folder / "rows.jsonl").write_text(json.dumps(row) + "\n")
    (study.folder / "run.json").unlink()
    made = {kind: study.folder.parent / f"report.{kind}" for kind in ("csv", "md")}
    for kind, file in made.items():
        assert shadowbench("report", study.folder, "-o", file, "--format", kind).code == 0
    with made["csv"].open(newline="") as stream:
        (line,) = csv.DictReader(stream)
    assert (line["renderer"], line["command"]) == (f"'{formula}", "'@a")
    assert r"\<img src=x> [b\](http://a) a\|b" in made["md"].read_text()


def test_a_folder_whose_name_is_not_utf_8_is_reported_and_compared(
    study: Study, shadowbench: Any, tmp_path: Path
) -> None:
    study.folder = Path(os.fsdecode(bytes(tmp_path / "caf") + b"\xe9"))
    assert study.added(SMALL) == (1, 0)
    for kind in ("html", "md", "csv", "tex"):
        answer = shadowbench("report", study.folder, "-o", tmp_path / f"report.{kind}", "--format", kind)
        assert (answer.code, answer.err) == (0, "")
    assert r"caf\udce9" in (tmp_path / "report.html").read_text()
    worse = study.folder.with_name(f"{study.folder.name}-worse")
    shutil.copytree(study.folder, worse)
    (row,) = study.rows("score")
    row["metrics"]["rmse"] += 0.5
    (worse / "rows.jsonl").write_text(json.dumps(row) + "\n")
    assert shadowbench("check", worse, "--baseline", study.folder).code == 1
    assert (worse / "check" / "summary.md").exists()


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
