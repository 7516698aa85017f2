"""What the window does between its frames, without a window."""

import gc
from collections import Counter
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import moderngl
import numpy as np
import pytest
from imgui_bundle import imgui
from PIL import Image

from shadowbench.plugin.registry import techniques
from shadowbench.plugin.spec import parse_spec
from shadowbench.studies.artefacts import artefacts
from shadowbench.viewer import drawing, scene_panels
from shadowbench.viewer.app import Viewer
from shadowbench.viewer.navigation import orbited
from shadowbench.viewer.result_panels import times_panel
from shadowbench.viewer.state import OVERLAYS, Origin
from shadowbench.viewer.view_panel import _save_picture

KNOWN = techniques()
SIZE = 64  # of the viewer in conftest.py
Settle = Callable[[Viewer], None]
NAN = """
from shadowbench.plugin.base import Technique
class NaN(Technique):
    '''NaN.'''
    name = 'nan'
    def build(self, stage):
        self.texture = stage.texture()
        self.texture.write(b'\\xff' * 4 * stage.size[0] ** 2)
    def draw(self, frame):
        return self.texture
"""


def test_nothing_is_drawn_again_without_a_change(viewer: Viewer, settle: Settle) -> None:
    settle(viewer)
    drawn = viewer.drawn
    viewer.change(replace(viewer.state, wipe=0.3, layout="wipe"))
    for _ in range(5):
        viewer.step()
    assert viewer.drawn is drawn
    assert viewer.waiting


def test_a_travelling_light_moves_by_the_clock_and_undo_returns(viewer: Viewer, clock: Any) -> None:
    viewer.step()
    before, viewer.travel, viewer.turns_a_minute = viewer.state.light, "circle", 60.0
    for _ in range(5):
        clock.now += 0.1
        viewer.step()
    x, y, z = before.direction
    assert viewer.state.light.direction == pytest.approx((-x, y, -z)), "half a turn in half a second"
    viewer.travel = "rest"
    viewer.undo()
    assert viewer.state.light == before


@pytest.mark.slow
@pytest.mark.parametrize("scene", ["acne", "lamp-far-away", "eye-in-volume"])
def test_an_artefact_is_shown_beside_its_cure_and_undone_at_once(viewer: Viewer, settle: Settle, scene: str) -> None:
    settle(viewer)
    before, artefact = viewer.state, next(one for one in artefacts() if one.scene == scene)
    assert scene_panels.show_artefact(viewer, artefact) in artefact.see
    settle(viewer)
    assert viewer.state.scene.name == scene and not any(viewer.mask_failures())
    broken, cured = (viewer.judge.scores[spec.full_text][artefact.metric] for spec in viewer.state.specs)
    assert abs(broken - cured) > 0.03
    viewer.undo()
    assert viewer.state == before


def test_materials_are_painted_without_another_mask_and_undone(
    frame: None, viewer: Viewer, settle: Settle, monkeypatch: pytest.MonkeyPatch
) -> None:
    settle(viewer)
    before, drawn = viewer.pictures["A"].read(), viewer.drawn
    red = (1.0, 0.0, 0.0)
    monkeypatch.setattr(scene_panels, "_color", lambda label, color: red if label == "box##material" else color)
    scene_panels.shading_panel(viewer)
    viewer.step()
    assert dict(viewer.state.colors) == {"box": red}
    assert viewer.pictures["A"].read() != before and viewer.drawn is drawn and viewer.fresh
    viewer.undo()
    viewer.step()
    assert viewer.pictures["A"].read() == before


def test_times_of_passes_have_a_short_history(frame: None, viewer: Viewer, monkeypatch: pytest.MonkeyPatch) -> None:
    plotted, plot = {}, imgui.plot_lines

    def recorded(label: str, values: np.ndarray, *how: Any) -> None:
        plotted[label] = values
        plot(label, values, *how)

    monkeypatch.setattr(imgui, "plot_lines", recorded)
    for turn in (0.0, 0.1, 0.2):
        viewer.change(replace(viewer.state, camera=orbited(viewer.state.camera, turn, 0.0)))
        viewer.step()
    times_panel(viewer)
    assert viewer.drawn is not None
    passes = [(source, mask.passes.ms) for source, mask in zip("AB", viewer.drawn.masks, strict=True)]
    assert list(plotted) == [f"##{source} {name}" for source, ms in passes for name in ms]
    assert plotted and all(len(values) == 3 and min(values) > 0 for values in plotted.values())


def test_a_camera_that_shows_nothing_is_told_and_the_next_one_is_drawn(viewer: Viewer, tmp_path: Path) -> None:
    viewer.step()
    viewer.change(replace(viewer.state, camera=replace(viewer.state.camera, position=viewer.state.camera.target)))
    viewer.step()
    assert "position and target are only" in viewer.broken
    viewer.attempt(lambda: _save_picture(viewer, tmp_path / "view.png"))
    assert viewer.message.endswith("view.png: nothing is drawn")
    viewer.undo()
    viewer.step()
    assert viewer.broken == "" and viewer.drawn is not None


