"""Saved states, which every command takes as a scene and draws as they were shown; cells of run folders."""

import json
import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from shadowbench.errors import InputError
from shadowbench.gl.device import Device
from shadowbench.options import SceneOptions, ViewSize
from shadowbench.plugin.registry import techniques
from shadowbench.plugin.spec import parse_spec
from shadowbench.scenes.library import load_scene
from shadowbench.scenes.model import Light
from shadowbench.scores.masks import mask_sha256
from shadowbench.strict import read_toml
from shadowbench.viewer.camera import orbited
from shadowbench.viewer.drawing import Drawing
from shadowbench.viewer.state import Origin, ViewerState, cell_state, read_state, save_state

KNOWN = techniques()
LEAF = "mtllib leaf.mtl\nv 0 0 0\nv 1 0 0\nv 0 0 1\nvt 0 0\nvt 1 0\nvt 0 1\nusemtl a\nf 1/1 2/2 3/3\n"
MINE = """
[[mesh]]
shape = "plane"
mask = "leaf.png"
cutoff = 0.25
[[sequence]]
name = "past"
key = [{ time = 1.0, camera = { position = [1, 2, 3] } }]
"""


def shown(source: str, options: SceneOptions | None = None, **others: Any) -> ViewerState:
    origin = Origin(source, options or SceneOptions())
    scene, spec = origin.load(), parse_spec("shadow-map:size=64,bias=constant(0.01)+normal-offset", KNOWN)
    return replace(ViewerState(scene, scene.cameras[0], scene.lights[0], (spec,), ViewSize(64, 36), origin), **others)


def test_what_is_shown_after_saving_is_read_to_the_bit(tmp_path: Path) -> None:
    """Radians of a file's degrees may differ in their last bit from those that were saved."""
    turn = 0.7
    others = {"phase": 2, "layout": "side by side", "left": "B", "right": "A", "wipe": 0.25, "overlay": "mask"}
    sun = Light("light", "directional", (math.sin(turn), -1.0, 0.3), radius=turn / 100)
    state = shown("sphere-and-torus", light=sun, **others).with_spec(1, parse_spec("shadow-volume", KNOWN))
    moved = replace(state, camera=replace(orbited(state.camera, turn, 0.1), fov_y=turn / 3))
    kept, read = save_state(moved, tmp_path / "state.toml"), read_state(tmp_path / "state.toml", KNOWN)
    assert replace(read, scene=state.scene, origin=state.origin) == kept
    assert replace(kept, camera=moved.camera, light=sun) == moved
    assert kept.camera.fov_y == pytest.approx(moved.camera.fov_y, rel=1e-15)
    isometric = replace(state, camera=replace(state.camera, fov_y=0.0, height=turn))
    save_state(isometric, tmp_path / "state.toml")
    assert read_state(tmp_path / "state.toml", KNOWN).camera == isometric.camera
    assert np.array_equal(read.scene.geometry.vertices, state.scene.geometry.vertices)


def test_meshes_masks_and_sequences_of_a_scenes_file_are_found_from_the_state(tmp_path: Path) -> None:
    folder = tmp_path / "scenes"
    folder.mkdir()
    Image.fromarray(np.array([[0, 255]], np.uint8)).save(folder / "leaf.png")
    (folder / "mine.toml").write_text(MINE)
    state = shown(str(folder / "mine.toml"))
    save_state(state, tmp_path / "state.toml")
    assert read_toml(tmp_path / "state.toml", "")["mesh"][0]["mask"] == "scenes/leaf.png"
    assert [motion.name for motion in load_scene(tmp_path / "state.toml").motions] == ["past"]
    ours, theirs = (scene.meshes[0].cutout for scene in (state.scene, load_scene(tmp_path / "state.toml")))
    assert ours is not None and theirs is not None and np.array_equal(ours.bits, theirs.bits)
    (tmp_path / "beside").mkdir()
    with pytest.raises(InputError, match=r"meshes must be in its folder, where leaf\.png is not; allowed: "):
        save_state(state, tmp_path / "beside" / "state.toml")


