"""The truth compared with brute force in float64: on built-in scenes, other meshes, sequences, and along `stress`.

`make test-slow` compares the ends of each axis, under one kind of light each.
"""

from collections.abc import Callable
from typing import Any

import pytest

from shadowbench.extremes.axes import AXES
from shadowbench.scenes.library import load_scene
from shadowbench.scenes.model import View, view_of
from shadowbench.scenes.sequences import BUILT_IN, frames_of
from shadowbench.truths.cache import cached_truth
from shadowbench.truths.trace import trace
from tests.parallel import parallel
from tests.samples import daily, sampled

SAME_VIEW = {"depth-format", "map-size"}  # at every value: only parameters change
SOFT = {"light-size"}  # a share of the light per pixel: test_soft_closed_forms.py compares those with closed forms
SCENES = ["inside-volume", "lamp-by-wall", "railings", "spot-lamp", "stairs"]
MANY = 100_000  # triangles from which on fewer pixels are compared
PIXELS, FEWER_PIXELS = 2000, 200
WALKED = [
    (name, axis.lights[number % len(axis.lights)])
    for number, (name, axis) in enumerate(AXES.items())
    if name not in SAME_VIEW | SOFT
]

IN_MOTION = [
    (name, sequence) for sequence in BUILT_IN if sequence != "walker" for name in ("railings", "stairs", "walker")
] + [("crowd", "walker"), ("walker", "walker")]


def assert_agrees(view: View, judged: Callable[..., Any]) -> None:
    against = judged(view, trace(view, pixel_samples=1), 3000)
    assert against.decided.mean() > 0.95
    assert (against.receiver & against.lit).sum() > 100
    assert (against.receiver & ~against.lit).sum() > 100
    assert against.wrong == 0


@pytest.mark.parametrize("name", ["spot-lamp", "railings"])
def test_builtin_agrees_with_every_triangle_against_every_ray(name, judged) -> None:
    scene = load_scene(name)
    assert_agrees(view_of(scene, scene.cameras[0], scene.lights[0], 512), judged)


@pytest.mark.parametrize("name", SCENES)
def test_orthographic_view_agrees_with_every_triangle_against_every_ray(name, judged) -> None:
    assert_agrees(parallel(load_scene(name), 256), judged)


@pytest.mark.parametrize(("name", "size"), [("stairs", "400x225"), ("spot-lamp", "150x400")])
def test_rectangle_agrees_with_every_triangle_against_every_ray(name, size, judged) -> None:
    scene = load_scene(name)
    assert_agrees(view_of(scene, scene.cameras[0], scene.lights[0], size), judged)
    assert_agrees(parallel(scene, size), judged)


@pytest.mark.slow
@pytest.mark.parametrize(("name", "sequence"), daily(IN_MOTION, 4))
def test_all_frames_of_a_sequence_agree_with_every_triangle_against_every_ray(name, sequence, judged) -> None:
    """Truths as a run reads them: traced frame by frame, kept, and read again."""
    scene = load_scene(name)
    frames = frames_of(view_of(scene, scene.cameras[0], scene.lights[0], 256), BUILT_IN[sequence], 24)
    for frame in frames:
        cached_truth(frame, 1)
    against = [judged(frame, cached_truth(frame, 1), 500) for frame in frames]
    assert [each.wrong for each in against] == [0] * len(frames)
    assert min((each.receiver & ~each.lit).sum() for each in against) > 25


@pytest.mark.slow
@pytest.mark.parametrize("name", sampled(SCENES, ["lamp-by-wall", "spot-lamp", "stairs"]))
def test_a_screen_agrees_with_every_triangle_against_every_ray(name, judged) -> None:
    scene = load_scene(name)
    assert_agrees(view_of(scene, scene.cameras[0], scene.lights[0], "1280x720"), judged)
    assert_agrees(parallel(scene, "1280x720"), judged)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("file", "size"), [("armadillo.obj", 256), ("2CylinderEngine.glb", 1024), ("bgfx_tree.obj", 1024)]
)
def test_mesh_agrees_with_every_triangle_against_every_ray(file, size, shared_scenes, judged) -> None:
    scene = load_scene(shared_scenes / file)
    assert_agrees(view_of(scene, scene.cameras[0], scene.lights[0], size), judged)
    assert_agrees(parallel(scene, size), judged)


@pytest.mark.slow
@pytest.mark.timeout(1200)
@pytest.mark.parametrize(("name", "light"), daily(WALKED, 3))
def test_no_decided_pixel_is_wrong_at_the_ends_of_the_axis(name, light, judged) -> None:
    axis = AXES[name]
    for value in (axis.values[0], axis.values[-1]):
        views = axis.at(value, light).views
        for view in dict.fromkeys([views[0], views[-1]]):
            many = len(view.scene.geometry.faces) > MANY
            assert judged(view, trace(view, pixel_samples=1), FEWER_PIXELS if many else PIXELS).wrong == 0, value
