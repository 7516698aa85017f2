"""Installed from a wheel or in place, the command finds its shaders and scenes from any folder."""

import csv
import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
COMMANDS = Path(sys.executable).parent


def call(*words: str | Path, cwd: Path = ROOT) -> None:
    """Run a command without PYTHONPATH, which would lead it back to the sources."""
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
    subprocess.run(words, check=True, cwd=cwd, env=environment)


@pytest.mark.slow
@pytest.mark.timeout(900)
@pytest.mark.parametrize("wheel", [True, False], ids=["wheel", "in place, as `make setup` installs it"])
def test_an_installation_runs_from_any_folder(wheel: bool, tmp_path: Path) -> None:
    commands, folder = COMMANDS, tmp_path / "elsewhere"
    if wheel:
        commands = tmp_path / "venv" / "bin"
        call(COMMANDS / "uv", "build", "--quiet", "--out-dir", tmp_path / "dist")
        (built,) = (tmp_path / "dist").glob("*.whl")
        call(COMMANDS / "uv", "venv", "--quiet", commands.parent, "--python", sys.executable)
        into = ("--python", commands / "python", "-c", ROOT / "constraints.txt")
        call(COMMANDS / "uv", "pip", "install", "--quiet", *into, built)
    folder.mkdir()
    options = ["--map-size", "512", "--view-size", "128", "--rounds", "3"]
    call(commands / "shadowbench", "run", "cube-on-plane", *options, cwd=folder)
    with (folder / "results/latest/table.csv").open(newline="") as table:
        rows = list(csv.DictReader(table))
    assert {row["scene"] for row in rows} == {"cube-on-plane"} and "ok" in {row["status"] for row in rows}
