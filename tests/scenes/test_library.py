"""The built-in scenes, and how scenes are found by name."""

from pathlib import Path

import numpy as np
import pytest

from shadowbench.errors import InputError
from shadowbench.files import data_folder
from shadowbench.scenes.library import builtin_about, builtin_names, hard_names, load_scene
from shadowbench.scenes.model import view_of
from shadowbench.studies.catalogue import catalogue
from tests.scenes.conftest import refused


def test_built_in_scenes_have_descriptions_that_differ() -> None:
    names = builtin_names()
    assert len(names) >= 12 and names == sorted(names)
    assert len({builtin_about(name) for name in names} - {""}) == len(names)


@pytest.mark.parametrize("name", builtin_names())
def test_a_built_in_scene_is_whole(name: str) -> None:
    scene = load_scene(name)
    assert scene.name == name
    assert not scene.notes, "nothing assumed or left out"
    assert scene.dropped == 0
    assert 10 <= len(scene.geometry.faces) <= 100_000
    assert len({mesh.name for mesh in scene.meshes}) == len(scene.meshes)
    assert np.isfinite(scene.geometry.normals).all()
    for camera in scene.cameras:
        near, far = view_of(scene, camera, scene.lights[0], 64).near_far
        assert 0 < near < far


@pytest.mark.parametrize("name", builtin_names())
def test_no_large_face_lies_along_the_light(name: str) -> None:
    """With N·L = 0 the truth would depend on rounding."""
    scene = load_scene(name)
    geometry = scene.geometry
    a, b, c = (geometry.vertices[geometry.faces[:, k]] for k in range(3))
    area = np.linalg.norm(np.cross(b - a, c - a), axis=1)
    large = area > 0.01 * area.sum()
    for light in scene.lights:
        xyz, w = light.homogeneous
        towards = np.array(xyz) - ((a + b + c) / 3 if w else 0.0)
        towards = np.broadcast_to(towards, a.shape) / np.linalg.norm(towards, axis=-1, keepdims=True)
        slope = np.abs(np.einsum("ij,ij->i", geometry.normals, towards))
        assert slope[large].min(initial=1.0) > 0.02


def test_the_kinds_of_light_are_all_there() -> None:
    kinds = {light.kind for name in builtin_names() for light in load_scene(name).lights}
    assert kinds == {"directional", "spot", "point", "rectangle"}


def test_a_scene_is_hard_if_no_light_of_it_has_a_size() -> None:
    soft = set(builtin_names()) - set(hard_names())
    assert soft == {name for name in builtin_names() if any(light.soft for light in load_scene(name).lights)}
    assert len(soft) >= 6


@pytest.mark.parametrize("name", sorted(set(builtin_names()) - set(hard_names())))
def test_a_soft_scene_shows_its_penumbra(name: str, truth_of) -> None:
    """Under a fifth of the picture, so that truths take seconds; the window's fills what is there."""
    truth = truth_of(name, 128)
    penumbra = (truth.receivers & (truth.visibility > 0.02) & (truth.visibility < 0.98)).mean()
    assert 0.02 < penumbra < (0.4 if name == "window" else 0.22)


def test_a_built_in_scene_is_also_a_file() -> None:
    path = data_folder("scenes") / "cube-on-plane.toml"
    assert load_scene(path).name == load_scene(str(path)).name == load_scene("cube-on-plane").name


def test_the_cube_touches_its_plane() -> None:
    scene = load_scene("cube-on-plane")
    plane, cube = scene.meshes
    assert cube.vertices[:, 1].min() == plane.vertices[:, 1].max() == 0


@pytest.mark.parametrize("reference", ["cube-on-plan", "cubeonplane", "Cube-On-Plane"])
def test_a_near_miss_is_named(reference: str) -> None:
    refused(reference, "did you mean 'cube-on-plane'?", "canopy")


LONG = "a" * 300


@pytest.mark.parametrize(
    "reference",
    ["", "zzz", "a.fbx", "no/such", "no/such.toml", "gone.obj", "a\0b", "..", "x" * 5000, "/" * 5000]
    + [LONG + suffix for suffix in ("", ".toml", ".obj", ".x")],
)
def test_an_invalid_scene_argument_is_one_line(reference: str) -> None:
    refused(reference)


def test_assets_must_be_a_folder(tmp_path: Path) -> None:
    refused(tmp_path / "a.toml", "--assets", assets=tmp_path / "none")
    with pytest.raises(InputError, match="no built-in scene"):
        builtin_about("none")


def test_the_list_of_scenes_has_the_kind_of_light() -> None:
    lights = {entry["name"]: entry["light"] for entry in catalogue(what="scenes")["scenes"]}
    assert (lights["fence"], lights["street"]) == ("directional, soft", "directional")
    assert (lights["spot-lamp"], lights["shade"]) == ("spot", "point, soft")
