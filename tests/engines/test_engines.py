"""Other engines: what they declare; what they draw is measured, and what they draw wrongly is a failed cell."""

import math
import re
import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from unittest.mock import Mock

import numpy as np
import psutil
import pytest

from shadowbench.engines.engine_drawer import EngineDrawer
from shadowbench.engines.engine_session import plain_view
from shadowbench.engines.programs import (
    environment,
    install,
    locked_version,
    software_renderer,
    what_lacks,
)
from shadowbench.errors import InputError, Unsupported
from shadowbench.masks.export import describe
from shadowbench.measure.campaign import Block, Cell
from shadowbench.measure.pictures import Rendering
from shadowbench.measure.worker import CellFailed
from shadowbench.plugin.engine import Engine, EngineParams
from shadowbench.plugin.registry import engines
from shadowbench.plugin.spec import Spec, parse_spec
from shadowbench.scenes.model import View
from shadowbench.scenes.opening import chosen_view
from shadowbench.scenes.sequences import BUILT_IN, frames_of
from shadowbench.truths.cache import cached_truth
from tests.conftest import Answer
from tests.engines.conftest import SIZE, learn

Command = Callable[..., Answer]


def drawn(engine: type[Engine], view: View, fault: str = "none") -> Rendering:
    (engine.folder() / "fault").write_text(fault)
    spec = Spec(engine, EngineParams())
    with EngineDrawer(Mock()) as drawer:
        (rendering,) = drawer.draw(Block((view,), (Cell(spec),)), Cell(spec))
    return rendering


@pytest.mark.parametrize("name", ["babylon", "bevy", "blender", "filament", "ogre", "playcanvas", "three", "vtk"])
def test_a_declaration_has_sources_pinned_packages_and_a_short_file_that_draws(name: str) -> None:
    """Its defaults are what ships; its lock file has no address."""
    engine = engines()[name]
    (drawing,) = (file for file in engine.folder().iterdir() if file.stem == "draw")
    assert len(drawing.read_text(encoding="utf-8").splitlines()) <= 90
    assert issubclass(engine.Params, EngineParams)
    assert engine.presets["shipped"] == "" and engine.presets.keys() == engine.sources.keys()
    for preset in engine.presets:
        assert parse_spec(f"{name}:preset={preset}", engines()).technique is engine
    (lock,) = (file for file in engine.folder().iterdir() if file.name in ("package-lock.json", "requirements.txt"))
    assert not re.search(r"://|find-links|index-url", lock.read_text(encoding="utf-8"))
    assert re.fullmatch(r"[\w.]+", locked_version(engine))


def test_an_engine_that_draws_the_truth_has_its_mask(engine: type[Engine], view: View) -> None:
    """Also one that prints."""
    rendering, truth = drawn(engine, view), cached_truth(view)
    inside = truth.receivers & ~truth.undecided
    assert rendering.measurable is not None and rendering.measurable[inside].all()
    assert np.abs(rendering.visibility - truth.visibility)[inside].max() < 0.02
    assert rendering.engine == {"version": "1.0", "renderer": "a test", "box": "own", "phase": "none"}
    assert np.array_equal(drawn(engine, view, "prints").visibility, rendering.visibility)


@pytest.mark.parametrize("name", ["pan", "quick-sun"])
def test_frames_are_drawn_in_order_of_a_scene_that_is_loaded_once(engine: type[Engine], view: View, name: str) -> None:
    """One whose surfaces move is loaded again."""
    frames = frames_of(view, BUILT_IN[name], 4)
    for frame in frames:
        learn(engine.folder(), frame)
    cell = Cell(Spec(engine, EngineParams()))
    with EngineDrawer(Mock()) as drawer:
        masks = [one.visibility for one in drawer.draw(Block(frames, (cell,)), cell)]
        assert (engine.folder() / "loaded").read_text().split() == ["probe", "cube-on-plane"]
        moved = replace(frames[1], scene=replace(view.scene))
        assert len(list(drawer.draw(Block((frames[0], moved), (cell,)), cell))) == 2
        assert (engine.folder() / "loaded").read_text().split() == ["probe", *3 * ["cube-on-plane"]]
    for frame, mask in zip(frames, masks, strict=True):
        truth = cached_truth(frame, 1)
        assert np.abs(mask - truth.visibility)[truth.receivers & ~truth.undecided].max() < 0.02


