"""Grazing light, N·L below 0.01: no decided receiver is wrong, and nearly all of them are decided."""

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from shadowbench.scenes.library import load_scene
from shadowbench.scenes.model import Light, Mesh, Scene, view_of
from shadowbench.scenes.vectors import vec3
from shadowbench.truths.rays import GRAZING
from shadowbench.truths.trace import OFFSET, Truth, trace

from .conftest import near_edges

RECEIVERS = 100  # that are compared of each view
LOW, LOWEST = 0.01, 0.002  # N·L
PLANE = 8.0
SIZE = 1024
Judge = Callable[..., Any]
DIAGONAL = math.hypot(PLANE, PLANE)


def wall(height: float, at: float = 0.0) -> Mesh:
    """A wall across the plane, that many offsets high."""
    top = height * OFFSET * DIAGONAL
    corners = [[at, 0.0, -2.0], [at, 0.0, 2.0], [at, top, 2.0], [at, top, -2.0]]
    return Mesh("wall", np.array(corners), np.array([[0, 1, 2], [0, 2, 3]], dtype=np.int32))


@pytest.mark.parametrize(
    ("height", "slope", "kind"),
    [
        (0.1, 0.0002, "directional"),
        (0.2, 0.0005, "point"),
        (0.6, 0.0002, "spot"),
        (3.0, 0.005, "directional"),
        (0.1, 0.015, "point"),
        (0.2, 0.03, "spot"),
        (0.6, 0.09, "directional"),
        (3.0, 0.09, "point"),
    ],
)
def test_shadow_of_a_wall_no_higher_than_the_offset_is_right_and_decided(
    height, slope, kind, shape, looking, judged
) -> None:
    """Every shadow ray that starts above the surface starts beyond the wall, whose shadow is height/slope long."""
    length = height * OFFSET * DIAGONAL / slope
    light = Light(kind, kind, (1.0, -slope, 0.0), (-2.0, 2.0 * slope, 0.1), math.radians(60.0))
    middle = (0.9 * length, 0.0, 0.0)
    fov = math.degrees(2 * math.atan(length))
    view = looking([shape("plane", PLANE), wall(height)], light, 32, (0.9 * length, 1.0, 1e-3), middle, fov)
    against = judged(view, trace(view, pixel_samples=1), pixels=np.arange(32 * 32))
    assert against.receiver.mean() > 0.9
    assert (~against.lit).sum() > 200 and against.lit.sum() > 200
    assert against.decided.mean() > 0.9
    assert against.wrong == 0


def test_receivers_about_which_there_are_a_thousand_casters_are_decided_as_by_one(shape, looking) -> None:
    slope, one = 0.005, wall(0.2)
    length = 0.2 * OFFSET * DIAGONAL / slope
    many = Mesh("walls", one.vertices, np.tile(one.faces, (1025, 1)))
    fov = math.degrees(2 * math.atan(length))
    eye, middle = (0.9 * length, 1.0, 1e-3), (0.9 * length, 0.0, 0.0)
    sun = Light("sun", "directional", (1.0, -slope, 0.0))
    few, over = (
        trace(looking([shape("plane", PLANE), mesh], sun, 32, eye, middle, fov), pixel_samples=1)
        for mesh in (one, many)
    )
    assert (few.visibility == 0).sum() > 200 and not few.undecided[few.visibility == 0].any()
    assert (over.visibility == few.visibility).all() and (over.undecided == few.undecided).all()


LOW_SUN = Light("sun", "directional", (1.0, -0.0007, 0.2))


@pytest.mark.parametrize("kind", ["directional", "point"])
def test_second_copy_of_a_surface_leaves_it_lit_and_decided(kind, shape, looking) -> None:
    light = Light(kind, kind, LOW_SUN.direction, (-3.9, 0.004, -0.5), math.radians(60.0))
    copies = [shape("terrain", (PLANE, 0.001, PLANE), cells=16, waves=1.0, seed=3) for _ in range(2)]
    alone, doubled = (trace(looking(meshes, light, 256), pixel_samples=1) for meshes in (copies[:1], copies))
    assert (doubled.visibility == alone.visibility).all()
    assert (doubled.undecided == alone.undecided).all()
    assert (alone.receivers & (alone.cosine < LOW) & (alone.visibility == 1) & ~alone.undecided).sum() > 1000


@pytest.mark.parametrize("above", [1e-9, 5e-8, 3e-7])
def test_sheet_that_float32_cannot_tell_from_what_it_lies_on_is_right_or_undecided(
    above, shape, looking, judged
) -> None:
    """Above the ground by that share of the diagonal: its own surface is lit, the ground below it is not seen."""
    sheet = shape("plane", PLANE / 2, (0.0, above * DIAGONAL, 0.0))
    view = looking([shape("plane", PLANE), sheet], LOW_SUN, 64)
    against = judged(view, trace(view, pixel_samples=1), pixels=np.arange(64 * 64))
    assert against.wrong == 0
    assert against.lit.sum() > 1000


VIEWS: list[tuple[str, Any, float]] = [  # each kind of light, on meshes of others and on ours
    ("armadillo.obj", "as given", 0.0),
    ("bgfx_tree.obj", "spot", 0.02),
    ("2CylinderEngine.glb", "directional", 0.3),
    ("statue", "directional", 0.1),
    ("railings", "directional", 0.3),
    ("sphere-and-torus", "point", 0.005),
    ("spot-lamp", "spot", 0.01),
]


def low_light(scene: Scene, kind: Any, low: float) -> Light:
    """A sun at an elevation of `low` degrees, or a lamp at a height of `low`, a fifth of the diagonal aside."""
    along = np.array([0.86, 0.0, -0.51]) / math.hypot(0.86, 0.51)
    if kind == "directional":
        elevation = math.radians(low)
        return Light("low", kind, vec3(along * math.cos(elevation) - [0.0, math.sin(elevation), 0.0]))
    corners = scene.geometry.bounds
    x, _, z = corners.mean(axis=0) - along * np.linalg.norm(corners[1] - corners[0]) / 5
    return Light("low", kind, vec3(along), (float(x), low, float(z)), math.radians(60.0))


def grazing_pixels(truth: Truth) -> np.ndarray:
    """Flat indices of receivers in grazing light, some of each kind: below LOWEST or not, at edges or not."""
    random = np.random.default_rng(11)
    lowest, edges = truth.cosine < LOWEST, near_edges(truth)
    grazing = (truth.cosine > GRAZING) & (truth.cosine < LOW)
    kinds = [np.flatnonzero(grazing & low & at) for low in (lowest, ~lowest) for at in (edges, ~edges)]
    return np.concatenate([random.choice(kind, min(RECEIVERS // 4, len(kind)), replace=False) for kind in kinds])


@pytest.mark.slow
@pytest.mark.timeout(3600)
@pytest.mark.parametrize(("name", "kind", "low"), VIEWS)
def test_no_decided_receiver_in_grazing_light_is_wrong(name, kind, low, shared_scenes, judged) -> None:
    scene = load_scene(shared_scenes / name if "." in name else name)
    light = scene.lights[0] if kind == "as given" else low_light(scene, kind, low)
    view = view_of(scene, scene.cameras[0], light, SIZE)
    truth = trace(view, pixel_samples=1)
    pixels = grazing_pixels(truth)
    against = judged(view, truth, pixels=pixels)
    lowest = truth.cosine.ravel()[pixels] < LOWEST
    assert len(pixels) >= RECEIVERS // 4
    assert against.wrong == 0
    assert against.decided.mean() >= 0.9
    assert not lowest.any() or against.decided[lowest].mean() >= 0.9
