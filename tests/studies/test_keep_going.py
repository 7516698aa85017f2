"""`--keep-going`: what would stop a study is left out and named; the rest is measured."""

import csv
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from tests.runs import CHANGING

Shadowbench = Callable[..., Any]
SMALL = ("-t", "unshadowed", "--rounds", "0", "--view-size", "32", "--quiet")


@pytest.fixture
def scenes(tmp_path: Path) -> dict[str, Path]:
    """A good scene, one that is no TOML, and one whose camera shows nothing."""
    good, broken, away = (tmp_path / f"{name}.toml" for name in ("good", "broken", "away"))
    good.write_text(CHANGING.replace('"changing"', '"good"'))
    broken.write_text("broken")
    text = CHANGING.replace('"changing"', '"away"').replace("target = [0.0, 0.3, 0.0]", "target = [9.0, 9.0, 9.0]")
    away.write_text(text)
    return {"good": good, "broken": broken, "away": away}


def measured(folder: Path) -> list[str]:
    with (folder / "table.csv").open(newline="") as stream:
        return [row["scene"] for row in csv.DictReader(stream)]


def test_a_scene_that_cannot_be_read_and_a_truth_that_fails_are_left_out(
    shadowbench: Shadowbench, scenes: dict[str, Path], tmp_path: Path
) -> None:
    command = ("run", scenes["broken"], scenes["away"], scenes["good"], tmp_path / "gone.obj", *SMALL)
    stopped = shadowbench(*command, "-o", tmp_path / "stopped")
    assert stopped.code == 2 and not (tmp_path / "stopped").exists()
    answer = shadowbench(*command, "--keep-going", "-o", tmp_path / "out")
    assert answer.code == 3 and measured(tmp_path / "out") == ["good"]
    lines = answer.err.splitlines()
    assert len(lines) == 3
    assert lines[0].startswith(f"failed: 1 × scene: {scenes['broken']}: not TOML: ")
    assert lines[1] == f"failed: 1 × scene: {tmp_path / 'gone.obj'}: no such file"
    assert lines[2].startswith("failed: 1 × truth: ") and "shows nothing" in lines[2]


def test_nothing_left_is_an_error(shadowbench: Shadowbench, scenes: dict[str, Path], tmp_path: Path) -> None:
    for name, code in (("broken", 2), ("away", 3)):
        answer = shadowbench("run", scenes[name], *SMALL, "--keep-going", "-o", tmp_path / "out")
        assert answer.code == code and answer.err.count("\n") == 1 and name in answer.err
        assert not (tmp_path / "out").exists()