@pytest.mark.parametrize(
    ("fault", "reason"),
    [
        ("dies", "it ended with exit code 3: out of memory"),
        ("raises", "ValueError: no such filter"),
        ("hangs", "no answer to 'draw' within 3 s"),
        ("lighter", "lighter with shadows than without"),
        ("noise", "two different pictures"),
        ("late", "by N·L"),
        ("upside down", "upside down"),
        ("mirrored", "upside down"),
        ("nothing", "neither black nor white"),
        ("gamma", "another encoding"),
        ("NaN", "not finite"),
        ("SwiftShader", "4 sub-pixel bits"),
        ("size", "47 × 64"),
    ],
)
def test_a_fault_fails_the_cell_and_leaves_no_program(
    engine: type[Engine], view: View, fault: str, reason: str
) -> None:
    engine.seconds = 3.0 if fault == "hangs" else 20.0
    before = set(psutil.Process().children())
    with pytest.raises(CellFailed, match=reason):
        drawn(engine, view, fault)
    assert set(psutil.Process().children()) <= before


def test_what_an_engine_cannot_draw_is_unsupported(engine: type[Engine], view: View) -> None:
    with pytest.raises(Unsupported, match="a point light; fake draws directional ones"):
        drawn(engine, chosen_view("room-with-lamp", SIZE))
    cube = view.scene.meshes[1]
    inside = replace(view, camera=replace(view.camera, position=tuple(cube.vertices.mean(axis=0))))
    with pytest.raises(Unsupported, match=f"the camera is inside {cube.name}, .*; sides=double draws both"):
        drawn(engine, inside)


def test_two_programs_stay_open_and_one_that_ended_is_started_again(engine: type[Engine], view: View) -> None:
    cells = [
        Cell(Spec(type(name, (engine,), {"__module__": engine.__module__}), EngineParams()))
        for name in ("first", "second", "third")
    ]
    before, started, masks = set(psutil.Process().children()), [], []
    with EngineDrawer(Mock()) as drawer:

        def draw(index: int) -> None:
            masks.extend(one.visibility for one in drawer.draw(Block((view,), (cells[index],)), cells[index]))
            running = {child for child in set(psutil.Process().children()) - before if child.status() != "zombie"}
            assert len(running) <= 2
            started.append(running)

        for index in (0, 1, 0, 2, 0):
            draw(index)
        assert started[2] == started[1] and started[4] == started[3]  # the one that was used before the last went on
        for program in started[-1]:
            program.kill()
            program.wait()
        draw(0)
    assert all(np.array_equal(mask, masks[0]) for mask in masks)


