"""Small scenes, views of them, and their exact shadows in float64."""

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import pytest
from scipy.ndimage import binary_dilation

from shadowbench.scenes.model import Light, View
from shadowbench.scenes.vectors import Floats
from shadowbench.truths.trace import Truth
from tests.drawing import view_at

from .oracle import answers

SUN = Light("sun", "directional", (0.5, -1.0, -0.3))
SPOT = Light("spot", "spot", (-0.5, -1.0, 0.2), (2.0, 4.0, -0.8), math.radians(60.0))
LAMP = Light("lamp", "point", position=(1.5, 3.0, -1.0))


@pytest.fixture(scope="session")
def sun() -> Light:
    return SUN


@pytest.fixture(scope="session", params=[SUN, SPOT, LAMP], ids=lambda light: light.kind)
def light(request: pytest.FixtureRequest) -> Light:
    """One light of each kind, all from above a scene of a few metres."""
    chosen: Light = request.param
    return chosen


@pytest.fixture(scope="session")
def looking() -> Callable[..., View]:
    return view_at


@pytest.fixture(scope="session")
def pixel_rays() -> Callable[[View], tuple[Floats, Floats]]:
    """(size², 3) where the rays through pixel centres start, and their directions, by the camera's definition."""

    def make(view: View) -> tuple[Floats, Floats]:
        eye, target = np.asarray(view.camera.position), np.asarray(view.camera.target)
        ahead = (target - eye) / np.linalg.norm(target - eye)
        right = np.cross(ahead, view.camera.up)
        if np.linalg.norm(right) < 1e-6:
            raise ValueError("a test's camera does not look along its up")
        right /= np.linalg.norm(right)
        above = np.cross(right, ahead)
        width, height = view.size
        half = math.tan(view.camera.fov_y / 2)
        down, across = np.meshgrid(
            (2 * np.arange(height) + 1 - height) / height, (2 * np.arange(width) + 1 - width) / height, indexing="ij"
        )
        beside = (across[..., None] * right - down[..., None] * above).reshape(-1, 3)
        return eye + view.camera.height / 2 * beside, ahead + half * beside

    return make


@pytest.fixture(scope="session")
def on_ground(pixel_rays: Callable[[View], tuple[Floats, Floats]]) -> Callable[[View], Floats]:
    """(height, width, 3) where pixels' rays meet y = 0."""

    def make(view: View) -> Floats:
        starts, rays = pixel_rays(view)
        return (starts - rays * (starts[:, 1:2] / rays[:, 1:2])).reshape(*view.size.shape, 3)

    return make


@pytest.fixture(scope="session")
def toward() -> Callable[[Light, Floats], Floats]:
    """(…, 3) unit vectors from points to a light."""

    def make(light: Light, points: Floats) -> Floats:
        position, w = light.homogeneous
        ways = position - w * points
        unit: Floats = ways / np.linalg.norm(ways, axis=-1, keepdims=True)
        return unit

    return make


def near_edges(truth: Truth) -> np.ndarray:
    """(size, size) bool: within two pixels of a border of what is lit."""
    code = truth.receivers + truth.visibility
    edges = np.zeros(code.shape, dtype=bool)
    edges[:, 1:] |= code[:, 1:] != code[:, :-1]
    edges[1:] |= code[1:] != code[:-1]
    near: np.ndarray = binary_dilation(edges, iterations=2)
    return near


def sampled_pixels(truth: Truth, count: int) -> np.ndarray:
    """Flat indices of `count` pixels: three of five within two pixels of an edge, the rest anywhere."""
    edges = np.flatnonzero(near_edges(truth))
    random = np.random.default_rng(7)
    at_edges = random.choice(edges, min(3 * count // 5, len(edges)), replace=False)
    anywhere = random.choice(truth.visibility.size, min(2 * count // 5, truth.visibility.size), replace=False)
    return np.unique(np.concatenate([at_edges, anywhere]))


class Judged(NamedTuple):
    """Decided pixels: (N,) whether each receives and is lit, and how many of either a truth has wrong."""

    receiver: np.ndarray
    lit: np.ndarray
    decided: np.ndarray
    wrong: int


@pytest.fixture(scope="session")
def judged(pixel_rays: Callable[[View], tuple[Floats, Floats]]) -> Callable[..., Judged]:
    """A truth against every triangle and every ray, in float64 and the file's own units: no tree, no float32.

    `oracle` says how; `count` pixels by `sampled_pixels`, or just the `pixels` given.
    """

    def judge(view: View, truth: Truth, count: int = 2000, pixels: np.ndarray | None = None) -> Judged:
        pixels = sampled_pixels(truth, count) if pixels is None else pixels
        receiver, lit = answers(view, *(each[pixels] for each in pixel_rays(view)))
        decided = ~truth.undecided.ravel()[pixels]
        if truth.shading_cosine is not None:  # visibility is 0 where triangles alone face away from the light
            lit = lit & (receiver | (truth.shading_cosine.ravel()[pixels] <= 0))
        wrong = (truth.receivers.ravel()[pixels] != receiver) | ((truth.visibility.ravel()[pixels] == 1) != lit)
        return Judged(receiver[decided], lit[decided], decided, int((wrong & decided).sum()))

    return judge
