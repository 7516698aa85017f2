"""The commands: their output, files and exit codes."""

import json
import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from PIL import Image

from shadowbench import __version__
from shadowbench.errors import number
from shadowbench.extremes.axes import AXES
from shadowbench.extremes.model import value_label
from shadowbench.measure import machine as measure_machine
from shadowbench.reports.texts import digits
from shadowbench.scenes.library import builtin_names, load_scene
from shadowbench.scenes.model import view_of
from shadowbench.scores.masks import read_mask
from shadowbench.scores.metrics import METRICS
from shadowbench.truths.embree import default_device
from shadowbench.truths.trace import trace

Shadowbench = Callable[..., Any]
SMALL = ["--view-size", "64", "--rounds", "1"]
CUBE = ["run", "cube-on-plane", "-t", "unshadowed", "-t", "shadow-map:size=64", *SMALL]


def test_run_prints_a_table_and_writes_a_folder(shadowbench: Shadowbench, tmp_path: Path) -> None:
    answer = shadowbench("run", "cube-on-plane", "-t", "shadow-map", "--map-size", "64,128", *SMALL, "-o", tmp_path)
    assert answer.code == 0, answer.err
    lines = answer.out.splitlines()
    assert lines[0].startswith("cube-on-plane, best first")
    assert lines[1].split()[:3] == ["spec", "map", "1"]
    assert [line.split()[:2] for line in lines[2:4]] == [["shadow-map", "128"], ["shadow-map", "64"]]
    assert "medians of up to 8 cells" in lines[4] and "one phase" not in answer.out
    assert "16 cells" in answer.out and "note" not in answer.err
    assert [line for line in answer.out.splitlines() if line != line.rstrip()] == []
    assert {file.name for file in tmp_path.iterdir()} == {
        "rows.jsonl", "table.csv", "run.json", "masks", "pictures", "truth",
    }  # fmt: skip
    run = json.loads((tmp_path / "run.json").read_text())
    assert run["command"].startswith("shadowbench run cube-on-plane -t shadow-map --map-size 64,128")
    assert run["assumptions"] == []


def test_a_table_says_what_its_numbers_are(shadowbench: Shadowbench, tmp_path: Path) -> None:
    """Options with map sizes imply eight phases by default; specs alone imply one."""
    specs = ("-t", "shadow-map", "-t", "shadow-map:bias=normal-offset(0.5)+constant(world=0.02)")
    out = shadowbench("run", "cube-on-plane", *specs, *SMALL, "-o", tmp_path).out
    assert "  scored in one phase" in out and "2 cells; masks/" in out
    assert out.startswith("cube-on-plane, best first; ms predicted for NVIDIA H100 80GB HBM3\n")
    assert "predicted ms" in out.splitlines()[1] and "× ref" not in out, "one kind of cost in a table"


SOFT = """
camera = { position = [2.3, 4.0, 3.4], target = [0.4, 0.2, -0.2], fov_y = 50.0 }
light = { kind = "directional", direction = [0.8, -1.0, -0.4], angular_radius = 6.0 }
mesh = [{ shape = "plane", scale = 8.0 }, { shape = "box" }]
"""


def test_a_table_of_soft_shadows_is_ranked_by_rmse_and_without_rounds_has_no_times(
    shadowbench: Shadowbench, tmp_path: Path
) -> None:
    (tmp_path / "soft.toml").write_text(SOFT)
    specs = ["-t", "shadow-map", "-t", "unshadowed", "--map-size", "128", "--view-size", "64", "--rounds", "0"]
    answer = shadowbench("run", tmp_path / "soft.toml", *specs, "-o", tmp_path / "rows")
    assert answer.code == 0, answer.err
    lines = answer.out.splitlines()
    assert lines[0] == "soft, best first by RMSE; work in millions of shader invocations and texture reads"
    assert lines[1].split()[:5] == ["spec", "map", "RMSE", "RMSE", "pen"]
    assert [line.split()[0] for line in lines[2:4]] == ["shadow-map", "unshadowed"]
    frame = pd.read_csv(tmp_path / "rows" / "table.csv")
    assert (frame["truth_error"] < frame["truth_error_pen"]).all() and (frame["penumbra"] > 0).all()
    assert frame[["frame_ms", "ratio", "n", "clock", "prepare_ms"]].isna().all(axis=None)