def test_mesa_s_files_are_found_where_loaders_look_for_them(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_DATA_DIRS", str(tmp_path))
    files = tmp_path / "vulkan/icd.d/lvp_icd.x86_64.json", tmp_path / "glvnd/egl_vendor.d/50_mesa.json"
    for file in (*files, tmp_path / "vulkan/icd.d/nvidia_icd.json", tmp_path / "glvnd/egl_vendor.d/10_nvidia.json"):
        file.parent.mkdir(parents=True, exist_ok=True)
        file.touch()
    variables = software_renderer()
    assert variables["LIBGL_ALWAYS_SOFTWARE"] == "1"
    assert variables["VK_DRIVER_FILES"] == variables["VK_ICD_FILENAMES"] == str(files[0])
    assert variables["__EGL_VENDOR_LIBRARY_FILENAMES"] == str(files[1])


def test_an_engine_that_is_not_installed_or_cannot_be_says_how(
    engine: type[Engine], view: View, monkeypatch: pytest.MonkeyPatch
) -> None:
    """One whose Python was removed is not installed."""
    python = environment(engine) / "bin" / "python"
    python.unlink()
    python.symlink_to("removed")
    with pytest.raises(InputError, match="fake: not installed: shadowbench engines install fake"):
        drawn(engine, view)
    shutil.rmtree(environment(engine))
    assert what_lacks(engine) == "not installed: shadowbench engines install fake"
    monkeypatch.setenv("SHADOWBENCH_CACHE", __file__)
    with pytest.raises(InputError, match="cannot be created"):
        install(engine)


def test_engines_get_the_spot_in_place_of_a_light_with_a_size_and_meshes_of_distinct_names(view: View) -> None:
    soft = chosen_view("window", SIZE)
    assert soft.light.kind == "rectangle"
    light = describe(plain_view(soft), "window")["light"]
    assert (light["kind"], light["size"]) == ("spot", None)
    assert light["cone"] == pytest.approx(math.degrees(soft.light.frustum_angle or 0))
    assert light["box"] == describe(soft, "window")["light"]["box"]
    plane, cube = view.scene.meshes
    twins = replace(view, scene=replace(view.scene, meshes=(plane, replace(cube, name=plane.name, casts=False))))
    assert [(mesh.name, mesh.casts) for mesh in plain_view(twins).scene.meshes] == [("mesh 0", True), ("mesh 1", False)]
    assert plain_view(view) is view


def test_measuring_goes_on_measures_equal_settings_once_and_reports_what_failed(
    engine: type[Engine], tmp_path: Path, shadowbench: Command, records: Callable[..., list[dict]]
) -> None:
    folder = tmp_path / "measured"
    what = ("--view-size", str(SIZE), "--scenes", "cube-on-plane", "-q")
    answer = shadowbench("engines", "measure", "fake", "-o", folder, *what)
    assert (answer.code, answer.err) == (0, "")
    rows = records(folder, "score")
    assert [(row["spec"], row["status"]) for row in rows] == [("fake", "ok"), ("fake:sides=double", "ok")]
    assert "fake:sides=double" in (folder / "report.html").read_text(encoding="utf-8")
    (engine.folder() / "fault").write_text("lighter")
    assert shadowbench("engines", "measure", "fake", "-o", folder, *what).code == 0
    assert len(records(folder)) == 2
    answer = shadowbench("engines", "measure", "fake", "-o", tmp_path / "again", *what)
    assert answer.code == 3 and "lighter with shadows than without" in answer.err
    page = tmp_path / "both.html"
    assert shadowbench("engines", "page", folder, tmp_path / "again", "-o", page).code == 0
    assert "lighter with shadows than without" in page.read_text(encoding="utf-8")


def test_the_doctor_has_a_shadow_drawn(
    engine: type[Engine], shadowbench: Command, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("shadowbench.commands.engines._PROBE_SIZE", SIZE)
    answer = shadowbench("engines", "doctor", "fake")
    assert (answer.code, answer.out) == (0, "fake: draws; 1.0, a test; shadows: directional 100%\n")
    (engine.folder() / "fault").write_text("no shadows")
    answer = shadowbench("engines", "doctor", "fake")
    assert answer.code == 1
    assert "fake: drew 0% of the shadow of cube-on-plane, under a directional light: do the light" in answer.out


def test_bad_input_is_one_line(engine: type[Engine], shadowbench: Command, tmp_path: Path) -> None:
    for arguments, line in [
        (["list", "--map-size", "64"], "engines list: found --map-size; allowed for: measure"),
        (["doctor", "-o", "x"], "engines doctor: found -o; allowed for: measure and page"),
        (["measure"], "engines measure: found no -o"),
        (["measure", "-o", "x", "--scenes", "fence"], "--scenes: fence has soft shadows"),
        (["measure", "thre", "-o", "x"], "did you mean 'three'?"),
        (["page"], "engines page: found no folder"),
        (["page", "x", "-o", tmp_path / "page.html"], "x: no such folder"),
    ]:
        answer = shadowbench("engines", *arguments)
        assert (answer.code, answer.out, answer.err.count("\n")) == (2, "", 1)
        assert answer.err.startswith("shadowbench: ") and line in answer.err
