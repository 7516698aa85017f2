"""What the window draws is what `render` draws; what a technique breaks stays its own."""

import shutil
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager
from dataclasses import replace
from pathlib import Path

import moderngl
import numpy as np
import pytest

from shadowbench.gl.device import Device
from shadowbench.gl.gbuffer import download
from shadowbench.measure.session import CellRequest, Session
from shadowbench.measure.worker import Worker
from shadowbench.plugin.registry import techniques
from shadowbench.plugin.spec import Spec, parse_spec
from shadowbench.scenes.model import View
from shadowbench.scores.difference import FACETS, FALSE_LIGHT, FALSE_SHADOW
from shadowbench.viewer.drawing import LEAST_SIZE, Drawing, moving_size
from shadowbench.viewer.navigation import orbited
from shadowbench.viewer.panes import Panes
from shadowbench.viewer.state import OVERLAYS, Overlay, ViewerState
from shadowbench.viewer.truth import Traced

SIZE = 64
KNOWN = techniques()
BROKEN = """
from shadowbench.plugin.base import Technique, TechniqueParams, param
class Broken(Technique):
    '''Breaks in many ways.'''
    name = "broken"
    class Params(TechniqueParams):
        '''Parameters.'''
        how: str = param("build", "where it breaks")
    @classmethod
    def unsupported(cls, params, view, device):
        below = params.how == "below" and view.light.direction[1] > 0
        return 1 / 0 if params.how == "unsupported" or below else None
    def build(self, stage):
        if self.params.how == "build":
            raise KeyError("nothing there")
        if self.params.how == "shader":
            stage.program("fullscreen.vert", "out float x;\\nvoid main() { x = nothing; }\\n")
        self.texture = stage.texture()
        self.wide = stage.texture((8, 8))
    def draw(self, frame):
        if self.params.how == "exit":
            raise SystemExit(3)
        if self.params.how == "draw":
            raise RuntimeError("while drawing")
        if self.params.how == "gl":
            frame.clock._device.raw("glActiveTexture", 1)
        return self.wide if self.params.how == "size" else self.texture
"""


@pytest.fixture
def drawing(device: Device) -> Iterator[Drawing]:
    drawing = Drawing(device)
    yield drawing
    drawing.reload()


def state_of(view: View, *specs: str) -> ViewerState:
    parsed = tuple(parse_spec(text, KNOWN) for text in specs)
    return ViewerState(view.scene, view.scene.cameras[0], view.light, parsed, SIZE)


def mask_of(drawing: Drawing, state: ViewerState, size: int = SIZE) -> np.ndarray:
    drawn = drawing.draw(state, size)
    mask = drawing.visibility(drawn, drawn.masks[0])
    drawn.release()
    return mask


