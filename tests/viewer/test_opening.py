"""Files that the window and its command open: scenes, meshes and saved states."""

import shutil
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from shadowbench.commands import view as view_command
from shadowbench.scenes.library import load_scene
from shadowbench.viewer import opening
from shadowbench.viewer.app import Viewer
from shadowbench.viewer.opening import Opener
from shadowbench.viewer.state import ViewerState
from shadowbench.viewer.state_files import ply_of, save_state


@pytest.fixture
def mesh(tmp_path: Path) -> Path:
    path = tmp_path / "own.ply"
    path.write_bytes(ply_of(load_scene("post").meshes[1:]))
    return path


def test_a_dropped_mesh_is_shown_with_what_was_assumed(viewer: Viewer, mesh: Path) -> None:
    Opener(viewer).dropped([str(mesh), "another"])
    assert viewer.state.scene.name == "own" and viewer.state.origin is not None
    assert viewer.state.origin.source == str(mesh)
    assert viewer.message.startswith(f"{mesh} is shown; ") and "no ground in own.ply: assumed" in viewer.message
    viewer.undo()
    assert viewer.state.scene.name == "mine"


def test_a_dropped_state_is_shown_with_all_that_was_saved(viewer: Viewer, tmp_path: Path) -> None:
    saved = replace(viewer.state, specs=viewer.state.specs[1:], overlay="error", layout="one", size=96)
    save_state(saved, tmp_path / "state.toml")
    Opener(viewer).dropped([str(tmp_path / "state.toml")])
    state = viewer.state
    assert (state.specs, state.overlay, state.layout, state.size) == (saved.specs, "error", "one", 96)


def test_a_file_that_cannot_be_opened_is_told_and_nothing_changes(viewer: Viewer, tmp_path: Path) -> None:
    before = viewer.state
    for name in ("nothing.glb", "nothing.toml", "text.txt"):
        Opener(viewer).dropped([str(tmp_path / name)])
        assert name in viewer.message and viewer.state is before
    Opener(viewer).dropped([])
    assert viewer.state is before


@pytest.mark.usefixtures("frame")
def test_the_buttons_dialog_is_asked_for_its_file_until_it_is_closed(
    viewer: Viewer, mesh: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    ready = [False, True]
    dialog = SimpleNamespace(ready=lambda _: ready.pop(0), result=lambda: [str(mesh)])
    asked: list[tuple[str, str, list[str]]] = []
    monkeypatch.setattr(opening.portable_file_dialogs, "open_file", lambda *words: asked.append(words) or dialog)
    monkeypatch.setattr(shutil, "which", lambda name: name if name == "zenity" else None)
    monkeypatch.setattr(opening.imgui, "button", lambda label: label == "open…")
    opener = Opener(viewer)
    opener.button()
    assert viewer.state.scene.name == "mine"
    opener.button()
    assert viewer.state.scene.name == "own" and len(asked) == 1 and "*.glb" in asked[0][2][1]


@pytest.mark.usefixtures("frame")
def test_without_a_program_that_shows_dialogs_the_button_says_what_to_do(
    viewer: Viewer, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sys, "platform", "linux")
    monkeypatch.setattr(shutil, "which", lambda name: None)
    monkeypatch.setattr(opening.imgui, "button", lambda label: label == "open…")
    Opener(viewer).button()
    assert viewer.message.startswith("no file dialog is installed (zenity, ") and "drop" in viewer.message


def test_the_command_opens_a_state_as_a_scene_and_a_mesh_from_a_side(
    shadowbench: Callable[..., Any], viewer: Viewer, mesh: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    shown: list[ViewerState] = []
    monkeypatch.setattr(view_command, "_window", lambda: lambda state, *_: shown.append(state))
    save_state(replace(viewer.state, overlay="mask", size=48), tmp_path / "state.toml")
    for words in (
        ["state.toml"],
        ["state.toml", "--camera", "top"],
        [mesh.name, "--camera", "left", "--lamp", "0,9,0"],
    ):
        answer = shadowbench("view", tmp_path / words[0], *words[1:])
        assert answer.code == 0, answer.err
    state, scene, own = shown
    assert (state.overlay, state.size) == ("mask", 48)
    assert (scene.overlay, scene.camera.name) == ("picture", "top")  # options read the file as any other scene
    assert (own.camera.name, own.light.name) == ("left", "lamp 0 9 0") and own.specs[0].text == "cube-map"
