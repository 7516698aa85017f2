"""The truth compared with brute force in float64, on built-in scenes and on scanned and modelled meshes."""

from collections.abc import Callable
from typing import Any

import pytest

from shadowbench.scenes.library import load_scene
from shadowbench.scenes.model import Scene, view_of
from shadowbench.truths.trace import trace
from tests.samples import sampled

FILES = ["armadillo.obj", "retroufo.gltf", "2CylinderEngine.glb", "bgfx_tree.obj"]


def assert_agrees(scene: Scene, size: int, judged: Callable[..., Any]) -> None:
    view = view_of(scene, scene.cameras[0], scene.lights[0], size)
    found = judged(view, trace(view, pixel_samples=1), 3000)
    assert found.decided.mean() > 0.95
    assert (found.receiver & found.lit).sum() > 100
    assert (found.receiver & ~found.lit).sum() > 100
    assert found.wrong == 0


@pytest.mark.parametrize("name", ["spot-lamp", "railings"])
def test_builtin_agrees_with_every_triangle_against_every_ray(name, judged) -> None:
    assert_agrees(load_scene(name), 512, judged)


@pytest.mark.slow
def test_armadillo_agrees_with_every_triangle_against_every_ray(shared_scenes, judged) -> None:
    assert_agrees(load_scene(shared_scenes / "armadillo.obj"), 256, judged)


@pytest.mark.slow
@pytest.mark.parametrize("file", sampled(FILES, ["2CylinderEngine.glb", "bgfx_tree.obj"]))
def test_mesh_agrees_with_every_triangle_against_every_ray(file, shared_scenes, judged) -> None:
    assert_agrees(load_scene(shared_scenes / file), 1024, judged)
