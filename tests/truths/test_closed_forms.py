"""Shadows on a plane with a known outline: the convex hull of a convex caster's projected vertices."""

import math
from collections.abc import Callable

import numpy as np
import pytest
from scipy.spatial import ConvexHull

from shadowbench.scenes.model import Light, Mesh, View
from shadowbench.scenes.vectors import Floats, vec3
from shadowbench.truths.trace import Truth, trace

AZIMUTH = math.radians(23.0)  # askew to everything
ALONG = np.array([math.cos(AZIMUTH), 0.0, math.sin(AZIMUTH)])
ASIDE = np.array([-math.sin(AZIMUTH), 0.0, math.cos(AZIMUTH)])
UP = np.array([0.0, 1.0, 0.0])

PAIRS = [  # each caster, light and ground with each other, and each elevation, in degrees, with two of each
    ("box", "directional", 0.1, 20.0), ("sphere", "spot", 0.1, 200.0), ("sphere", "point", 1.0, 20.0),
    ("box", "spot", 1.0, 200.0), ("box", "point", 5.0, 200.0), ("sphere", "directional", 5.0, 20.0),
    ("sphere", "directional", 20.0, 200.0), ("box", "spot", 20.0, 20.0), ("box", "point", 45.0, 20.0),
    ("sphere", "spot", 45.0, 200.0), ("sphere", "point", 85.0, 200.0), ("box", "directional", 85.0, 20.0),
]  # fmt: skip
SIZE = 256
GROUND_FACES = 2


def end_of_shadow(side: float) -> Floats:
    return ALONG * (side / 4)


def caster(kind: str, shape: Callable[..., Mesh], side: float, elevation: float) -> Mesh:
    """A box or sphere on the ground whose shadow is half the ground's side long and ends at `end_of_shadow`."""
    foot, length = end_of_shadow(side) - ALONG * (side / 2), side / 2
    if kind == "sphere":
        radius = length * math.tan(elevation / 2)
        return shape("sphere", 2 * radius, foot + UP * radius)
    height, width = length * math.tan(elevation), side / 40
    box = shape("box", [width, height, width])
    local = box.vertices @ np.stack([ALONG, UP, ASIDE])  # turned, its far side square to the light
    return Mesh("box", local + foot + UP * (height / 2) - ALONG * (width / 2), box.faces)


def light_of(kind: str, mesh: Mesh, side: float, elevation: float) -> Light:
    """A light that stands at `elevation` as seen from the shadow's end."""
    toward = math.sin(elevation) * UP - math.cos(elevation) * ALONG
    if kind == "directional":
        return Light("sun", "directional", direction=vec3(-toward))
    end = end_of_shadow(side)
    farthest = np.linalg.norm(mesh.vertices - end, axis=1).max()
    return Light(kind, kind, vec3(-toward), vec3(end + toward * 1.5 * farthest), math.radians(20.0))


def projected(points: Floats, light: Light) -> Floats:
    """(N, 2) x and z where the lines from the light through points meet the ground."""
    position, w = light.homogeneous
    travel = w * points - position
    return (points - travel * (points[:, 1:2] / travel[:, 1:2]))[:, [0, 2]]


def inside_hull(corners: Floats, points: Floats) -> np.ndarray:
    hull = ConvexHull(corners)
    inside = np.ones(len(points), dtype=bool)
    for a, b, c in hull.equations:
        inside &= points @ [a, b] + c <= 0
    return inside


def ground_points(view: View, truth: Truth, pixel_rays: Callable[..., tuple[Floats, Floats]]) -> tuple[Floats, Floats]:
    """Flat indices of the pixels that show the ground, and (N, 3) where their rays meet it."""
    pixels = np.flatnonzero((truth.triangle.ravel() >= 0) & (truth.triangle.ravel() < GROUND_FACES))
    starts, rays = (each[pixels] for each in pixel_rays(view))
    return pixels, starts - rays * (starts[:, 1:2] / rays[:, 1:2])


@pytest.mark.parametrize(("body", "kind", "degrees", "side"), PAIRS)
def test_shadow_on_a_plane_is_the_hull_of_projected_vertices(
    body, kind, degrees, side, shape, looking, pixel_rays
) -> None:
    elevation = math.radians(degrees)
    mesh = caster(body, shape, side, elevation)
    light = light_of(kind, mesh, side, elevation)
    end, reach = end_of_shadow(side), side / 20
    eye = vec3(end + reach * (0.3 * ALONG + 0.5 * ASIDE + UP))
    target = vec3(end - 0.1 * reach * ALONG)
    view = looking([shape("plane", side), mesh], light, SIZE, eye, target, fov=45.0)
    truth = trace(view, pixel_samples=1)

    pixels, points = ground_points(view, truth, pixel_rays)
    shadowed = inside_hull(projected(mesh.vertices, light), points[:, [0, 2]])
    receiver = np.ones(len(points), dtype=bool)
    if kind == "spot":
        away = points - light.position
        cosine = away @ light.direction / np.linalg.norm(away, axis=1)
        receiver = cosine >= math.cos(light.angle / 2)
    lit = truth.visibility.ravel()[pixels] == 1
    decided = ~truth.undecided.ravel()[pixels]

    assert (truth.receivers.ravel()[pixels] == receiver)[decided].all()
    wrong = (lit == shadowed) & receiver & decided
    assert not wrong.any(), f"{wrong.sum()} of {len(pixels)} pixels, the first at {points[wrong][0]}"
    assert (shadowed & decided).sum() > 20
    assert (~shadowed & receiver & decided).sum() > 20
    beyond = (points - end) @ ALONG
    assert (shadowed & (beyond > -reach / 4)).any(), "the shadow's end is not in view"
    assert not shadowed[beyond > 1e-9 * side].any(), "the shadow is longer than it was made"
    assert truth.undecided.sum() < 0.02 * truth.receivers.sum()
