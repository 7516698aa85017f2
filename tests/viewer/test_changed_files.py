"""What is noticed of files that change on disk: scene files and their meshes are loaded again, what was moved stays."""

import os
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from shadowbench.scenes.library import load_scene
from shadowbench.scenes.model import SUN_RADIUS
from shadowbench.viewer import changed_files
from shadowbench.viewer.app import Viewer
from shadowbench.viewer.changed_files import ChangedFiles, Changes
from shadowbench.viewer.navigation import orbited
from shadowbench.viewer.state_files import ply_of


def test_a_plug_ins_python_and_its_shader_are_told_apart(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(changed_files, "EVERY_S", 0.0)
    plugin, shader = tmp_path / "mine.py", tmp_path / "mine.frag"
    for file in (plugin, shader):
        file.write_text("")
        os.utime(file, ns=(1, 1))
    files = ChangedFiles(None, [plugin])
    assert files.changed() == Changes()
    os.utime(shader, ns=(2, 2))
    assert files.changed() == Changes(shaders=True)
    os.utime(plugin, ns=(2, 2))
    assert files.changed() == Changes(plugins=(plugin,))
    assert files.changed() == Changes()


def test_a_changed_scene_file_is_loaded_and_nonsense_is_told(
    viewer: Viewer, clock: Any, settle: Callable[[Viewer], None]
) -> None:
    settle(viewer)
    file = Path(str(viewer.state.origin and viewer.state.origin.source))
    text = file.read_text()
    moved = orbited(viewer.state.camera, 0.2, 0.0)
    viewer.change(replace(viewer.state, camera=moved))
    file.write_text(text.replace("0.5, -1.0", "0.1, -1.0").replace("box", "sphere"))
    viewer.step()
    assert viewer.state.scene.meshes[1].name == "sphere"
    assert viewer.state.camera == moved, "where it was moved to"
    assert viewer.state.light.direction[0] == 0.1, "as it was not moved"
    file.write_text("[[mesh]\n")
    viewer.step()
    assert "mine.toml: not TOML" in viewer.message
    viewer.message = ""
    file.write_text(text)
    viewer.step()
    assert viewer.state.scene.meshes[1].name == "box"
    assert viewer.message.endswith("was loaded again")


def test_a_light_that_was_chosen_and_not_moved_follows_its_file(viewer: Viewer, clock: Any) -> None:
    origin = viewer.state.origin
    assert origin is not None
    file, text = Path(origin.source), Path(origin.source).read_text()
    lamp = '[[light]]\nname = "lamp"\nkind = "point"\nposition = [0.0, 3.0, {}]\n[[mesh]]'
    file.write_text(text.replace("[[mesh]]", lamp.format(0), 1))
    viewer.step()
    viewer.change(replace(viewer.state, light=viewer.state.scene.lights[1]))
    file.write_text(text.replace("[[mesh]]", lamp.format(1), 1))
    viewer.step()
    assert viewer.state.light.position == (0.0, 3.0, 1.0)
    file.write_text(text)
    viewer.step()
    assert viewer.state.light == viewer.state.scene.lights[0], "there is no lamp any longer"


def test_undo_does_not_return_to_what_a_file_said_before(viewer: Viewer, clock: Any) -> None:
    """A saved state would be of another scene than the one on screen."""
    origin, wipe = viewer.state.origin, viewer.state.wipe
    assert origin is not None
    viewer.change(replace(viewer.state, wipe=0.1))
    file = Path(origin.source)
    file.write_text(file.read_text().replace("box", "sphere").replace("3.0, 3.0, 4.0", "2.0, 3.0, 4.0"))
    viewer.step()
    viewer.undo()
    assert viewer.state.wipe == wipe
    assert viewer.state.scene.meshes[1].name == "sphere" and viewer.state.camera.position[0] == 2.0


def test_a_changed_mesh_of_a_scenes_file_is_loaded(viewer: Viewer, clock: Any, tmp_path: Path) -> None:
    (tmp_path / "own.ply").write_bytes(ply_of(load_scene("post").meshes[:1]))
    file = tmp_path / "mine.toml"
    file.write_text(file.read_text() + '[[mesh]]\nfile = "own.ply"\n')
    viewer.step()
    before = len(viewer.state.scene.geometry.faces)
    (tmp_path / "own.ply").write_bytes(ply_of(load_scene("post").meshes))
    viewer.step()
    assert len(viewer.state.scene.geometry.faces) > before


def test_a_sun_keeps_its_size_when_its_file_is_read_again(viewer: Viewer, clock: Any) -> None:
    origin = replace(viewer.state.origin, sun=True)  # type: ignore[type-var]
    scene = origin.load()
    viewer.change(replace(viewer.state, scene=scene, light=scene.lights[0], origin=origin))
    file = Path(origin.source)
    file.write_text(file.read_text().replace("0.5, -1.0", "0.1, -1.0"))
    viewer.step()
    assert viewer.state.light.direction[0] == 0.1
    assert viewer.state.light.radius == SUN_RADIUS
