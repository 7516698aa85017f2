"""Soft shadows from many points of the light: `light-samples`, and `ray-traced` with samples."""

import math
from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest

from shadowbench.plugin.registry import techniques
from shadowbench.plugin.spec import parse_spec
from shadowbench.scenes.model import View, view_of
from shadowbench.scenes.vectors import unit
from shadowbench.techniques.light_samples import light_points
from shadowbench.truths.trace import Truth, trace

SIZE = 96
SIZED = {  # built-in scenes under lights with a size
    "sun": ("cube-on-plane", {"radius": math.radians(3.0)}),
    "spot": ("spot-lamp", {"radius": 0.15}),
    "point": ("room-with-lamp", {"radius": 0.1}),
    "disc": ("spot-lamp", {"kind": "disc", "radius": 0.3}),
    "rectangle": ("spot-lamp", {"kind": "rectangle", "size": (1.0, 0.5), "up": (0.3, 0.2, -1.0)}),
}


@pytest.fixture(scope="module")
def sized(builtin):
    """The view of a scene under a light with a size, and its truth."""

    @lru_cache
    def make(name: str) -> tuple[View, Truth]:
        scene, changes = SIZED[name]
        view = builtin(scene, SIZE)
        view = view_of(view.scene, view.camera, replace(view.light, **changes), SIZE)
        return view, trace(view, 1)

    return make


def errors(mask: np.ndarray, truth: Truth) -> np.ndarray:
    """Of the pixels in the penumbra."""
    penumbra = truth.receivers & ~truth.undecided & (truth.visibility > 0.02) & (truth.visibility < 0.98)
    assert penumbra.sum() > 100
    return (mask - truth.visibility)[penumbra]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("spec", "name"),
    [*(("ray-traced:samples={}", name) for name in SIZED), ("light-samples:of=ray-traced,n={}", "rectangle")],
)
def test_the_error_falls_as_fast_as_that_of_random_points_and_faster(spec, name, sized, mask) -> None:
    """By points drawn at random, 16 times as many quarter the error, which is √(V(1 − V)/n) in a pixel."""
    view, truth = sized(name)
    spread = [math.sqrt((errors(mask(spec.format(n), view), truth) ** 2).mean()) for n in (16, 256)]
    visibility = truth.visibility[truth.receivers & (truth.visibility > 0.02) & (truth.visibility < 0.98)]
    random = math.sqrt((visibility * (1 - visibility)).mean() / 256)
    assert spread[1] < spread[0] / 4
    assert spread[1] < random
    assert abs(errors(mask(spec.format(256), view), truth).mean()) < spread[1]


@pytest.mark.parametrize("name", ["sun", "rectangle"])
def test_one_sample_is_the_light_s_centre(name, sized, mask) -> None:
    view, truth = sized(name)
    hard = trace(view_of(view.scene, view.camera, replace(view.light, radius=0.0, size=(0.0, 0.0)), SIZE), 1)
    one = mask("ray-traced", view)
    decided = hard.receivers & ~hard.undecided
    assert np.isin(one, (0.0, 1.0)).all()
    assert np.count_nonzero((one != hard.visibility)[decided]) <= 2
    assert np.array_equal(mask("light-samples:of=ray-traced,n=1", view), one)
    assert truth.visibility[decided].mean() != one[decided].mean()


@pytest.mark.parametrize("scene", ["cube-on-plane", "room-with-lamp"])
def test_under_a_light_without_a_size_more_samples_change_nothing(scene, builtin, mask) -> None:
    view = builtin(scene, SIZE)
    assert np.array_equal(mask("ray-traced:samples=16", view), mask("ray-traced", view))
    assert np.array_equal(mask("light-samples", view), mask("shadow-volume", view))


@pytest.mark.parametrize("name", SIZED)
def test_the_points_lie_on_the_light(name, sized) -> None:
    light = sized(name)[0].light
    points = list(light_points(light, 64))
    assert len(points) == 64 and not any(point.soft for point, _ in points)
    if name == "sun":
        cosines = [float(unit(point.direction) @ unit(light.direction)) for point, _ in points]
        assert math.cos(light.radius) <= min(cosines) <= max(cosines) <= 1
        return
    away = np.array([np.subtract(point.position, light.position) for point, _ in points])
    along = away @ unit(light.direction)
    if name in ("disc", "rectangle"):
        assert np.abs(along).max() < 1e-12
        assert np.abs(away.mean(axis=0)).max() < 0.05
        reach = light.radius if name == "disc" else math.hypot(*light.size) / 2
        assert np.linalg.norm(away, axis=1).max() <= reach
    else:
        assert np.allclose(np.linalg.norm(away, axis=1), light.radius)
        assert np.allclose(away / light.radius, [normal for _, normal in points])


def test_a_spec_knows_the_techniques_that_it_names() -> None:
    spec = parse_spec("light-samples:of=cube-map(preset=course)", techniques())
    assert [one.name for one in spec.techniques] == ["light-samples", "cube-map", "shadow-map"]
    assert spec.text == "light-samples:of=cube-map(bias=constant(world=0.05),filter=pcf-20)"
