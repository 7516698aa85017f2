"""Undecided pixels are so few that they do not affect scores."""

import math

import numpy as np
import pytest

from shadowbench.scenes.library import load_scene
from shadowbench.scenes.model import Light, View, view_of
from shadowbench.truths.rays import GRAZING
from shadowbench.truths.trace import OFFSET, STANDARD_ERROR, Truth, trace

SIZE = 1024
FINE = {"canopy", "railings"}  # little but edges


def share(truth: Truth) -> float:
    return float(truth.undecided.sum() / truth.receivers.sum())


def first_view(name: str) -> View:
    scene = load_scene(name)
    return view_of(scene, scene.cameras[0], scene.lights[0], SIZE)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["canopy", "fence", "lamp-by-wall", "railings", "statue", "tree"])
def test_builtin_scene_is_decided(name) -> None:
    view = first_view(name)
    error = 1 / 16 if view.light.soft else STANDARD_ERROR  # of visibility, on which undecided pixels do not depend
    assert share(trace(view, 1, error)) < (0.01 if name in FINE else 0.001)


@pytest.mark.parametrize(
    ("above", "shadow", "undecided"),
    [(-3.0, False, False), (-0.01, False, False), (0.0005, True, True), (0.01, True, False)],
)
def test_plate_within_the_offset_of_a_lamp_decides_nothing(shape, looking, above, shadow, undecided) -> None:
    """A lamp that many offsets above or below a plate at 0.5, which hides the ground from it or does not."""
    offset = OFFSET * math.sqrt(8**2 + 8**2 + 0.5**2)
    lamp = Light("lamp", "point", position=(0.1, 0.5 + above * offset, 0.2))
    meshes = [shape("plane", 8.0), shape("plane", 4.0, (0.0, 0.5, 0.0))]
    truth = trace(looking(meshes, lamp, eye=(0.0, 0.4, 0.0), fov=60.0))
    assert truth.receivers.all()
    assert (truth.undecided == undecided).all()
    assert undecided or (truth.visibility == float(not shadow)).all()


@pytest.mark.parametrize(("height", "undecided"), [(2e-5, True), (1e-4, False)])
def test_lamp_within_the_offset_of_a_surface_decides_nothing(shape, looking, height, undecided) -> None:
    """The ground's diagonal is 11.3, twice the offset 2.3e-5."""
    lamp = Light("lamp", "point", position=(0.0, height, 0.0))
    assert (trace(looking([shape("plane", 8.0)], lamp, eye=(0.0, 0.1, 0.0))).undecided == undecided).all()


@pytest.mark.parametrize(
    ("height", "visibility", "undecided"),
    [(0.2, 1, False), (0.3, 1, True), (3.7, 0, True), (4.4, 0, False)],
)
def test_occluder_within_four_offsets_of_a_surface_decides_nothing(
    shape, looking, height, visibility, undecided
) -> None:
    """A plate that many offsets above the ground, too near to the camera to be seen; a ray starts one offset up."""
    offset = OFFSET * math.hypot(8, 8)
    meshes = [shape("plane", 8.0), shape("plane", 4.0, (0.0, height * offset, 0.0))]
    noon = Light("sun", "directional", (0.1, -1.0, 0.0))
    truth = trace(looking(meshes, noon, eye=(0.0, 1.0, 0.0), fov=20.0, near=1 - 0.1 * offset))
    assert (truth.triangle < 2).all()
    assert (truth.visibility == visibility).all()
    assert (truth.undecided == undecided).all()


def test_receivers_whose_offset_would_leak_light_are_undecided(shape, looking, on_ground) -> None:
    """The end of a long shadow: a start at P + N·δ moves it by δ/tan(elevation), and so it is known no better."""
    slope, tall = 1e-3, 2e-3
    meshes = [shape("plane", 8.0), shape("box", (0.5, tall, 6.0), (-0.25 - tall / slope, tall / 2, 0.0))]
    low = Light("sun", "directional", (1.0, -slope, 0.0))
    view = looking(meshes, low, size=128, eye=(0.0, 1.0, 0.0), fov=3.0, target=(0.0, 0.0, -1e-3))
    truth, x = trace(view), on_ground(view)[..., 0]
    strip = OFFSET * math.hypot(8, 8) / slope
    pixel = np.ptp(x) / 127
    assert pixel < strip / 20
    assert (truth.visibility == (x > 0))[np.abs(x) > pixel].all()
    uncertain = (x > -strip) & (x < 0)
    sure = (np.abs(x) > pixel) & (np.abs(x + strip) > pixel)
    assert (truth.undecided == uncertain)[sure].all()


def test_light_steeper_than_grazing_decides(shape, looking) -> None:
    for factor, share in ((0.99, 1), (1.01, 0)):
        sun = Light("sun", "directional", (1.0, -factor * GRAZING, 0.0))
        truth = trace(looking([shape("plane", 8.0)], sun, eye=(0.0, 1.0, 0.0)))
        assert truth.undecided.mean() == share


@pytest.mark.parametrize(
    ("pixels", "undecided", "across", "down"),
    [
        *((1 / 300, True, across, down) for across in (-1, 1) for down in (-1, 1)),
        (1 / 220, False, 1, 1),
    ],
    ids=["-1--1-nearer", "-1-1-nearer", "1--1-nearer", "1-1-nearer", "1-1-farther"],
)
def test_centre_nearer_to_a_corner_than_the_rasterisers_grid_is_undecided(
    shape, looking, sun, pixels, undecided, across, down
) -> None:
    """A ground whose corner lies beside the centre in both directions: one corner of the grid's cell is on it."""
    wide, tilt = 2 * math.tan(math.radians(10.0)) / 64, 1e-4
    x, z = 0.5 * wide, (0.5 * wide - tilt) / (1 + 0.5 * wide * tilt)  # of the centre
    corner = x + across * pixels * wide, z + down * pixels * wide
    ground = shape("plane", 8.0, (corner[0] + 4 * across, 0, corner[1] + 4 * down))
    truth = trace(looking([ground], sun, eye=(0, 1, 0), target=(0, 0, -tilt), fov=20.0))
    assert truth.triangle[32, 32] < 0 and truth.triangle[32 + down, 32 + across] >= 0
    assert truth.undecided[32, 32] == undecided


def test_surface_seen_edge_on_is_undecided(shape, looking) -> None:
    """An eye a millionth above the ground: rounding alone says where its rays meet it."""

    def seen_from(height: float) -> Truth:
        noon = Light("sun", "directional", (0.1, -1.0, 0.0))
        return trace(looking([shape("plane", 8.0)], noon, eye=(3.0, height, 0.0), size=8, fov=1e-7))

    flat = seen_from(1.5e-6)  # a slope of 5e-7
    assert (flat.triangle >= 0).all()
    assert flat.undecided.all()
    assert not seen_from(6e-6).undecided.any()  # of 2e-6
