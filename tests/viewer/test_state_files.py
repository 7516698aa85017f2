"""State files: every command takes them as a scene, and draws what was shown."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from shadowbench.errors import InputError
from shadowbench.gl.picture import Shading
from shadowbench.options import SceneOptions
from shadowbench.plugin.registry import techniques
from shadowbench.plugin.spec import parse_spec
from shadowbench.scenes.library import load_scene
from shadowbench.scenes.model import Light
from shadowbench.strict import read_toml
from shadowbench.studies.study import read_study
from shadowbench.viewer.navigation import orbited
from shadowbench.viewer.state import Origin, ViewerState
from shadowbench.viewer.state_files import adopted, append_to_study, ply_of, read_state, save_state, toml_of

KNOWN = techniques()


def shown(source: str, **others: object) -> ViewerState:
    scene = load_scene(source)
    spec = parse_spec("shadow-map:size=64,bias=constant(0.01)+normal-offset", KNOWN)
    return ViewerState(scene, scene.cameras[0], scene.lights[0], (spec,), 64, Origin(source), **others)  # type: ignore[arg-type]


def test_a_state_is_read_as_it_was_saved(tmp_path: Path) -> None:
    state = shown(
        "spot-lamp",
        phase=2,
        shading=Shading(ambient=0.5, sky=(0.1, 0.2, 0.3)),
        colors=(("wall", (1.0, 0.0, 0.25)),),
        shadows=False,
        layout="wipe",
        left="B",
        right="A",
        wipe=0.25,
        overlay="N·L",
    ).with_spec(1, parse_spec("shadow-volume", KNOWN))
    file = tmp_path / "state.toml"
    save_state(state, file)
    read = read_state(file, KNOWN)
    assert replace(read, scene=state.scene, origin=state.origin) == state
    assert np.array_equal(read.scene.geometry.vertices, state.scene.geometry.vertices)


@pytest.mark.parametrize("turn", [0.1, 0.7, 2.9])
def test_what_is_adopted_from_a_saved_file_is_what_it_says_to_the_bit(tmp_path: Path, turn: float) -> None:
    """Radians of a file's degrees may differ in their last bit from those that were saved."""
    sun = Light("light", "directional", (math.sin(turn), -1.0, 0.3), radius=turn / 100)
    state = shown("sphere-and-torus")
    moved = replace(state, camera=replace(orbited(state.camera, turn, 0.1), fov_y=turn / 3), light=sun)
    file = tmp_path / "state.toml"
    save_state(moved, file)
    kept = adopted(moved, file)
    assert (kept.camera, kept.light) == (load_scene(file).cameras[0], load_scene(file).lights[0])
    assert kept.camera.fov_y == pytest.approx(moved.camera.fov_y, rel=1e-15)


def test_a_state_of_a_file_that_has_changed_is_told(tmp_path: Path) -> None:
    (tmp_path / "mine.toml").write_text('[[mesh]]\nshape = "box"\n')
    state = shown(str(tmp_path / "mine.toml"))
    (tmp_path / "mine.toml").write_text('[[mesh]]\nshape = "sphere"\n')
    save_state(state, tmp_path / "state.toml")
    with pytest.raises(InputError, match="which is not what is shown; save it once more"):
        adopted(state, tmp_path / "state.toml")


@pytest.mark.parametrize("name", ["sphere-and-torus", "fence", "table-top"])
def test_a_scene_that_no_file_has_is_written_without_loss(tmp_path: Path, name: str) -> None:
    state = replace(shown(name), origin=None)
    file = tmp_path / "state.toml"
    save_state(state, file)
    read, before = load_scene(file).geometry, state.scene.geometry
    assert np.array_equal(read.vertices[read.faces], before.vertices[before.faces])
    for kind in ("casts", "receives", "planar", "colors"):
        assert np.array_equal(getattr(read, kind), getattr(before, kind))


def test_meshes_of_a_scenes_file_are_found_from_the_state(tmp_path: Path) -> None:
    (tmp_path / "scenes").mkdir()
    mesh = load_scene("post").meshes[0]
    (tmp_path / "scenes" / "mine.ply").write_bytes(ply_of([mesh]))
    file = tmp_path / "scenes" / "mine.toml"
    file.write_text('[[mesh]]\nfile = "mine.ply"\n[camera]\nposition = [3, 2, 4]\ntarget = [0, 0, 0]\n')
    state = shown(str(file))
    save_state(state, tmp_path / "state.toml")
    assert read_toml(tmp_path / "state.toml", "")["mesh"] == [{"file": "scenes/mine.ply"}]
    assert len(load_scene(tmp_path / "state.toml").meshes) == 1
    (tmp_path / "beside").mkdir()
    with pytest.raises(InputError, match=r"meshes must be in its folder, where mine\.ply is not; allowed: "):
        save_state(state, tmp_path / "beside" / "state.toml")


def test_masks_of_a_scenes_file_are_found_from_the_state(tmp_path: Path) -> None:
    (tmp_path / "scenes").mkdir()
    Image.fromarray(np.array([[0, 255]], np.uint8)).save(tmp_path / "scenes" / "leaf.png")
    table = {"shape": "plane", "mask": "leaf.png", "cutoff": 0.25, "mask_filter": "nearest"}
    (tmp_path / "scenes" / "mine.toml").write_text(toml_of({"mesh": [table]}))
    save_state(shown(str(tmp_path / "scenes" / "mine.toml")), tmp_path / "state.toml")
    assert read_toml(tmp_path / "state.toml", "")["mesh"] == [{**table, "mask": "scenes/leaf.png"}]
    cutout = load_scene(tmp_path / "state.toml").meshes[0].cutout
    assert cutout is not None and cutout.bits.tolist() == [[False, True]]


