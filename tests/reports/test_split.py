"""`report --split`: a page whose data are scripts beside it."""

import json
import re
import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from shadowbench.commands import report as command
from tests.reports.conftest import CELLS, scripts

Shadowbench = Callable[..., Any]
Write = Callable[..., Path]
TWO = [replace(cell, scene=scene) for scene in ("stairs", "terrace") for cell in CELLS]


def delivered(folder: Path) -> dict[str, Any]:
    """The values of data files, by the names that they deliver."""
    found = [re.fullmatch(r"deliver\((\".*?\"), (.*)\);\n", file.read_text(), re.DOTALL) for file in folder.iterdir()]
    return {json.loads(one[1]): json.loads(one[2]) for one in found if one}


def test_a_split_page_has_the_same_data_in_files_beside_it(
    shadowbench: Shadowbench, run_folder: Write, tmp_path: Path
) -> None:
    run, page = run_folder(TWO, pictures=True), tmp_path / "split.html"
    assert shadowbench("report", run, "-o", tmp_path / "whole.html", "-q").code == 0
    assert shadowbench("report", run, "-o", page, "--split", "-q").code == 0
    files = delivered(tmp_path / "split.files")
    assert {Path(name).parent.name for name in files} == {"split.files"}
    text = page.read_text()
    assert scripts(text) == [] and "data:image" not in text
    names = json.loads(re.search(r"const PAGE = (.*?);</script>", text, re.DOTALL)[1])["data"]  # type: ignore[index]
    panels = [files[name] for name in names.values()]

    def inlined(value: Any) -> Any:
        if isinstance(value, dict):
            return {name: inlined(part) for name, part in value.items()}
        if isinstance(value, list):
            return list(map(inlined, value))
        return files[value] if isinstance(value, str) and value in files else value

    assert list(map(inlined, panels)) == scripts((tmp_path / "whole.html").read_text())


def test_a_page_is_split_anew_and_other_files_are_kept(
    shadowbench: Shadowbench, run_folder: Write, tmp_path: Path
) -> None:
    run, page, files = run_folder(pictures=True), tmp_path / "report.html", tmp_path / "report.files"
    assert shadowbench("report", run, "-o", page, "--split").code == 0
    first = delivered(files)
    shutil.rmtree(run / "masks")
    assert shadowbench("report", run, "-o", page, "--split").code == 0
    assert delivered(files) != first
    (files / "mine.txt").write_text("mine")
    answer = shadowbench("report", run, "-o", page, "--split")
    assert answer.code == 2 and "report.files: found other files" in answer.err and answer.err.count("\n") == 1
    assert (files / "mine.txt").exists()


def test_only_pages_are_split(shadowbench: Shadowbench, run_folder: Write, tmp_path: Path) -> None:
    answer = shadowbench("report", run_folder(), "-o", tmp_path / "report.md", "--format", "md", "--split")
    assert answer.code == 2 and answer.err.startswith("shadowbench: --split: found --format md; allowed: html")


def test_a_large_page_says_what_to_do(
    shadowbench: Shadowbench, run_folder: Write, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    run, page = run_folder(), tmp_path / "report.html"
    assert shadowbench("report", run, "-o", page).err == ""
    monkeypatch.setattr(command, "_LARGE", 1000)
    assert "with --split the pictures are files beside it" in shadowbench("report", run, "-o", page).err
    assert shadowbench("report", run, "-o", page, "--split").err == ""
