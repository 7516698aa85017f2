"""Growth of times and memory of techniques, and of the truth, with the number of triangles and with the view size.

pytest benchmarks/test_scaling.py -k "triangles and shadow-volume"
"""

from collections.abc import Callable
from functools import lru_cache
from itertools import product
from typing import Any

import pytest
from pytest_benchmark.fixture import BenchmarkFixture

from shadowbench.plugin.registry import techniques
from shadowbench.scenes.library import load_scene
from shadowbench.scenes.model import Scene, View, view_of
from shadowbench.truths.trace import trace

# Number of triangles: (number of spheres, subdivisions of each). A million triangles take three spheres.
SPHERES = {1_280: (1, 3), 20_480: (1, 5), 983_040: (3, 7)}
VIEWS = (256, 512, 1024)
NAMES = (*techniques(), "ray-traced:where=gpu")
TRIANGLES, VIEW = 20_480, 512  # while the other is varied

SCENE = """
name = "spheres-{triangles}"
[camera]
position = [3.2, 2.6, 4.0]
target = [0.0, 0.5, 0.0]
fov_y = 36
[[light]]
name = "sun"
kind = "directional"
direction = [0.8, -1.0, -0.6]
[[light]]
name = "lamp"
kind = "point"
position = [-2.0, 2.5, 1.5]
[[mesh]]
shape = "plane"
scale = 6
[[mesh]]
shape = "sphere"
subdivisions = {subdivisions}
translate = [{first}, 0.6, 0.0]
repeat = {{ count = {count}, step = [{step}, 0.0, 0.0] }}
"""


@pytest.fixture(scope="module")
def scene(tmp_path_factory: pytest.TempPathFactory) -> Callable[[int], Scene]:
    """Makes a scene with a number of triangles."""

    @lru_cache(1)
    def make(triangles: int) -> Scene:
        count, subdivisions = SPHERES[triangles]
        file = tmp_path_factory.mktemp("scenes") / f"{triangles}.toml"
        step = 2.2 / max(count - 1, 2)  # of spheres that overlap if they are many, so that the view has all of them
        places = {"count": count, "step": step, "first": -0.5 * step * (count - 1)}
        file.write_text(SCENE.format(triangles=triangles, subdivisions=subdivisions, **places))
        return load_scene(file)

    return make


def _light(name: str) -> str:
    """The sun if the technique supports it, else the lamp."""
    return "sun" if "directional" in techniques()[name.partition(":")[0]].lights else "lamp"


@pytest.mark.parametrize(("triangles", "name"), [*product(SPHERES, NAMES)])
@pytest.mark.benchmark(group="triangles")
def test_triangles(
    triangles: int,
    name: str,
    scene: Callable[[int], Scene],
    growth: Any,
    shadow_benchmark: Callable[..., Any],
    benchmark: BenchmarkFixture,
) -> None:
    shadow_benchmark(name, scene=scene(triangles), view_size=VIEW, light=_light(name))
    growth.add_cell(f"{name} over triangles", triangles, benchmark)


@pytest.mark.parametrize(("size", "name"), [*product(VIEWS, NAMES)])
@pytest.mark.benchmark(group="view size")
def test_view_size(
    size: int,
    name: str,
    scene: Callable[[int], Scene],
    growth: Any,
    shadow_benchmark: Callable[..., Any],
    benchmark: BenchmarkFixture,
) -> None:
    shadow_benchmark(name, scene=scene(TRIANGLES), view_size=size, light=_light(name))
    growth.add_cell(f"{name} over pixels", size**2, benchmark)


def _sunlit(scene: Scene, size: int) -> View:
    return view_of(scene, scene.cameras[0], scene.lights[0], size)


@pytest.mark.parametrize("triangles", SPHERES)
@pytest.mark.benchmark(group="truth: triangles")
def test_truth_triangles(
    triangles: int, scene: Callable[[int], Scene], growth: Any, benchmark: BenchmarkFixture
) -> None:
    benchmark.pedantic(trace, args=(_sunlit(scene(triangles), VIEW), 1), rounds=3)
    growth.add("truth over triangles", triangles, benchmark)


@pytest.mark.parametrize("size", VIEWS)
@pytest.mark.benchmark(group="truth: view size")
def test_truth_view_size(size: int, scene: Callable[[int], Scene], growth: Any, benchmark: BenchmarkFixture) -> None:
    benchmark.pedantic(trace, args=(_sunlit(scene(TRIANGLES), size), 1), rounds=3)
    growth.add("truth over pixels", size**2, benchmark)
