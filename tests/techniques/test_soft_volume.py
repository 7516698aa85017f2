"""Soft volumes: the same masks as shadow volumes averaged over as many points of the light."""

import math
from dataclasses import replace

import numpy as np
import pytest

from shadowbench.scenes.model import Light, Mesh

DOWN = Light("sun", "directional", (0.0, -1.0, 0.0))
WIDE = 0.02  # share of the pixels in a penumbra


@pytest.fixture
def differing(mask):
    """Share of the pixels whose visibility differs from that of `light-samples`."""

    def measure(view, n: int) -> float:
        volumes, samples = (mask(f"{name}:n={n}", view) for name in ("soft-volume", "light-samples"))
        assert ((samples > 0) & (samples < 1)).mean() > WIDE
        return float((np.abs(volumes - samples) > 1e-3).mean())

    return measure


@pytest.mark.parametrize(
    ("scene", "changes"),
    [
        ("cube-on-plane", {"radius": math.radians(25.0)}),
        ("spot-lamp", {"radius": 0.15}),
        ("room-with-lamp", {"radius": 0.1}),
        ("spot-lamp", {"kind": "rectangle", "size": (1.0, 0.5), "up": (0.3, 0.2, -1.0)}),
        ("overlap", {}),  # several layers
        ("shade", {}),  # a lamp that may be inside a caster
        pytest.param("leaves", {}, marks=pytest.mark.slow),  # open casters
    ],
)
def test_a_soft_volume_is_the_mean_of_hard_ones(scene, changes, builtin, differing) -> None:
    view = builtin(scene, 96)
    assert differing(replace(view, light=replace(view.light, **changes)), 20) < 5e-4


def test_edges_that_point_at_the_light_have_wedges(looking, shape, differing) -> None:
    """A box below the zenith, whose upright edges are silhouettes from a part of the light, and end-on from another.

    It stands in a plate that receives shadows halfway along these edges.
    """
    meshes = [shape("plane", 8.0), shape("box", (0.7, 1.5, 0.7), (0.1, 1.6, 0.0)), shape("plane", 1.6, (0.1, 1.6, 0.0))]
    light = replace(DOWN, radius=math.radians(20.0))
    assert differing(looking(meshes, light, 96, eye=(1.5, 2.0, 3.0)), 20) < 5e-4


def test_casters_beyond_a_lamp_change_nothing(looking, shape, differing) -> None:
    meshes = [
        shape("plane", 8.0),
        shape("box", (1.0, 0.1, 1.0), (0.2, 1.0, 0.1)),
        shape("box", (0.3, 0.1, 0.3), (0.0, 2.6, 0.0)),
    ]
    lamp = Light("lamp", "point", position=(0.0, 2.0, 0.0), radius=0.2)
    assert differing(looking(meshes, lamp, 96, eye=(1.0, 8.0, 1.5), fov=30.0), 20) < 5e-4


def test_many_layers_are_counted(looking, shape, differing) -> None:
    """25 plates with one edge above the other, which all begin within a penumbra."""
    plates = [shape("plane", (2.0, 1.0, 2.0), (1.0, 0.8 + 0.01 * k, 0.0)) for k in range(25)]
    light = replace(DOWN, radius=math.radians(5.0))
    assert differing(looking([shape("plane", 8.0), *plates], light, 96), 20) < 5e-4


@pytest.mark.parametrize(
    ("seed", "light"),
    [(0, replace(DOWN, radius=0.3)), (1, Light("lamp", "point", position=(0.0, 2.0, 0.0), radius=0.35))],
)
def test_triangles_in_all_directions(seed, light, looking, shape, differing) -> None:
    """Each with a receiver's slab at its own height, so that wedges count from their edges on."""
    random = np.random.default_rng(seed)
    corners = random.uniform((-0.9, 0.1, -0.9), (0.9, 1.4, 0.9), (30, 3))
    loose = Mesh("loose", corners, np.arange(30, dtype=np.int32).reshape(-1, 3))
    steps = [shape("box", (1.2, 0.3 * k, 4.0), (1.2 * k - 3.0, 0.15 * k, 0.0)) for k in range(1, 5)]
    assert differing(looking([shape("plane", 8.0), loose, *steps], light, 96, eye=(1.0, 4.5, 3.0)), 20) < 2e-4
