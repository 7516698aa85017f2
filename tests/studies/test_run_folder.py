"""A folder of several commands: the newest row of every cell, and the keys of the last command."""

import csv
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

from tests.runs import CHANGING

Shadowbench = Callable[..., Any]

SMALL = ("--view-size", "32", "--rounds", "0")


def table(folder: Path) -> list[dict[str, str]]:
    with (folder / "table.csv").open(newline="", encoding="utf-8") as stream:
        return list(csv.DictReader(stream))


def keys(folder: Path) -> list[str]:
    found: list[str] = json.loads((folder / "run.json").read_text())["keys"]
    return found


def test_a_second_command_leaves_the_cells_of_the_first_in_table_and_report(
    shadowbench: Shadowbench, tmp_path: Path
) -> None:
    out, baseline = tmp_path / "out", tmp_path / "baseline"
    study = tmp_path / "swept.toml"
    study.write_text(
        'scenes = ["cube-on-plane"]\nmap_size = [32]\nview_size = 32\nrounds = 0\n'
        '[[technique]]\nspec = "shadow-map"\nbias_sweep = [0.5, 1]\n'
    )
    assert shadowbench("run", "-s", study, "-o", out).err == ""
    first = {row["key"]: row for row in table(out)}
    assert shadowbench("check", out, "--baseline", baseline, "--update").code == 0

    answer = shadowbench("run", "cube-on-plane", "-t", "unshadowed", *SMALL, "-o", out)
    assert "shadow-map" not in answer.out and f"{out / 'table.csv'}: 3 cells" in answer.out
    assert {row["key"]: row for row in table(out)}.items() >= first.items(), (
        "with the command, and the factor of its bias"
    )
    (new,) = [row for row in table(out) if row["key"] not in first]
    assert new["spec"] == "unshadowed" and keys(out) == [new["key"]]
    assert {row["command"] for row in first.values()} == {f"shadowbench run -s {study} -o {out}"}
    assert new["command"] == f"shadowbench run cube-on-plane -t unshadowed {' '.join(SMALL)} -o {out}"

    report = tmp_path / "report.csv"
    assert shadowbench("report", out, "--format", "csv", "-o", report).code == 0
    with report.open(newline="", encoding="utf-8") as stream:
        shown = {row["key"]: row["command"] for row in csv.DictReader(stream)}
    assert shown == {row["key"]: row["command"] for row in table(out)}
    answer = shadowbench("check", out, "--baseline", baseline)
    assert answer.code == 2 and "no cell in common" in answer.err, "the last command's cells are compared"

    answer = shadowbench("run", "-s", study, "-o", out)
    assert sorted(keys(out)) == sorted(first) and len(table(out)) == 3
    assert {row["key"]: row for row in table(out)}.items() >= first.items(), "measured before: the command that made it"
    assert shadowbench("check", out, "--baseline", baseline).code == 0


def test_a_scene_that_was_changed_back_has_its_row_again(shadowbench: Shadowbench, tmp_path: Path) -> None:
    scene, out = tmp_path / "moving.toml", tmp_path / "out"

    def run(text: str) -> str:
        """The key of the one line after a run."""
        scene.write_text(text)
        assert shadowbench("run", scene, "-t", "unshadowed", *SMALL, "-o", out, "-q").code == 0
        (line,) = table(out)
        return line["key"]

    first, other = run(CHANGING), run(CHANGING.replace("[0.0, 0.5, 0.0]", "[1.0, 1.5, 0.0]"))
    assert other != first == run(CHANGING), "that of the last command, though another is the last in the file"


def test_hard_shadows_of_a_view_do_not_stand_beside_its_soft_ones(shadowbench: Shadowbench, tmp_path: Path) -> None:
    """`--sun` changes the truth of a view, but not its name: an exact hard shadow would seem to have no error."""
    out, view = tmp_path / "out", ("cube-on-plane", "--view-size", "64", "--rounds", "0", "-o", tmp_path / "out")
    assert shadowbench("run", *view, "-t", "ray-traced", "-t", "cube-map").code == 0
    assert [row["status"].split(":")[0] for row in table(out)] == ["ok", "unsupported"]
    hard = next(row for row in table(out) if row["spec"] == "ray-traced")

    assert shadowbench("run", *view, "-t", "unshadowed", "--sun").code == 0
    assert [row["spec"] for row in table(out) if row["status"] == "ok"] == ["unshadowed"]
    assert all(row["truth_error"] for row in table(out) if row["status"] == "ok")

    assert shadowbench("run", *view, "-t", "ray-traced").code == 0
    assert [row["key"] for row in table(out) if row["status"] == "ok"] == [hard["key"]], "measured before"


def test_another_file_of_the_same_name_does_not_replace_the_first_without_a_word(
    shadowbench: Shadowbench, tmp_path: Path
) -> None:
    out = tmp_path / "out"
    options = ["-t", "unshadowed", *SMALL, "--no-ground", "-o", out]
    files = [tmp_path / folder / "ball.obj" for folder in ("one", "two")]
    for file, height in zip(files, (1, 2), strict=True):
        file.parent.mkdir()
        file.write_text(f"v 0 0 0\nv 1 0 0\nv 0 {height} 0\nv 0 0 1\nf 1 2 3\nf 1 2 4\n")
    assert "leave out" not in shadowbench("run", files[0], *options).err
    for _ in range(2):  # also where nothing is measured anew
        told = shadowbench("run", files[1], *options).err
        assert f"{out}: table.csv and reports leave out 1 row of earlier commands" in told
    (row,) = table(out)
    assert row["command"].split()[2] == str(files[1])
