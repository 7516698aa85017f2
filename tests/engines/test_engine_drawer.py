"""Other engines as drawers: what they draw is measured, and what they draw wrongly is a failed cell."""

import math
import re
import shutil
from dataclasses import replace
from pathlib import Path
from typing import Any
from unittest.mock import Mock

import numpy as np
import psutil
import pytest

from shadowbench.engines.drawer import EngineDrawer
from shadowbench.engines.environment import (
    check_lock,
    environment,
    install,
    python_of,
    software_renderer,
    what_lacks,
)
from shadowbench.engines.export import describe
from shadowbench.engines.session import plain_view
from shadowbench.errors import InputError, Unsupported
from shadowbench.measure.campaign import Block, Cell
from shadowbench.measure.session import Rendering
from shadowbench.measure.worker import CellFailed
from shadowbench.plugin.engine import Engine, EngineParams
from shadowbench.plugin.spec import Spec
from shadowbench.scenes.model import View
from shadowbench.scenes.opening import chosen_view
from shadowbench.truths.cache import cached_truth
from tests.engines.conftest import SIZE


def drawn(engine: type[Engine], view: View, fault: str = "none", **params: Any) -> Rendering:
    (engine.folder() / "fault").write_text(fault)
    spec = Spec(engine, EngineParams(**params))
    with EngineDrawer(Mock()) as drawer:
        (rendering,) = drawer.draw(Block(view, (Cell(spec),)), Cell(spec))
    return rendering


def test_an_engine_that_draws_the_truth_has_its_mask(engine: type[Engine], view: View) -> None:
    found, truth = drawn(engine, view), cached_truth(view)
    inside = truth.receivers & ~truth.undecided
    assert found.measurable is not None
    assert found.measurable[inside].all()
    assert np.abs(found.visibility - truth.visibility)[inside].max() < 0.02
    assert found.engine == {"version": "1.0", "renderer": "a test", "box": "own", "phase": "none"}


def test_what_an_engine_prints_is_no_answer(engine: type[Engine], view: View) -> None:
    assert np.array_equal(drawn(engine, view, "prints").visibility, drawn(engine, view).visibility)


@pytest.mark.parametrize(
    ("fault", "told"),
    [
        ("dies", "it ended with exit code 3: out of memory"),
        ("raises", "ValueError: no such filter"),
        ("lighter", "lighter with shadows than without"),
        ("noise", "two different pictures"),
        ("upside down", "upside down"),
        ("mirrored", "upside down"),
        ("nothing", "neither black nor white"),
        ("gamma 2.2", "another encoding"),
        ("NaN", "not finite"),
        ("SwiftShader", "4 sub-pixel bits"),
        ("size", "63 × 64"),
    ],
)
def test_a_fault_fails_the_cell(engine: type[Engine], view: View, fault: str, told: str) -> None:
    before = set(psutil.Process().children())
    with pytest.raises(CellFailed, match=told):
        drawn(engine, view, fault)
    assert set(psutil.Process().children()) <= before


def test_a_picture_one_frame_late_fails_the_cell(engine: type[Engine], view: View) -> None:
    with pytest.raises(CellFailed):
        drawn(engine, view, "late")


@pytest.mark.slow
def test_an_engine_that_hangs_is_ended(engine: type[Engine], view: View) -> None:
    engine.seconds = 3.0
    with pytest.raises(CellFailed, match="no answer to 'draw' within 3 s"):
        drawn(engine, view, "hangs")


def test_a_light_that_an_engine_does_not_draw_is_unsupported(engine: type[Engine]) -> None:
    with pytest.raises(Unsupported, match="a point light; fake draws directional ones"):
        drawn(engine, chosen_view("room-with-lamp", SIZE))


def test_a_camera_inside_a_mesh_that_is_drawn_from_outside_is_unsupported(engine: type[Engine], view: View) -> None:
    cube = view.scene.meshes[1]
    inside = replace(view, camera=replace(view.camera, position=tuple(cube.vertices.mean(axis=0))))
    with pytest.raises(Unsupported, match=f"the camera is inside {cube.name}, .*; sides=double draws both"):
        drawn(engine, inside)
    cell = Cell(Spec(engine, EngineParams(sides="double")))
    assert EngineDrawer(Mock()).unsupported(Block(inside, (cell,)), cell) is None


def test_no_more_than_two_programs_stay_open(engine: type[Engine], view: View) -> None:
    (engine.folder() / "fault").write_text("none")
    names = ("first", "second", "third")
    cells = [Cell(Spec(type(name, (engine,), {}), EngineParams())) for name in names]
    before, started = set(psutil.Process().children()), []
    with EngineDrawer(Mock()) as drawer:
        for turn in (0, 1, 0, 2, 0):
            list(drawer.draw(Block(view, (cells[turn],)), cells[turn]))
            running = {child for child in set(psutil.Process().children()) - before if child.status() != "zombie"}
            assert len(running) <= 2
            started.append(running)
    assert started[2] == started[1]
    assert started[4] == started[3]  # the one that was used before the last went on


