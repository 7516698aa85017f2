"""How much of an image nobody can decide: next to nothing, or scores would rest on what is left."""

from collections.abc import Callable

import pytest

from shadowbench.scenes.library import builtin_names, load_scene
from shadowbench.scenes.model import Light, Mesh, View, view_of
from shadowbench.truth.trace import Truth, trace

SIZE = 1024
FINE = {"canopy", "railings"}  # little but edges


def share(truth: Truth) -> float:
    return float(truth.undecided.sum() / truth.receivers.sum())


def first_view(name: str) -> View:
    scene = load_scene(name)
    return view_of(scene, scene.cameras[0], scene.lights[0], SIZE)


@pytest.mark.slow
@pytest.mark.parametrize("name", builtin_names())
def test_builtin_scene_is_decided(name: str) -> None:
    assert share(trace(first_view(name), pixel_samples=1)) < (0.01 if name in FINE else 0.001)


@pytest.mark.slow
@pytest.mark.parametrize("name", [name for name in builtin_names() if first_view(name).light.kind == "directional"])
def test_builtin_scene_is_decided_under_a_grazing_sun(name: str, lowered: Callable[[View, float], View]) -> None:
    view = first_view(name)
    assert share(trace(lowered(view, 0.1), pixel_samples=1)) < 0.02


def test_undecided_pixels_lie_at_edges(shape: Callable[..., Mesh], looking: Callable[..., View]) -> None:
    sun = Light("sun", "directional", (0.5, -1.0, -0.3))
    truth = trace(looking([shape("plane", 8.0), shape("box", at=(0, 0.5, 0))], sun, size=256))
    assert truth.undecided.any()
    code = truth.receivers + 2 * truth.visibility + 4 * (truth.triangle >= 0)
    for row, column in zip(*truth.undecided.nonzero(), strict=True):
        around = code[max(row - 1, 0) : row + 2, max(column - 1, 0) : column + 2]
        assert around.min() != around.max()


def test_grazing_light_decides_nothing(shape: Callable[..., Mesh], looking: Callable[..., View]) -> None:
    ground = [shape("plane", 8.0)]
    grazing = trace(looking(ground, Light("sun", "directional", (1.0, -9e-5, 0.0))))
    assert grazing.undecided[grazing.receivers].all()
    steeper = trace(looking(ground, Light("sun", "directional", (1.0, -2e-4, 0.0))))
    assert not steeper.undecided[steeper.receivers].mean() > 0.1  # but the ground's own edge


def test_lamp_within_the_offset_of_a_surface_decides_nothing(
    shape: Callable[..., Mesh], looking: Callable[..., View]
) -> None:
    def lit_from(height: float) -> Truth:  # the ground's diagonal is 11.3, twice the offset 2.3e-5
        lamp = Light("lamp", "point", position=(0.0, height, 0.0))
        return trace(looking([shape("plane", 8.0)], lamp, eye=(0.0, 0.1, 0.0)))

    assert lit_from(2e-5).undecided.all()
    assert not lit_from(1e-4).undecided.any()