@pytest.mark.parametrize("up", ["y", "z"])
def test_a_mesh_file_is_named_by_the_state_beside_the_assumed_ground(tmp_path: Path, up: str) -> None:
    Image.fromarray(np.array([[0, 255]], np.uint8)).save(tmp_path / "leaf.png")
    (tmp_path / "leaf.mtl").write_text("newmtl a\nmap_d leaf.png\n")
    (tmp_path / "leaf.obj").write_text(LEAF)
    state = shown(str(tmp_path / "leaf.obj"), SceneOptions(up=up))
    assert state.scene.ground is not None
    save_state(state, tmp_path / "state.toml")
    saved, before = load_scene(tmp_path / "state.toml"), state.scene
    for name in ("corners", "casts", "receives", "colors"):
        ours, theirs = (
            scene.geometry.vertices[scene.geometry.faces] if name == "corners" else getattr(scene.geometry, name)
            for scene in (before, saved)
        )
        assert np.array_equal(ours, theirs), name
    assert saved.meshes[0].cutout is not None


def test_what_cannot_be_saved_is_one_line(tmp_path: Path) -> None:
    for change, name, message in (
        ({"coordinates": "absolute"}, "state.toml", "absolute coordinates, are not for a scene file"),
        ({"origin": None}, "state.toml", "the scene of a sweep"),
        ({}, "state.txt", "found a name that ends with '.txt'; allowed: .toml"),
    ):
        with pytest.raises(InputError, match=message):
            save_state(shown("post", **change), tmp_path / name)
    assert not list(tmp_path.iterdir())


def test_an_invalid_table_is_one_line(tmp_path: Path) -> None:
    file = tmp_path / "state.toml"
    for line, message in (
        ("size = 0", r"\[viewer\]: size: found 0"),
        ("speed = 1", r"\[viewer\]: .*unknown field 'speed'"),
        ('techniques = ["nothing"]', "unknown technique 'nothing'"),
    ):
        file.write_text(f'[viewer]\n{line}\n[[mesh]]\nshape = "plane"\n')
        with pytest.raises(InputError, match=message):
            read_state(file, KNOWN)


def rows_of(folder: Path) -> list[dict[str, Any]]:
    rows = [json.loads(line) for line in (folder / "rows.jsonl").read_text().splitlines()]
    return [row for row in rows if row["kind"] == "score" and row["status"] == "ok"]


@pytest.mark.slow
def test_cells_of_runs_and_of_a_sweep_are_redrawn_to_the_bit(
    shadowbench: Callable[..., object], device: Device, tmp_path: Path
) -> None:
    """In two phases, with the up axis and the sun of a run, of a sequence, and at values of an axis."""
    run, own, pan, sweep, mesh = (tmp_path / name for name in ("run", "own", "pan", "stress", "model.obj"))
    mesh.write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n")
    study, low = tmp_path / "study.toml", '{ name = "low", position = [0, 1, 5], target = [0, 0, 0] }'
    study.write_text(f'scenes = ["stairs"]\nphases = 2\nviews = ["file", {low}]\n[[technique]]\nspec = "shadow-map"\n')
    little = ["--map-size", "64", "--view-size", "64", "--rounds", "0", "--quiet"]
    shadowbench("run", "-s", study, "-o", run, *little)
    shadowbench("run", mesh, "-t", "shadow-map", "--up", "z", "--sun", "-o", own, *little)
    shadowbench("run", "post", "-t", "shadow-map", "--sequence", "pan", "--frames", "2", "-o", pan, *little)
    shadowbench("stress", "-t", "shadow-map:size=64", "--axis", "distance-absolute", "--quick", "-o", sweep, "--quiet")
    cells = [(folder, row) for folder in (run, own, pan, sweep) for row in rows_of(folder)[:4] if row["view"] != "low"]
    assert {row["coordinates"] for _, row in cells} == {"relative", "absolute"} and len(cells) >= 7
    drawing = Drawing(device)
    for folder, row in cells:
        state = cell_state(folder, row["key"][:20], KNOWN)
        assert (state.scene.name, state.sequence) == (row["scene"], "pan" if folder == pan else "")
        drawn = drawing.draw(state, state.size)
        assert mask_sha256(drawn.visibility(drawn.masks[0])) == row["mask_sha256"]
        drawn.frame.surface.release()
    drawing.release()
    (moved, _) = (row["key"] for row in rows_of(run) if row["view"] == "low")
    for folder, key, message in (
        (run, moved, r"is of a camera or a light of its study, .*: view: found 'low'"),
        (run, "xyz", "--cell 'xyz': no such cell in"),
        (run, "", "--cell '': 4 cells begin so in"),
        (tmp_path / "nothing", "a", r"rows\.jsonl"),
    ):
        with pytest.raises(InputError, match=message):
            cell_state(folder, key, KNOWN)