def test_a_scene_that_the_device_refuses_is_told_and_undone(
    viewer: Viewer, settle: Settle, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(*_: object) -> None:
        raise MemoryError("no room")

    settle(viewer)
    with monkeypatch.context() as full:
        full.setattr(drawing, "LoadedScene", refuse)
        viewer.open_scene(Origin("post"))
        viewer.step()
        viewer.change(replace(viewer.state, layout="side by side", overlay="normals"))
        viewer.step()
        assert (viewer.broken, viewer.message) == ("MemoryError: no room", "")
    viewer.undo()
    viewer.undo()
    settle(viewer)
    assert list(viewer.mask_failures()) == ["", ""]


def test_a_technique_is_not_blamed_for_errors_of_another(viewer: Viewer) -> None:
    viewer.step()
    viewer.device.raw("glActiveTexture", 1)  # no texture unit
    before = viewer.drawn
    viewer.change(replace(viewer.state, camera=orbited(viewer.state.camera, 0.1, 0.0)))
    viewer.step()
    assert viewer.drawn is not before and (viewer.broken, *viewer.mask_failures()) == ("", "", "")


def test_nan_in_a_mask_is_told(viewer: Viewer, clock: Any, tmp_path: Path) -> None:
    (tmp_path / "nan.py").write_text(NAN)
    viewer.change(viewer.state.with_spec(0, parse_spec("nan", techniques([tmp_path / "nan.py"]))))
    viewer.step()
    clock.now += 1.0
    viewer.step()
    assert viewer.message == "ValueError: nan drew visibility is NaN or infinite in 4096 of 4096 pixels"


def test_a_saved_picture_has_what_is_shown(viewer: Viewer, tmp_path: Path, settle: Settle) -> None:
    def saved() -> tuple[int, int]:
        viewer.attempt(lambda: _save_picture(viewer, tmp_path / "view.png"))
        with Image.open(tmp_path / "view.png") as image:
            return image.size

    viewer.attempt(lambda: _save_picture(viewer, tmp_path / "view.png"))
    assert viewer.message.endswith("view.png: nothing is drawn yet")
    viewer.change(replace(viewer.state, layout="side by side"))
    viewer.shows_map = True
    settle(viewer)
    assert set(viewer.pictures) == {"A", "B", "truth"}
    assert all(np.ptp(np.frombuffer(one.read(), np.uint8)) > 100 for one in viewer.pictures.values())
    assert viewer.map_picture is not None and viewer.map_picture.size == (64, 64)
    assert saved() == (3 * SIZE, SIZE)
    viewer.change(replace(viewer.state, layout="wipe", wipe=0.25))
    viewer.step()
    assert saved() == (SIZE, SIZE)
    viewer.change(replace(viewer.state, layout="side by side", camera=orbited(viewer.state.camera, 0.1, 0.0)))
    viewer.step()
    assert saved() == (2 * SIZE, SIZE), "the truth is of an earlier view"


def test_another_scene_is_opened_from_its_first_camera(viewer: Viewer) -> None:
    viewer.attempt(lambda: viewer.open_scene(Origin("spot-lamp")))
    assert viewer.state.scene.name == "spot-lamp"
    assert viewer.state.camera == viewer.state.scene.cameras[0]
    viewer.attempt(lambda: viewer.open_scene(Origin("no-such-scene")))
    assert "no-such-scene" in viewer.message
    assert viewer.state.scene.name == "spot-lamp"


def test_a_scene_of_the_name_of_a_file_that_is_shown_can_be_chosen(
    frame: None, viewer: Viewer, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A state file has the name of its scene."""
    viewer.change(replace(viewer.state, scene=replace(viewer.state.scene, name="post")))
    monkeypatch.setattr(scene_panels, "choice", lambda label, value, *_: "post" if label == "scene" else value)
    scene_panels.scene_panel(viewer)
    assert viewer.state.origin == Origin("post")


def live_objects() -> Counter[str]:
    """Number of moderngl objects that have not been released, by type."""
    kinds = (moderngl.Texture, moderngl.Buffer, moderngl.Framebuffer, moderngl.Program, moderngl.VertexArray)
    gc.collect()
    found = [one for one in gc.get_objects() if type(one) in kinds]
    return Counter(type(one).__name__ for one in found if not isinstance(one.mglo, moderngl.InvalidObject))


@pytest.mark.slow
def test_nothing_is_left_behind_by_frames_and_other_techniques(viewer: Viewer, settle: Settle) -> None:
    specs = [parse_spec(text, KNOWN) for text in ("shadow-map:size=64", "cascades:size=64", "shadow-volume")]

    def change_all() -> None:
        for number, spec in enumerate(specs):
            for overlay in OVERLAYS:
                camera = orbited(viewer.state.camera, 0.01 * (number + 1), 0.0)
                viewer.change(replace(viewer.state.with_spec(0, spec), camera=camera, overlay=overlay))
                viewer.step()

    viewer.shows_map = True
    change_all()
    settle(viewer)
    before = live_objects()
    for _ in range(3):
        change_all()
    settle(viewer)
    assert live_objects() == before
