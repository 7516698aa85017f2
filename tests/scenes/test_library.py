"""The built-in scenes, and how scenes are found by name."""

from pathlib import Path

import numpy as np
import pytest

from shadowbench.errors import InputError
from shadowbench.scenes.library import builtin_about, builtin_names, load_scene
from shadowbench.scenes.model import view_of
from tests.scenes.conftest import refused


def test_a_built_in_scene_is_whole() -> None:
    for name in builtin_names():
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


def test_a_near_miss_is_named() -> None:
    for reference in ("cube-on-plan", "cubeonplane", "Cube-On-Plane"):
        refused(reference, "did you mean 'cube-on-plane'?", "canopy")


LONG = "a" * 300


def test_an_invalid_scene_argument_is_one_line() -> None:
    for reference in [
        "",
        "zzz",
        "a.fbx",
        "no/such",
        "no/such.toml",
        "gone.obj",
        "a\0b",
        "..",
        "x" * 5000,
        "/" * 5000,
    ] + [LONG + suffix for suffix in ("", ".toml", ".obj", ".x")]:
        refused(reference)


def test_assets_must_be_a_folder(tmp_path: Path) -> None:
    refused(tmp_path / "a.toml", "--assets", assets=tmp_path / "none")
    with pytest.raises(InputError, match="no built-in scene"):
        builtin_about("none")
