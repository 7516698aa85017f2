"""Installed from a wheel or in place, the command finds its shaders and scenes from any folder."""

import csv
import importlib.util
import sys
from pathlib import Path

import pytest

TOOL = Path(__file__).resolve().parents[1] / "tools" / "wheel.py"  # which `make wheel` runs


@pytest.mark.slow
@pytest.mark.timeout(900)
@pytest.mark.parametrize("wheel", [True, False], ids=["wheel", "in place, as `make setup` installs it"])
def test_an_installation_runs_from_any_folder(wheel: bool, tmp_path: Path) -> None:
    spec = importlib.util.spec_from_file_location("wheel", TOOL)
    assert spec is not None and spec.loader is not None
    tool = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(tool)
    commands, folder = Path(sys.executable).parent, tmp_path / "elsewhere"
    if wheel:
        commands = tool.try_install(tmp_path / "venv", tool.build(tmp_path / "dist")[0])
    folder.mkdir()
    options = ["--map-size", "512", "--view-size", "128", "--rounds", "3"]
    tool.call(commands / "shadowbench", "run", "cube-on-plane", *options, cwd=folder)
    with (folder / "results/latest/table.csv").open(newline="") as table:
        rows = list(csv.DictReader(table))
    assert {row["scene"] for row in rows} == {"cube-on-plane"} and "ok" in {row["status"] for row in rows}
