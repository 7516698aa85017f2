"""Lights of odd sizes in odd places: inside a wall, around the camera, seen from behind, as wide as the sky."""

import math
from collections.abc import Callable

import numpy as np
import pytest

from shadowbench.scenes.model import Light, Mesh
from shadowbench.scenes.vectors import Floats
from shadowbench.truths.trace import Truth, trace

pytestmark = pytest.mark.filterwarnings("error")

EYE = (2.3, 4.0, 3.4)
DOWN, UP, ACROSS = (0.0, -1.0, 0.0), (0.0, 1.0, 0.0), (1.0, 0.0, 0.0)
ABOVE = (0.0, 4.0, 0.0)
LAMP = Light("lamp", "point", position=(1.5, 0.4, 0.0), radius=1.0)

Fact = Callable[[Truth, np.ndarray, Floats], bool]


def lit_on_top(truth: Truth, ground: np.ndarray, _: Floats) -> bool:
    """All of the light is seen from the top of the box, and not from the ground beside it."""
    top = truth.receivers & ~ground & (truth.cosine > 0.9)
    return bool(top.any() and (truth.visibility[top] == 1).all() and 0.3 < truth.visibility[ground].min() < 0.7)


def nothing(truth: Truth, *_: object) -> bool:
    return not truth.receivers.any()


def lights_the_ground(truth: Truth) -> bool:
    return bool(truth.receivers.sum() > 100 and truth.undecided[truth.receivers].mean() < 0.1)


def undecided_within(truth: Truth, ground: np.ndarray, points: Floats) -> bool:
    """Of the ground, what is inside the lamp is undecided, and little else."""
    inside = np.linalg.norm(points - LAMP.position, axis=-1) < LAMP.radius
    return bool(truth.undecided[ground & inside].all() and truth.undecided[ground & ~inside].mean() < 0.02)


CASES: dict[str, tuple[Light, Fact]] = {
    "a lamp inside the box": (
        Light("lamp", "point", position=(0.0, 0.5, 0.0), radius=0.1),
        lambda truth, ground, _: bool(ground.any() and (truth.visibility[ground & ~truth.undecided] == 0).all()),
    ),
    "a lamp around the camera, which sees what half of it sees": (
        Light("lamp", "point", position=EYE, radius=1.0),
        lambda truth, *_: bool(truth.receivers.any() and truth.visibility.min() > 0.45),
    ),
    "a lamp around a part of the ground": (LAMP, undecided_within),
    "a panel seen from behind": (Light("panel", "rectangle", UP, ABOVE, size=(1.0, 2.0), up=ACROSS), nothing),
    "a panel across the ground": (
        Light("panel", "rectangle", ACROSS, (0.9, 1.0, 0.0), size=(1.0, 1.0)),
        lambda truth, _, points: bool(truth.receivers.any() and (points[truth.receivers][:, 0] > 0.9).all()),
    ),
    "a panel on the face of the box": (
        Light("panel", "rectangle", ACROSS, (0.5, 0.5, 0.0), size=(0.6, 0.6)),
        lambda truth, *_: bool((truth.visibility[truth.receivers] == 1).all() and lights_the_ground(truth)),
    ),
    "a disc through the wall of the box": (
        Light("disc", "disc", ACROSS, (0.4, 0.5, 0.0), radius=1.0),
        lambda truth, ground, _: bool(0 < truth.visibility[ground].max() < 1),
    ),
    "a disc that shines into the ground": (
        Light("disc", "disc", DOWN, (0.0, 0.0, 0.0), radius=1.0),
        lambda truth, *_: bool(truth.undecided[truth.receivers].all()),
    ),
    "a disc as wide as the sky": (Light("disc", "disc", DOWN, ABOVE, radius=1e6), lit_on_top),
    "a sun as wide as the sky": (Light("sun", "directional", DOWN, radius=math.radians(89.9)), lit_on_top),
}


@pytest.fixture(scope="module")
def scene(shape: Callable[..., Mesh]) -> list[Mesh]:
    return [shape("plane", 6.0), shape("box", at=(0.0, 0.5, 0.0))]


@pytest.mark.parametrize(("light", "fact"), CASES.values(), ids=CASES)
def test_an_odd_light_has_a_truth(light, fact, scene, looking, on_ground) -> None:
    view = looking(scene, light, 32, EYE)
    truth = trace(view, pixel_samples=1)
    for name in ("visibility", "standard_error", "irradiance", "area"):
        values = getattr(truth, name)
        assert (values >= 0).all() and (values <= 1).all(), name
    ground = truth.receivers & (truth.triangle >= 0) & (truth.triangle < 2)
    assert fact(truth, ground, on_ground(view))


def test_a_panel_whose_up_is_its_direction_takes_an_axis_instead(scene, looking) -> None:
    one, other = (
        trace(looking(scene, Light("panel", "rectangle", DOWN, ABOVE, size=(0.5, 2.0), up=way), 32), pixel_samples=1)
        for way in (DOWN, ACROSS)
    )
    assert (one.visibility < 0.9).any()
    assert np.array_equal(one.visibility, other.visibility)
