"""`new-technique`: the file that it writes can be measured."""

import csv
from collections.abc import Callable
from pathlib import Path
from typing import Any

Shadowbench = Callable[..., Any]


def test_new_techniques_run_unmodified(shadowbench: Shadowbench, tmp_path: Path) -> None:
    names, scenes, flags = ["CLASS_name", "my-shadows"], ["cube-on-plane", "spot-lamp"], []
    for name in names:
        answer = shadowbench("new-technique", name, "-o", tmp_path)
        file = tmp_path / f"{name}.py"
        assert answer.code == 0 and f"-t {name} -t shadow-map --plugin {file}" in answer.out
        flags += ["-t", name, "--plugin", file]
    small = ("--view-size", "64", "--map-size", "256", "--rounds", "1", "--phases", "1")
    run = shadowbench("run", *scenes, *flags, *small, "-o", tmp_path / "out")
    assert run.code == 0, run.err
    with (tmp_path / "out" / "table.csv").open(newline="", encoding="utf-8") as stream:
        rows = {(row["technique"], row["scene"]): row for row in csv.DictReader(stream) if row["technique"] in names}
    assert rows.keys() == {(name, scene) for name in names for scene in scenes}
    assert {(row["map_size"], row["status"]) for row in rows.values()} == {("256", "ok")}
    assert all(float(row["iou"]) > 0.7 for row in rows.values())


def test_a_bad_name_is_one_line(shadowbench: Shadowbench, tmp_path: Path) -> None:
    allowed = "allowed: letters, digits, _ and -"
    said = dict.fromkeys(("", "a/b", "True-", "é"), allowed) | {
        "shadow-map": "there is a technique called 'shadow-map'",
        "numpy": "there is a Python module (which the file would hide) called 'numpy'",
        "class": "and not a Python keyword",
    }
    for name, words in said.items():
        answer = shadowbench("new-technique", "-o", tmp_path, "--", name)
        assert answer.code == 2 and len(answer.err.splitlines()) == 1 and words in answer.err
        assert not list(tmp_path.rglob("*"))


def test_nothing_is_overwritten(shadowbench: Shadowbench, tmp_path: Path) -> None:
    (tmp_path / "mine.py").write_text("precious")
    answer = shadowbench("new-technique", "mine", "-o", tmp_path)
    assert answer.code == 2 and "mine.py: is there already" in answer.err
    assert (tmp_path / "mine.py").read_text() == "precious"


def test_an_error_in_a_plugin_s_shader_is_a_few_lines_with_its_own_file_and_line(
    shadowbench: Shadowbench, tmp_path: Path
) -> None:
    assert shadowbench("new-technique", "mine", "-o", tmp_path).code == 0
    file = tmp_path / "mine.py"
    file.write_text(file.read_text().replace("textureLod(map_depths", "textureLod(map_depth"))
    line = 1 + file.read_text().split("\n").index("    float stored = textureLod(map_depth, p.uv, 0.0).r;")
    small = ("--view-size", "16", "--map-size", "16", "--rounds", "0", "--phases", "1")
    run = shadowbench("run", "cube-on-plane", "-t", "mine", "--plugin", file, *small, "-o", tmp_path / "out")
    assert run.code == 3
    (status,) = [text for text in run.out.splitlines() if "failed: " in text]
    assert (
        f"ShaderError: fragment shader: mine.py:{line}: " in status and "'float stored = textureLod(map_depth" in status
    )