def test_mesa_s_files_are_found_where_loaders_look_for_them(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_DATA_DIRS", str(tmp_path))
    assert not any(value.startswith(str(tmp_path)) for value in software_renderer().values())
    files = tmp_path / "vulkan/icd.d/lvp_icd.x86_64.json", tmp_path / "glvnd/egl_vendor.d/50_mesa.json"
    for file in (*files, tmp_path / "vulkan/icd.d/nvidia_icd.json", tmp_path / "glvnd/egl_vendor.d/10_nvidia.json"):
        file.parent.mkdir(parents=True, exist_ok=True)
        file.touch()
    found = software_renderer()
    assert found["LIBGL_ALWAYS_SOFTWARE"] == "1"
    assert found["VK_DRIVER_FILES"] == found["VK_ICD_FILENAMES"] == str(files[0])
    assert found["__EGL_VENDOR_LIBRARY_FILENAMES"] == str(files[1])


@pytest.mark.parametrize(
    "line",
    [
        "fake==1.0",
        "fake>=1.0 --hash=sha256:{hash}",
        "--find-links here",
        "--index-url x\\\nfake==1.0",
        "fake @ file:///x",
    ],
)
def test_a_lock_file_of_anything_but_pinned_hashes_is_refused(engine: type[Engine], line: str) -> None:
    lock = engine.folder() / "requirements.txt"
    pinned = f"# made by pip-compile\nfake==1.0 ; python_version > '3' \\\n    --hash=sha256:{'0' * 64}\n"
    lock.write_text(pinned)
    check_lock(engine)
    lock.write_text(pinned + line.format(hash="0" * 64) + "\n")
    with pytest.raises(InputError, match=re.escape(f"{lock}: found ")):
        check_lock(engine)


def test_an_engine_that_is_not_installed_says_how(engine: type[Engine], view: View) -> None:
    shutil.rmtree(environment(engine))
    assert what_lacks(engine) == "not installed: shadowbench engines install fake"
    with pytest.raises(InputError, match="fake: not installed: shadowbench engines install fake"):
        drawn(engine, view)


def test_an_environment_that_lost_its_python_is_installed_anew(
    engine: type[Engine], view: View, monkeypatch: pytest.MonkeyPatch
) -> None:
    python = python_of(engine)
    python.unlink()
    python.symlink_to("removed")
    assert what_lacks(engine) == "not installed: shadowbench engines install fake"

    def make(*command: str, folder: Path) -> None:
        if "venv" in command:
            (folder / "bin").mkdir()
            (folder / "bin" / "python").touch()

    monkeypatch.setattr("shadowbench.engines.environment._run", make)
    monkeypatch.setattr("shadowbench.engines.environment._interpreter", lambda engine: "python")
    folder = install(engine)
    assert folder == environment(engine) and python.is_file() and what_lacks(engine) is None
    assert list(folder.parent.iterdir()) == [folder]


def test_a_folder_that_cannot_be_made_is_one_line(engine: type[Engine], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("SHADOWBENCH_ENGINES", f"{__file__}/engines")
    with pytest.raises(InputError, match="cannot be created"):
        install(engine)


def test_a_program_that_ended_between_two_cells_is_started_again(engine: type[Engine], view: View) -> None:
    block, cell = Block(view, (Cell(Spec(engine, EngineParams())),)), Cell(Spec(engine, EngineParams()))
    before = set(psutil.Process().children())
    with EngineDrawer(Mock()) as drawer:
        (first,) = drawer.draw(block, cell)
        for program in set(psutil.Process().children()) - before:
            program.kill()
            program.wait()
        (second,) = drawer.draw(block, cell)
    assert np.array_equal(first.visibility, second.visibility)


def test_engines_are_told_of_the_spot_in_place_of_a_light_with_a_size() -> None:
    view = chosen_view("window", SIZE)
    assert view.light.kind == "rectangle"
    light = describe(plain_view(view), "window")["light"]
    assert (light["kind"], light["size"]) == ("spot", None)
    assert light["cone"] == pytest.approx(math.degrees(view.light.frustum_angle or 0))
    assert light["box"] == describe(view, "window")["light"]["box"]


def test_meshes_of_one_name_are_told_apart(view: View) -> None:
    """By names some engines find what casts and receives."""
    plane, cube = view.scene.meshes
    twins = replace(view, scene=replace(view.scene, meshes=(plane, replace(cube, name=plane.name, casts=False))))
    assert [mesh.name for mesh in plain_view(twins).scene.meshes] == ["mesh 0", "mesh 1"]
    assert [mesh.casts for mesh in plain_view(twins).scene.meshes] == [True, False]
    assert plain_view(view) is view