def test_a_mesh_file_that_is_cut_out_or_textured_is_named_by_the_state(tmp_path: Path) -> None:
    Image.fromarray(np.array([[0, 255]], np.uint8)).save(tmp_path / "leaf.png")
    faces = "v 0 0 0\nv 1 0 0\nv 0 0 1\nvt 0 0\nvt 1 0\nvt 0 1\nusemtl a\nf 1/1 2/2 3/3\n"
    obj = tmp_path / "leaf.obj"
    obj.write_text("mtllib leaf.mtl\n" + faces)
    for material, kind in (("map_d", "cutout"), ("map_Kd", "texture")):
        (tmp_path / "leaf.mtl").write_text(f"newmtl a\n{material} leaf.png\n")
        options = SceneOptions(up="z")
        scene = load_scene(obj, up="z")
        assert scene.ground is not None and getattr(scene.meshes[0], kind) is not None
        state = replace(shown(str(obj)), scene=scene, origin=Origin(str(obj), options))
        save_state(state, tmp_path / "state.toml")
        kept = load_scene(tmp_path / "state.toml")
        assert adopted(state, tmp_path / "state.toml"), "which compares the triangles"
        assert getattr(kept.meshes[0], kind) is not None
        assert np.array_equal(kept.meshes[0].coordinates, scene.meshes[0].coordinates)
        (tmp_path / "beside").mkdir(exist_ok=True)
        if kind == "cutout":
            with pytest.raises(InputError, match=r"meshes must be in its folder, where leaf\.obj is not"):
                save_state(state, tmp_path / "beside" / "state.toml")
        else:
            save_state(state, tmp_path / "beside" / "state.toml")


def test_cut_out_meshes_that_no_file_has_are_not_saved_as_opaque_ones(tmp_path: Path) -> None:
    file = tmp_path / "mine.toml"
    file.write_text('[[mesh]]\nshape = "foliage"\ncount = 3\n')
    with pytest.raises(InputError, match="meshes are cut out, which only a file of their own can say"):
        save_state(replace(shown(str(file)), origin=None), tmp_path / "state.toml")


@pytest.mark.parametrize(
    ("change", "told"),
    [
        ({"coordinates": "absolute"}, "absolute coordinates, which no scene file can say"),
        ({}, "found a name that ends with '.txt'; allowed: .toml"),
    ],
)
def test_what_cannot_be_saved_is_one_line(tmp_path: Path, change: dict[str, str], told: str) -> None:
    with pytest.raises(InputError, match=told):
        save_state(shown("post", **change), tmp_path / ("state.toml" if change else "state.txt"))
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("line", "told"),
    [
        ("size = 0", r"\[viewer\]: size: found 0"),
        ('layout = "three"', r"\[viewer\]: layout: found 'three'"),
        ("speed = 1", r"\[viewer\]: .*unknown field 'speed'"),
        ('techniques = ["nothing"]', "unknown technique 'nothing'"),
    ],
)
def test_an_invalid_table_is_one_line(tmp_path: Path, line: str, told: str) -> None:
    file = tmp_path / "state.toml"
    file.write_text(f'[viewer]\n{line}\n[[mesh]]\nshape = "plane"\n')
    load_scene(file)
    with pytest.raises(InputError, match=told):
        read_state(file, KNOWN)


def test_a_study_grows_by_the_spec_and_what_it_holds_stays_as_it_is_written(tmp_path: Path) -> None:
    """Comments, line ends, and a link to the file."""
    new, state = tmp_path / "new.toml", shown("post").with_spec(1, parse_spec("shadow-volume", KNOWN))
    for index in (0, 1):
        append_to_study(new, state, index, KNOWN)
    study = read_study(new, KNOWN)
    assert [spec.text for spec in study.specs] == [spec.text for spec in state.specs]
    assert study.scenes == ("post",)
    before = b'# mine\r\nscenes = ["post"] # one\r\n[[technique]]\r\nspec = "shadow-map" # the last line'
    (tmp_path / "real.toml").write_bytes(before)
    link = tmp_path / "study.toml"
    link.symlink_to("real.toml")
    append_to_study(link, state, 0, KNOWN)
    assert link.is_symlink() and link.read_bytes().startswith(before)
    assert len(read_study(link, KNOWN).specs) == 2


@pytest.mark.parametrize(
    ("text", "told"),
    [
        (
            'scenes = ["post"]\ntechnique = [{ spec = "shadow-map" }]\n',
            r"study\.toml: takes no further \[\[technique\]\]: it: not TOML",
        ),
        ("scenes = 3\n", "scenes"),
    ],
)
def test_a_study_that_takes_no_further_table_is_left_alone(tmp_path: Path, text: str, told: str) -> None:
    file = tmp_path / "study.toml"
    file.write_text(text)
    with pytest.raises(InputError, match=told):
        append_to_study(file, shown("post"), 0, KNOWN)
    assert file.read_text() == text and len(list(tmp_path.iterdir())) == 1


def test_a_new_study_measures_the_scene_that_is_shown(tmp_path: Path) -> None:
    model = tmp_path / "model.ply"
    model.write_bytes(ply_of(load_scene("post").meshes))
    state, study = shown(str(model)), tmp_path / "study.toml"
    append_to_study(study, replace(state, origin=Origin(str(model), SceneOptions(sun=True))), 0, KNOWN)
    assert read_study(study, KNOWN).sun
    turned = replace(state, origin=Origin(str(model), SceneOptions(up="z")))
    with pytest.raises(InputError, match=r"no study file can turn \(--up\) the scene 'model'; save the state"):
        append_to_study(tmp_path / "other.toml", turned, 0, KNOWN)
