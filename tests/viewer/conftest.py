"""A viewer without a window, its clock, and the process beside it."""

import time
from collections.abc import Callable, Iterator
from types import SimpleNamespace

import pytest
from imgui_bundle import imgui

from shadowbench.gl.device import Device
from shadowbench.options import ViewSize
from shadowbench.plugin.registry import techniques
from shadowbench.plugin.spec import parse_spec
from shadowbench.scenes.library import load_scene
from shadowbench.viewer.drawing import Viewer
from shadowbench.viewer.judge import Judge
from shadowbench.viewer.state import Origin, ViewerState


@pytest.fixture
def clock() -> SimpleNamespace:
    """A clock whose time is `now`, which tests set."""
    return SimpleNamespace(now=100.0)


@pytest.fixture(scope="module")
def judge() -> Iterator[Judge]:
    judge = Judge()
    yield judge
    judge.stop()


@pytest.fixture
def viewer(device: Device, clock: SimpleNamespace, judge: Judge) -> Iterator[Viewer]:
    """A viewer of a built-in scene at 64 × 64 pixels."""
    scene, known = load_scene("cube-on-plane"), techniques()
    specs = tuple(parse_spec(text, known) for text in ("shadow-map:size=64", "shadow-volume"))
    state = ViewerState(scene, scene.cameras[0], scene.lights[0], specs, ViewSize(64, 64), Origin("cube-on-plane"))
    viewer = Viewer(device, state, known, judge, seconds=lambda: clock.now)
    yield viewer
    viewer.release()


@pytest.fixture
def settle(clock: SimpleNamespace) -> Callable[[Viewer], None]:
    """Lets motion rest, until everything is scored."""

    def settled(viewer: Viewer) -> None:
        clock.now += 1.0
        viewer.step()
        while not (viewer.waiting and viewer.fresh):
            assert not viewer.judge.failure, viewer.judge.failure
            time.sleep(0.01)
            viewer.step()

    return settled


@pytest.fixture
def frame() -> Iterator[None]:
    """A frame of Dear ImGui without a window."""
    imgui.create_context()
    io = imgui.get_io()
    io.set_ini_filename("")
    io.display_size = imgui.ImVec2(800, 600)
    io.fonts.build()
    imgui.new_frame()
    imgui.begin("panel")
    yield
    imgui.end()
    imgui.end_frame()
    imgui.destroy_context()