@pytest.mark.parametrize(
    ("scene", "spec"),
    [
        ("sphere-and-torus", "shadow-map:size=128"),
        ("sphere-and-torus", "cascades:size=64,filter=evsm"),
        ("room-with-lamp", "cube-map:size=64"),
        ("inside-volume", "shadow-volume"),
        ("spot-lamp", "hybrid:size=64"),
        ("docs/gallery/terminator.toml", "shadow-map:size=128"),
        ("docs/gallery/terminator.toml", "shadow-map:size=128,bias=terminator+texel"),
    ],
)
def test_the_mask_is_that_of_render_also_after_motion(
    drawing: Drawing,
    builtin: Callable[..., View],
    lent_worker: Callable[..., AbstractContextManager[Worker]],
    scene: str,
    spec: str,
) -> None:
    state = state_of(builtin(scene), spec)
    with lent_worker() as worker:
        request = CellRequest(state.specs[0].full_text)
        expected = worker.call(Session.draw, state.view(), request).visibility
    moved = replace(state, camera=orbited(state.camera, 0.3, 0.1))
    mask_of(drawing, moved, SIZE // 2)
    assert not np.array_equal(mask_of(drawing, moved), expected)
    assert np.array_equal(mask_of(drawing, state), expected)


def broken(how: str, folder: Path) -> Spec:
    (folder / "broken.py").write_text(BROKEN)
    return parse_spec(f"broken:how={how}", techniques([folder / "broken.py"]))


def test_a_technique_that_raised_for_one_view_is_drawn_for_the_next(
    drawing: Drawing, builtin: Callable[..., View], tmp_path: Path
) -> None:
    state = replace(state_of(builtin("cube-on-plane")), specs=(broken("below", tmp_path),))
    above = state.light.direction
    for direction, failure in ((above, ""), ((0.0, 1.0, 0.0), "ZeroDivisionError"), (above, "")):
        drawn = drawing.draw(replace(state, light=replace(state.light, direction=direction)), SIZE)
        assert drawn.masks[0].failure.partition(":")[0] == failure
        drawn.release()


@pytest.mark.parametrize(
    ("how", "told"),
    [
        ("unsupported", "ZeroDivisionError: division by zero"),
        ("build", "KeyError: 'nothing there'"),
        ("shader", "ShaderError: fragment shader: "),
        ("draw", "RuntimeError: while drawing"),
        ("exit", "SystemExit: 3"),
        ("gl", "RuntimeError: OpenGL error GL_INVALID_ENUM in drawing broken"),
        ("size", "ValueError: broken:how=size drew 8 × 8 pixels; allowed: 64 × 64"),
    ],
)
def test_a_broken_technique_is_told_and_the_other_is_drawn(
    drawing: Drawing, builtin: Callable[..., View], tmp_path: Path, how: str, told: str
) -> None:
    state = state_of(builtin("cube-on-plane"), "unshadowed", "shadow-map:size=65536")
    drawn = drawing.draw(replace(state, specs=(broken(how, tmp_path), *state.specs)), SIZE)
    assert drawn.masks[0].failure.startswith(told)
    assert drawn.masks[1].visibility is not None
    assert drawn.masks[2].failure == "unsupported: the driver refuses a map of 65536² texels in d32f"
    drawn.release()


def test_techniques_that_are_no_longer_shown_are_freed(drawing: Drawing, builtin: Callable[..., View]) -> None:
    state = state_of(builtin("cube-on-plane"), "shadow-map:size=128", "shadow-volume")
    drawing.draw(state, SIZE).release()
    both = drawing.bytes
    drawing.keep_only(state.specs[:1], (SIZE,))
    assert 128**2 * 4 <= drawing.bytes < both
    drawing.keep_only(state.specs, (SIZE // 2,))
    assert drawing.bytes == 0


@pytest.mark.parametrize("overlay", OVERLAYS)
def test_overlays_show_what_they_say(
    device: Device, drawing: Drawing, builtin: Callable[..., View], overlay: Overlay
) -> None:
    state = state_of(builtin("sphere-and-torus"), "cascades:size=64,filter=hard")
    panes, drawn = Panes(device), drawing.draw(state, SIZE)
    mask = drawing.visibility(drawn, drawn.masks[0])
    lit, every, far = mask > 0.5, np.ones((SIZE, SIZE), bool), np.full((SIZE, SIZE), np.inf, np.float32)
    facets = np.tri(SIZE, dtype=bool)
    wrong = Traced(1, (~lit).astype(np.float32), every, facets, far, soft=False, final=True)
    pictures = [panes.draw(drawn, replace(state, overlay=one), "A", wrong) for one in (overlay, "picture")]
    shown, plain = (download(one, "u1")[..., :3].astype(int) for one in pictures if one is not None)
    if overlay == "picture":
        assert np.array_equal(shown, plain)
    elif overlay == "error":  # everything is wrong
        assert np.abs(shown[lit] - FALSE_LIGHT).max() <= 1
        assert np.abs(shown[~lit & ~facets] - FALSE_SHADOW).max() <= 1
        assert np.abs(shown[~lit & facets] - FACETS).max() <= 1
    elif overlay == "mask":
        assert np.array_equal(shown[..., 0], np.rint(mask * 255))
    else:
        assert not np.array_equal(shown, plain)
    device.free([one for one in pictures if one is not None])
    drawn.release()
    panes.reload()


@pytest.mark.parametrize("spec", ["shadow-map:size=64", "cascades:size=64", "unshadowed"])
def test_the_map_of_a_technique_is_shown(
    device: Device, drawing: Drawing, builtin: Callable[..., View], spec: str
) -> None:
    drawn = drawing.draw(state_of(builtin("sphere-and-torus"), spec), SIZE)
    technique = drawn.masks[0].technique
    assert technique is not None
    picture, depths = Panes(device).map_picture(technique), technique.map_image()
    assert (picture is None) == (depths is None)
    if picture is not None and depths is not None:
        assert np.array_equal(download(picture, "u1")[..., 0], np.round(np.clip(depths, 0, 1) * 255))
        picture.release()
    drawn.release()


@pytest.mark.parametrize(
    ("spec", "scene"), [("shadow-map", "spot-lamp"), ("cascades", "stairs"), ("cube-map", "room-with-lamp")]
)
def test_texels_are_where_the_map_has_them(
    device: Device, drawing: Drawing, builtin: Callable[..., View], spec: str, scene: str
) -> None:
    """Neighbouring pixels of a plane are at most as many texels apart as a map of half the size has, times two."""
    found = []
    for size in (64, 128):
        drawn = drawing.draw(state_of(builtin(scene), f"{spec}:size={size},filter=hard"), SIZE)
        texture = drawn.masks[0].technique.texels()  # type: ignore[union-attr]
        assert isinstance(texture, moderngl.Texture)
        found.append(download(texture).copy())
        drawn.release()
    small, large = found
    inside = (small[..., 2] >= 0) & (large[..., 2] == small[..., 2])
    assert inside.mean() > 0.2
    assert (small[inside][:, :2].min() >= 0) and (small[inside][:, :2].max() <= 64)
    assert np.allclose(large[inside][:, :2] / 2, small[inside][:, :2], atol=3.0), "but for the fit's padding in texels"


def test_a_changed_shader_is_read_again(
    device: Device, drawing: Drawing, builtin: Callable[..., View], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from shadowbench import files

    shaders = tmp_path / "shaders"
    shutil.copytree(files.data_folder("shaders"), shaders)
    monkeypatch.setattr("shadowbench.plugin.stage.data_folder", lambda kind: tmp_path / kind)
    state = state_of(builtin("cube-on-plane"), "shadow-map:size=64")
    before = mask_of(drawing, state)
    resolve = shaders / "shadow-map" / "resolve.frag"
    resolve.write_text(resolve.read_text().replace("visibility = ", "visibility = 0.5 * "))
    assert np.array_equal(mask_of(drawing, state), before)
    drawing.reload()
    assert mask_of(drawing, state).max() < 0.51
    resolve.write_text("nonsense")
    drawing.reload()
    drawn = drawing.draw(state, SIZE)
    assert "resolve.frag:1" in drawn.masks[0].failure
    drawn.release()


def test_a_moving_image_is_smaller_on_a_software_renderer_only() -> None:
    assert [moving_size(512, ms, True) for ms in (10, 60, 150, 1000)] == [512, 256, 256, 128]
    assert moving_size(512, 1000, False) == 512
    assert moving_size(100, 1000, True) == LEAST_SIZE
    assert moving_size(16, 1000, True) == 16
