"""The state's history: undo, redo, and gestures."""

from collections.abc import Callable
from dataclasses import replace

import pytest

from shadowbench.plugin.registry import techniques
from shadowbench.plugin.spec import parse_spec
from shadowbench.scenes.model import View
from shadowbench.viewer.state import History, ViewerState, materials, recolored


@pytest.fixture
def state(builtin: Callable[..., View]) -> ViewerState:
    view = builtin("fence")
    return ViewerState(view.scene, view.scene.cameras[0], view.light, (parse_spec("shadow-map", techniques()),))


def test_undo_and_redo_return_each_state(state: ViewerState) -> None:
    history = History(replace(state, wipe=0.0))
    for wipe in (0.1, 0.2, 0.3):
        history = history.changed(replace(state, wipe=wipe))
    assert history.changed(replace(history.state)) is history, "an equal state is no change"
    back = [history := history.undone() for _ in range(4)]
    assert [one.state.wipe for one in back] == [0.2, 0.1, 0.0, 0.0]
    forth = [history := history.redone() for _ in range(4)]
    assert [one.state.wipe for one in forth] == [0.1, 0.2, 0.3, 0.3]
    other = history.undone().changed(replace(state, wipe=0.9))
    assert other.redone() is other, "a change forgets what was undone"


def test_a_gesture_is_undone_as_a_whole_and_another_one_alone(state: ViewerState) -> None:
    history = History(state)
    for k in range(1, 6):
        history = history.changed(replace(state, wipe=k / 10), "drag")
    history = history.rested()
    for k in range(6, 9):
        history = history.changed(replace(state, wipe=k / 10), "drag")
    assert history.undone().state.wipe == 0.5
    assert history.undone().undone().state is state


def test_layouts_show_their_sources(state: ViewerState) -> None:
    assert state.sources == ("A", "truth")
    assert replace(state, layout="one").sources == ("A",)
    assert replace(state, layout="wipe", left="truth", right="A").sources == ("truth", "A")
    beside = replace(state, layout="side by side")
    assert beside.sources == ("A", "truth")
    assert beside.with_spec(1, state.specs[0]).sources == ("A", "B", "truth")


def test_copies_of_a_mesh_are_one_material(state: ViewerState) -> None:
    assert set(materials(state.scene)) == {"plane", "board", "rail"}
    red, own = recolored(state.scene, {"board": (1.0, 0.0, 0.0)}), state.scene.geometry.colors
    boards = [mesh for mesh in state.scene.meshes if mesh.name.startswith("board")]
    assert len(boards) > 1
    assert (red == (1.0, 0.0, 0.0)).all(axis=1).sum() == sum(len(mesh.faces) for mesh in boards)
    assert len(red) == len(own) and (red[0] == own[0]).all()