PAIR = """
camera = [
    { name = "left", position = [-2, 2, 3], target = [0, 0.5, 0] },
    { name = "right", position = [2, 2, 3], target = [0, 0.5, 0] },
]
light = [
    { name = "east", kind = "directional", direction = [-1, -1, -1] },
    { name = "west", kind = "directional", direction = [1, -1, -1] },
]
mesh = [{ file = "flat.obj" }]
"""


def test_run_takes_each_light_or_that_named_and_assumptions_are_said(shadowbench: Shadowbench, tmp_path: Path) -> None:
    (tmp_path / "flat.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 1 2\n")
    (tmp_path / "pair.toml").write_text(PAIR)
    words = (tmp_path / "pair.toml", "-t", "unshadowed", "--view-size", "16", "-o")
    flat = "pair.toml: 1 zero-area triangle(s) left out"
    cameras = "pair: 2 cameras: left, right; the first is used, {} names another"
    chosen = {
        (): {("left", "east"), ("left", "west")},
        ("--view", "right"): {("right", "east"), ("right", "west")},
        ("--light", "west"): {("left", "west")},
    }
    for named, views in chosen.items():
        out = tmp_path / "-".join(("out", *named))
        answer = shadowbench("run", *words, out, "--rounds", "0", *named)
        table = pd.read_csv(out / "table.csv")
        assert set(zip(table["view"], table["light"], strict=True)) == views
        said = json.loads((out / "run.json").read_text())["assumptions"]
        assert answer.err.splitlines() == [f"note: {line}" for line in said] and said[0] == flat
        assert (cameras.format("--view or a study") in said) == ("--view" not in named)
        rows = [json.loads(line) for line in (out / "rows.jsonl").read_text().splitlines()]
        assert all(row["assumptions"] == [flat] for row in rows if row["kind"] == "score")


def test_json_is_alone_on_stdout(shadowbench: Shadowbench, tmp_path: Path) -> None:
    answer = shadowbench("run", "room-with-lamp", *CUBE[1:], "--json", "-o", tmp_path)
    assert answer.code == 0
    tables = json.loads(answer.out)
    assert list(tables) == ["room-with-lamp", "cube-on-plane"]
    statuses = {row["spec"]: (row["refused"] or ["ok"])[0].partition(":")[0] for row in tables["room-with-lamp"]}
    assert statuses == {"unshadowed": "ok", "shadow-map": "unsupported"}
    best = tables["cube-on-plane"][0]
    assert best["spec"] == "shadow-map"
    assert set(METRICS) <= set(best) and 0 < best["iou"] < 1


def test_quiet_prints_the_table_alone(shadowbench: Shadowbench, tmp_path: Path) -> None:
    mesh = tmp_path / "box.obj"
    mesh.write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n")
    loud, quiet = (shadowbench("run", mesh, *CUBE[2:], "-o", tmp_path / "out", *more) for more in ([], ["--quiet"]))
    assert (loud.code, quiet.code) == (0, 0)
    assert "note: " in loud.err and "table.csv" in loud.out
    assert quiet.err == "" and quiet.out.startswith("box, best first") and "table.csv" not in quiet.out
    assert json.loads((tmp_path / "out" / "run.json").read_text())["assumptions"] != []


