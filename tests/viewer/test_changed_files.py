"""What is noticed of files that change on disk: scene files and their meshes are loaded again, what was moved stays."""

import os
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from shadowbench.options import SceneOptions
from shadowbench.scenes.library import load_scene
from shadowbench.scenes.model import SUN_RADIUS
from shadowbench.viewer.app import Viewer
from shadowbench.viewer.navigation import orbited
from shadowbench.viewer.state_files import ply_of

Edit = Callable[..., None]
LAMP = '[[light]]\nname = "lamp"\nkind = "point"\nposition = [0.0, 3.0, {}]\n[[mesh]]'


@pytest.fixture
def edit(viewer: Viewer, clock: Any) -> Edit:
    """Writes the scene's file with some of its text replaced, and lets the window notice."""
    file = viewer.state.origin.file  # type: ignore[union-attr]
    text = file.read_text()

    def edited(*replaced: tuple[str, str]) -> None:
        new = text
        for old, other in replaced:
            new = new.replace(old, other, 1)
        file.write_text(new)
        viewer.step()

    return edited


def test_a_plug_ins_python_and_its_shader_are_told_apart(viewer: Viewer, clock: Any, tmp_path: Path) -> None:
    plugin, shader = tmp_path / "plugin.py", tmp_path / "mine.frag"
    for file in (plugin, shader):
        file.write_text("")
    viewer.step()
    viewer.step()
    drawn, viewer.message = viewer.drawn, ""
    os.utime(plugin, ns=(2, 2))
    viewer.step()
    assert viewer.message.startswith(f"{plugin} has changed") and viewer.drawn is drawn
    os.utime(shader, ns=(2, 2))
    viewer.step()
    assert viewer.drawn is not drawn


def test_a_changed_scene_file_is_loaded_and_nonsense_is_told(viewer: Viewer, edit: Edit) -> None:
    viewer.step()
    moved = orbited(viewer.state.camera, 0.2, 0.0)
    viewer.change(replace(viewer.state, camera=moved))
    edit(("0.5, -1.0", "0.1, -1.0"), ("box", "sphere"))
    assert viewer.state.scene.meshes[1].name == "sphere"
    assert viewer.state.camera == moved, "where it was moved to"
    assert viewer.state.light.direction[0] == 0.1, "as it was not moved"
    edit(("[[mesh]]", "[[mesh]"))
    assert "mine.toml: not TOML" in viewer.message
    edit()
    assert viewer.state.scene.meshes[1].name == "box"
    assert viewer.message.endswith("was loaded again")


def test_a_light_that_was_chosen_and_not_moved_follows_its_file(viewer: Viewer, edit: Edit) -> None:
    edit(("[[mesh]]", LAMP.format(0)))
    viewer.change(replace(viewer.state, light=viewer.state.scene.lights[1]))
    edit(("[[mesh]]", LAMP.format(1)))
    assert viewer.state.light.position == (0.0, 3.0, 1.0)
    edit()
    assert viewer.state.light == viewer.state.scene.lights[0], "there is no lamp any longer"


def test_undo_does_not_return_to_what_a_file_said_before(viewer: Viewer, edit: Edit) -> None:
    """A saved state would be of another scene than the one on screen."""
    wipe = viewer.state.wipe
    viewer.change(replace(viewer.state, wipe=0.1))
    edit(("box", "sphere"), ("3.0, 3.0, 4.0", "2.0, 3.0, 4.0"))
    viewer.undo()
    assert viewer.state.wipe == wipe
    assert viewer.state.scene.meshes[1].name == "sphere" and viewer.state.camera.position[0] == 2.0


def test_a_changed_mesh_of_a_scenes_file_is_loaded(viewer: Viewer, edit: Edit, tmp_path: Path) -> None:
    (tmp_path / "own.ply").write_bytes(ply_of(load_scene("post").meshes[:1]))
    edit(("[[mesh]]", '[[mesh]]\nfile = "own.ply"\n[[mesh]]'))
    before = len(viewer.state.scene.geometry.faces)
    (tmp_path / "own.ply").write_bytes(ply_of(load_scene("post").meshes))
    viewer.step()
    assert len(viewer.state.scene.geometry.faces) > before


def test_a_sun_keeps_its_size_when_its_file_is_read_again(viewer: Viewer, edit: Edit) -> None:
    origin = replace(viewer.state.origin, options=SceneOptions(sun=True))  # type: ignore[type-var]
    scene = origin.load()
    viewer.change(replace(viewer.state, scene=scene, light=scene.lights[0], origin=origin))
    edit(("0.5, -1.0", "0.1, -1.0"))
    assert (viewer.state.light.direction[0], viewer.state.light.radius) == (0.1, SUN_RADIUS)
