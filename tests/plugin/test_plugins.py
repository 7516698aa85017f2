"""A plug-in as users install it: a package with an entry point. tests/test_examples.py runs plug-ins in one file."""

import csv
import json
import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

EXAMPLE = Path(__file__).resolve().parents[2] / "examples" / "sphere_proxies.py"


@pytest.fixture(scope="module")
def command(tmp_path_factory: pytest.TempPathFactory) -> Callable[..., str]:
    """`shadowbench …` in a process of its own, beside an installed package, made without pip: its shader is a file."""
    site = tmp_path_factory.mktemp("site")
    package, record = site / "proxies", site / "proxies-1.0.dist-info"
    package.mkdir()
    record.mkdir()
    before, shader, after = EXAMPLE.read_text(encoding="utf-8").split('"""', 4)[2:]
    (package / "__init__.py").write_text(before + '"proxies.frag"' + after, encoding="utf-8")
    (package / "proxies.frag").write_text(shader, encoding="utf-8")
    (record / "METADATA").write_text("Metadata-Version: 2.1\nName: proxies\nVersion: 1.0\n", encoding="utf-8")
    point = "[shadowbench.techniques]\nproxies = proxies:SphereProxies\n"
    (record / "entry_points.txt").write_text(point, encoding="utf-8")

    def run(*arguments: str | Path) -> str:
        called = [sys.executable, "-m", "shadowbench", *map(str, arguments)]
        path = os.pathsep.join([str(site), os.environ.get("PYTHONPATH", "")])
        done = subprocess.run(
            called, env=os.environ | {"PYTHONPATH": path}, capture_output=True, text=True, check=False
        )
        assert done.returncode == 0, done.stderr
        return done.stdout

    return run


def test_an_installed_technique_is_listed_with_its_parameters(command: Callable[..., str]) -> None:
    listed = {row["name"]: row for row in json.loads(command("list", "techniques", "--json"))}
    assert {"sphere-proxies", "shadow-map", "unshadowed"} <= set(listed)
    assert listed["sphere-proxies"]["parameters"]


@pytest.mark.slow
def test_an_installed_technique_is_measured(command: Callable[..., str], tmp_path: Path) -> None:
    specs = ("-t", "sphere-proxies", "-t", "unshadowed")
    command("run", "cube-on-plane", *specs, "--view-size", "128", "--rounds", "1", "-o", tmp_path)
    with (tmp_path / "table.csv").open(newline="", encoding="utf-8") as stream:
        own, floor = sorted(csv.DictReader(stream), key=lambda row: row["technique"])
    assert own["status"] == "ok" and float(own["frame_ms"]) > 0 and float(own["pass_resolve_ms"]) > 0
    assert float(own["iou"]) > 0.3 > float(floor["iou"])
