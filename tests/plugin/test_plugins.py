"""A plug-in as users install it: a package with an entry point. tests/test_examples.py runs plug-ins in one file."""

import csv
import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

EXAMPLE = Path(__file__).resolve().parents[2] / "examples" / "sphere_proxies.py"


@pytest.mark.slow
def test_an_installed_technique_is_listed_and_measured(tmp_path: Path) -> None:
    """In processes of their own, beside an installed package, made without pip: its shader is a file."""
    package, record = tmp_path / "proxies", tmp_path / "proxies-1.0.dist-info"
    package.mkdir()
    record.mkdir()
    before, shader, after = EXAMPLE.read_text(encoding="utf-8").split('"""', 4)[2:]
    (package / "__init__.py").write_text(before + '"proxies.frag"' + after, encoding="utf-8")
    (package / "proxies.frag").write_text(shader, encoding="utf-8")
    (record / "METADATA").write_text("Metadata-Version: 2.1\nName: proxies\nVersion: 1.0\n", encoding="utf-8")
    point = "[shadowbench.techniques]\nproxies = proxies:SphereProxies\n"
    (record / "entry_points.txt").write_text(point, encoding="utf-8")

    def command(*arguments: str | Path) -> str:
        path = os.pathsep.join([str(tmp_path), os.environ.get("PYTHONPATH", "")])
        called = [sys.executable, "-m", "shadowbench", *map(str, arguments)]
        return subprocess.run(
            called, env=os.environ | {"PYTHONPATH": path}, stdout=subprocess.PIPE, text=True, check=True
        ).stdout

    listed = {row["name"]: row for row in json.loads(command("list", "techniques", "--json"))}
    assert listed["sphere-proxies"]["parameters"] and {"shadow-map", "unshadowed"} <= set(listed)
    specs = ("-t", "sphere-proxies", "-t", "unshadowed")
    command("run", "cube-on-plane", *specs, "--view-size", "64", "--rounds", "1", "-o", tmp_path / "out")
    with (tmp_path / "out" / "table.csv").open(newline="", encoding="utf-8") as stream:
        own, floor = sorted(csv.DictReader(stream), key=lambda row: row["technique"])
    assert own["status"] == "ok" and float(own["pass_resolve_ms"]) > 0
    assert float(own["iou"]) > 0.3 > float(floor["iou"])
