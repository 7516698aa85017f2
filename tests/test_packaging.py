"""Installed from a wheel or in place, the command finds its shaders and scenes from any folder."""

import csv
import subprocess
import sys
import venv
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]

pytestmark = [pytest.mark.slow, pytest.mark.timeout(900)]


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Built from the sdist, as `python -m build` does unless told otherwise."""
    folder = tmp_path_factory.mktemp("dist")
    subprocess.run([sys.executable, "-m", "build", "--outdir", folder, ROOT], check=True)
    (built,) = folder.glob("*.whl")
    return built


def commands_of_a_fresh_environment(folder: Path, *what: str | Path) -> Path:
    """Folder of the commands of a new virtual environment with nothing but `what` and its pinned dependencies."""
    venv.create(folder, with_pip=True)
    commands = folder / ("Scripts" if sys.platform == "win32" else "bin")
    constraints = ROOT / "constraints.txt"
    subprocess.run([commands / "python", "-m", "pip", "install", "--quiet", "-c", constraints, *what], check=True)
    return commands


def assert_runs_from(folder: Path, commands: Path) -> None:
    folder.mkdir()
    options = ["--map-size", "512", "--view-size", "128", "--rounds", "3"]
    subprocess.run([commands / "shadowbench", "run", "cube-on-plane", *options], cwd=folder, check=True)
    with (folder / "results/latest/table.csv").open(newline="") as table:
        rows = list(csv.DictReader(table))
    assert {row["scene"] for row in rows} == {"cube-on-plane"}
    assert "ok" in {row["status"] for row in rows}


def test_a_wheel_runs_from_any_folder(wheel: Path, tmp_path: Path) -> None:
    assert_runs_from(tmp_path / "elsewhere", commands_of_a_fresh_environment(tmp_path / "venv", wheel))


def test_an_editable_install_runs_from_any_folder(tmp_path: Path) -> None:
    assert_runs_from(tmp_path / "elsewhere", commands_of_a_fresh_environment(tmp_path / "venv", "-e", ROOT))