def test_cells_that_fail_are_exit_3_and_named(shadowbench: Shadowbench, wild: Path, tmp_path: Path) -> None:
    arguments = [*CUBE, "-t", "does:what=raise", "--plugin", wild, "-o", tmp_path]
    answer = shadowbench(*arguments)
    assert answer.code == 3
    assert "does:what=raise : failed: ZeroDivisionError: as planned (wild.py:" in answer.out
    assert "1 of 3 cells failed; the first: ZeroDivisionError: as planned" in answer.err
    late = shadowbench(*CUBE, "-t", "does:what=raise,after=2", "--plugin", wild, "-o", tmp_path)
    assert late.code == 3 and "while timed: ZeroDivisionError" in late.out
    render = ("render", "cube-on-plane", "-t", "does:what=abort", "--plugin", wild, "--view-size", "16")
    picture = shadowbench(*render, "-o", tmp_path / "p.png")
    last = picture.err.splitlines()[-1]
    assert picture.code == 3 and last.startswith(
        "shadowbench: does:what=abort on cube-on-plane failed: crashed: SIGABRT"
    )
    assert not (tmp_path / "p.png").exists()


def test_an_entry_point_that_cannot_be_imported_is_one_line_and_the_rest_works(tmp_path: Path) -> None:
    information = tmp_path / "gone-1.0.dist-info"
    information.mkdir()
    (information / "METADATA").write_text("Metadata-Version: 2.1\nName: gone\nVersion: 1.0\n")
    (information / "entry_points.txt").write_text("[shadowbench.techniques]\ngone = gone_away:Gone\n")
    done = subprocess.run(
        [sys.executable, "-m", "shadowbench", "list", "techniques"],
        env=os.environ | {"PYTHONPATH": str(tmp_path)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert (done.returncode, len(done.stderr.splitlines())) == (0, 1)
    assert "entry point 'gone' of gone cannot be imported" in done.stderr and "shadow-map" in done.stdout


def test_render_writes_picture_map_and_the_mask_of_a_run(shadowbench: Shadowbench, tmp_path: Path) -> None:
    shadowbench(*CUBE, "-o", tmp_path / "run")
    masks = [read_mask(file) for file in (tmp_path / "run" / "masks").iterdir()]
    folder = tmp_path / "rendered"
    folder.mkdir()
    picture, mask, depths = (folder / f"{name}.png" for name in ("picture", "mask", "map"))
    words = ("render", "cube-on-plane", "-t", "shadow-map:size=64", "--view-size", "64", "-o", picture)
    answer = shadowbench(*words, "--mask", mask, "--map", depths)
    assert answer.code == 0, answer.err
    assert answer.out == f"{picture}: shadow-map:size=64 on cube-on-plane\n"
    assert [np.array_equal(drawn, read_mask(mask)) for drawn in masks].count(True) == 1
    with Image.open(picture) as image, Image.open(depths) as levels:
        assert (image.format, image.mode, image.size) == ("PNG", "RGB", (64, 64))
        assert (levels.mode, levels.size) == ("L", (64, 64)) and np.asarray(levels).std() > 0
    assert sorted(folder.iterdir()) == sorted([picture, mask, depths])


def test_truth_writes_the_promised_arrays(shadowbench: Shadowbench, tmp_path: Path) -> None:
    file = tmp_path / "truth.npz"
    answer = shadowbench("truth", "cube-on-plane", "-o", file, "--view-size", "48", "--pixel-samples", "2")
    assert answer.code == 0, answer.err
    scene = load_scene("cube-on-plane")
    truth = trace(view_of(scene, scene.cameras[0], scene.lights[0], 48), pixel_samples=2)
    kinds = {"visibility": np.float32, "receivers": bool, "undecided": bool, "triangle": np.int32, "area": np.float32}
    with np.load(file) as arrays:
        for name, kind in (kinds | {"blocker": arrays["blocker"].dtype}).items():
            assert (arrays[name].shape, arrays[name].dtype) == ((48, 48), kind)
            assert np.array_equal(arrays[name], truth.arrays()[name])
        receivers, undecided = arrays["receivers"], arrays["undecided"]
        shadowed = (arrays["visibility"] < 0.5).sum()
        counts = f"{receivers.sum()} of {48 * 48} pixels show a receiver, {shadowed} in shadow"
        assert answer.out == f"{file}: {counts}, {(receivers & undecided).sum()} undecided\n"
    assert shadowbench("truth", "cube-on-plane", "-o", file, "--view-size", "48", "-q").out == ""


KEYS = {
    "techniques": {"name", "help", "lights", "parameters", "presets"},
    "scenes": {"name", "light", "about"},
    "metrics": {"name", "better", "for", "tolerance", "help"},
    "studies": {"name", "about"},
    "axes": {"name", "about", "unit", "values", "home", "lights"},
}


def test_list_names_each_kind_with_parameters_presets_values_and_plug_ins(shadowbench: Shadowbench, half: Path) -> None:
    everything = json.loads(shadowbench("list", "--json", "--plugin", half).out)
    assert {what: set(everything[what][0]) for what in KEYS} == KEYS
    listed = {row["name"]: row for row in everything["techniques"]}
    level = {"name": "level", "default": "0.5", "allowed": "≥ 0, ≤ 1", "help": "visibility of every pixel"}
    contact, history, own = listed["half"]["parameters"]
    assert own == level and (contact["name"], history["name"]) == ("contact", "history")
    (biases,) = (row["values"] for row in listed["shadow-map"]["parameters"] if row["name"] == "bias")
    assert {"none", "constant", "slope", "texel"} <= {row["name"] for row in biases}
    assert "course" in listed["shadow-map"]["presets"]
    assert [row["name"] for row in everything["scenes"]] == builtin_names()
    printed = shadowbench("list", "axes", "-q").out
    assert all(axis.name in printed and value_label(axis.default) in printed for axis in AXES.values())


def test_doctor_names_the_device_and_the_clock(
    shadowbench: Shadowbench, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr(measure_machine, "ROUNDS", 3)
    monkeypatch.setenv("SHADOWBENCH_CACHE", str(tmp_path))  # Doctor counts truths, and other tests trace meanwhile.
    found = json.loads(shadowbench("doctor", "--json").out)
    assert {"machine", "versions", "opengl", "embree", "truth_cache"} == set(found)
    assert found["embree"]["rays_at_once"] == f"{default_device().width}, native to this processor"
    assert {"renderer", "version", "clock", "max_map_size", "why_this_clock"} <= set(found["opengl"])
    assert found["versions"]["shadowbench"] == __version__
    printed, quiet = (shadowbench("doctor", *flags) for flags in ([], ["-q"]))
    assert (printed.code, quiet.code, quiet.err) == (0, 0, "")
    assert found["opengl"]["renderer"] in printed.out
    said, less = ([line for line in answer.out.splitlines() if "noise" not in line] for answer in (printed, quiet))
    assert said == [*less, "ready"]


def test_without_gl_drawing_is_exit_3_with_what_to_install_and_the_rest_works(
    shadowbench: Shadowbench, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    def without_gl(command: str, *words: str | Path) -> Any:
        monkeypatch.setenv("__EGL_VENDOR_LIBRARY_FILENAMES", f"none for {command}")  # so that each starts a worker
        return shadowbench(command, *words)

    for command in ("run", "render"):
        answer = without_gl(command, "cube-on-plane", "-t", "unshadowed", "-o", tmp_path / "out.png")
        assert (answer.code, answer.out, answer.err.count("\n")) == (3, "", 1)
        assert answer.err.startswith("shadowbench: no OpenGL 4.1 context") and "apt-get install" in answer.err
        assert list(tmp_path.iterdir()) == []
    doctor = without_gl("doctor", "--json")
    assert doctor.code == 3 and "apt-get install" in json.loads(doctor.out)["opengl"]["missing"]
    assert without_gl("truth", "cube-on-plane", "-o", tmp_path / "t.npz", "--view-size", "16").code == 0


def test_version_and_without_a_command_the_help(shadowbench: Shadowbench) -> None:
    assert shadowbench("--version").out == f"{__version__}\n"
    assert shadowbench() == shadowbench("--help")


@pytest.mark.parametrize(("value", "shown"), [(0.99975, "0.9998"), (0.99998749, "0.99999"), (1.0, "1"), (1.0002, "1")])
def test_what_is_not_exact_is_not_rounded_to_1(value: float, shown: str) -> None:
    """`1 is exact`, say the columns of IoU and SSIM, in the terminal and in the report."""
    assert number(value) == shown
    assert float(digits(value)) == float(shown)
