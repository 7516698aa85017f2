"""Installed from a wheel or in place, the command finds its shaders and scenes from any folder."""

import csv
import importlib.util
import sys
from pathlib import Path
from types import ModuleType

import pytest

ROOT = Path(__file__).resolve().parents[1]

pytestmark = [pytest.mark.slow, pytest.mark.timeout(900)]


@pytest.fixture(scope="module")
def tool() -> ModuleType:
    """The tool that `make wheel` runs."""
    spec = importlib.util.spec_from_file_location("wheel", ROOT / "tools" / "wheel.py")
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def assert_runs_from(folder: Path, tool: ModuleType, commands: Path) -> None:
    folder.mkdir()
    options = ["--map-size", "512", "--view-size", "128", "--rounds", "3"]
    tool.call(commands / "shadowbench", "run", "cube-on-plane", *options, cwd=folder)
    with (folder / "results/latest/table.csv").open(newline="") as table:
        rows = list(csv.DictReader(table))
    assert {row["scene"] for row in rows} == {"cube-on-plane"}
    assert "ok" in {row["status"] for row in rows}


def test_a_wheel_runs_from_any_folder(tool: ModuleType, tmp_path: Path) -> None:
    wheel, _ = tool.build(tmp_path / "dist")
    assert_runs_from(tmp_path / "elsewhere", tool, tool.try_install(tmp_path / "venv", wheel))


def test_an_editable_install_runs_from_any_folder(tool: ModuleType, tmp_path: Path) -> None:
    """That of `make setup`, in which the tests run."""
    assert_runs_from(tmp_path / "elsewhere", tool, Path(sys.executable).parent)
