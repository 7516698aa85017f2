"""The truth compared with brute force in float64: on built-in scenes, other meshes, and at every value of `stress`.

`make test-slow` asks the ends of each axis, `make test-all` every value.
"""

from collections.abc import Callable, Sequence
from typing import Any

import pytest

from shadowbench.extremes.axes import AXES
from shadowbench.scenes.library import load_scene
from shadowbench.scenes.model import Scene, view_of
from shadowbench.truths.trace import trace
from tests.samples import sampled

SAME_VIEW = {"depth-format", "map-size"}  # at every value: only parameters change
SOFT = {"light-size"}  # a share of the light per pixel: test_soft_closed_forms.py compares those with closed forms
MANY = 100_000  # triangles from which on fewer pixels are asked
PIXELS, FEWER_PIXELS = 2000, 200
walked = [(name, light) for name, axis in AXES.items() if name not in SAME_VIEW | SOFT for light in axis.lights]
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


def wrong_at(name: str, values: Sequence[float], light: Any, judged: Callable[..., Any]) -> dict[float, int]:
    """Number of wrong decided pixels, by axis value."""
    wrong = {}
    for value in values:
        views = AXES[name].at(value, light).views
        for view in dict.fromkeys([views[0], views[-1]]):
            many = len(view.scene.geometry.faces) > MANY
            found = judged(view, trace(view, pixel_samples=1), FEWER_PIXELS if many else PIXELS)
            if found.wrong:
                wrong[value] = found.wrong
    return wrong


@pytest.mark.slow
@pytest.mark.timeout(1200)
@pytest.mark.parametrize(("name", "light"), walked)
def test_no_decided_pixel_is_wrong_at_the_ends_of_the_axis(name, light, judged) -> None:
    values = AXES[name].values
    assert wrong_at(name, [values[0], values[-1]], light, judged) == {}


@pytest.mark.slow
@pytest.mark.exhaustive
@pytest.mark.timeout(1200)
@pytest.mark.parametrize(("name", "light"), walked)
def test_no_decided_pixel_is_wrong_within_the_axis(name, light, judged) -> None:
    assert wrong_at(name, AXES[name].values[1:-1], light, judged) == {}
