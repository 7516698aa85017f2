"""Small scenes made in a line, how they are viewed, and what float64 alone says of them."""

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
import pytest
from scipy.ndimage import binary_dilation

from shadowbench.scenes.model import Camera, Floats, Geometry, Light, Mesh, Scene, View, view_of
from shadowbench.truth.trace import Truth

Place = tuple[float, float, float]

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
    """A view of some meshes; fov in degrees."""

    def make(
        meshes: Sequence[Mesh],
        light: Light,
        size: int = 64,
        eye: Place = (2.3, 4.0, 3.4),
        target: Place = (0.0, 0.0, 0.0),
        fov: float = 50.0,
        near: float | None = None,
        far: float | None = None,
    ) -> View:
        camera = Camera("camera", eye, target, math.radians(fov), near=near, far=far)
        return view_of(Scene("test", tuple(meshes), (camera,), (light,)), camera, light, size)

    return make


@pytest.fixture(scope="session")
def pixel_rays() -> Callable[[View], tuple[Floats, Floats]]:
    """The eye, and (size², 3) directions through pixel centres, worked out anew from the camera's definition."""

    def make(view: View) -> tuple[Floats, Floats]:
        eye, target = np.asarray(view.camera.position), np.asarray(view.camera.target)
        ahead = (target - eye) / np.linalg.norm(target - eye)
        right = np.cross(ahead, view.camera.up)
        if np.linalg.norm(right) < 1e-6:
            raise ValueError("a test's camera does not look along its up")
        right /= np.linalg.norm(right)
        above = np.cross(right, ahead)
        steps = (np.arange(view.size) + 0.5) / view.size * 2 - 1
        half = math.tan(view.camera.fov_y / 2)
        down, across = np.meshgrid(steps, steps, indexing="ij")
        directions = ahead + half * (across[..., None] * right - down[..., None] * above)
        return eye, directions.reshape(-1, 3)

    return make


@pytest.fixture(scope="session")
def on_ground(pixel_rays: Callable[[View], tuple[Floats, Floats]]) -> Callable[[View], Floats]:
    """(size, size, 3) where pixels' rays meet y = 0."""

    def make(view: View) -> Floats:
        eye, directions = pixel_rays(view)
        return (eye - directions * (eye[1] / directions[:, 1:2])).reshape(view.size, view.size, 3)

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


@pytest.fixture(scope="session")
def lowered() -> Callable[[View, float], View]:
    """The view with its directional light's elevation, in degrees, changed and its azimuth kept."""

    def make(view: View, elevation: float) -> View:
        x, _, z = view.light.direction
        along = math.cos(math.radians(elevation)) / math.hypot(x, z)
        light = replace(view.light, direction=(x * along, -math.sin(math.radians(elevation)), z * along))
        return replace(view, light=light)

    return make


TRIANGLES_AT_ONCE = 1024


class Crossings(NamedTuple):
    """All pairs of a ray and a triangle that it goes through: (K,) each, t in lengths of the ray."""

    ray: np.ndarray
    triangle: np.ndarray
    t: Floats


def crossings(origins: Floats, directions: Floats, geometry: Geometry, faces: np.ndarray, about: Floats) -> Crossings:
    """By Plücker coordinates: a line goes through a triangle when it passes all three edges on the same side.

    about: (3,) the point that coordinates are taken from; one that all rays pass through costs no digits.
    """
    origins = origins - about
    rays = np.hstack([directions, np.cross(origins, directions)])
    parts = []
    for start in range(0, len(faces), TRIANGLES_AT_ONCE):
        corners = [geometry.vertices[faces[start : start + TRIANGLES_AT_ONCE, k]] - about for k in range(3)]
        sides = [
            rays @ np.hstack([np.cross(a, b - a), b - a]).T
            for a, b in zip(corners, corners[1:] + corners[:1], strict=True)
        ]
        low = np.minimum(np.minimum(sides[0], sides[1]), sides[2])
        high = np.maximum(np.maximum(sides[0], sides[1]), sides[2])
        ray, triangle = np.nonzero((low >= 0) | (high <= 0))
        a, b, c = (corner[triangle] for corner in corners)
        normal = np.cross(b - a, c - a)
        toward = (normal * directions[ray]).sum(axis=1)
        real = toward != 0
        t = (normal * (a - origins[ray])).sum(axis=1)[real] / toward[real]
        parts.append((ray[real], triangle[real] + start, t))
    return Crossings(*(np.concatenate(column) for column in zip(*parts, strict=True)))


def by_brute_force(view: View, directions: Floats) -> tuple[np.ndarray, np.ndarray]:
    """(receiver, lit) of some rays from the eye."""
    geometry, light = view.scene.geometry, view.light
    eye = np.broadcast_to(view.camera.position, directions.shape)
    near, far = view.near_far
    seen = crossings(eye, directions, geometry, geometry.faces, np.array(view.camera.position))
    between = np.flatnonzero((seen.t >= near) & (seen.t <= far))
    between = between[np.argsort(seen.t[between], kind="stable")]
    hit, first = np.unique(seen.ray[between], return_index=True)
    triangle, t = seen.triangle[between][first], seen.t[between][first]

    points = eye[hit] + directions[hit] * t[:, None]
    position, w = light.homogeneous
    to_light = position - w * points
    distance = np.linalg.norm(to_light, axis=1)
    to_light /= distance[:, None]
    reach = distance if w else np.full(len(hit), np.inf)
    normal = geometry.normals[triangle]
    normal = normal * -np.sign((normal * directions[hit]).sum(axis=1))[:, None]
    cosine = (normal * to_light).sum(axis=1)
    faces_light = cosine > 0
    if light.kind == "spot":
        faces_light &= -(to_light @ light.direction) >= light.cos_half_angle * np.linalg.norm(light.direction)
    receiver = np.zeros(len(directions), dtype=bool)
    receiver[hit] = faces_light & geometry.receives[triangle]

    delta = 1e-6 * np.linalg.norm(geometry.bounds[1] - geometry.bounds[0])
    above = delta / np.where(cosine > 0, cosine, 1.0)
    caster_of = np.flatnonzero(geometry.casts)
    about = np.array(position) if w else points.mean(axis=0)
    blockers = crossings(points, to_light, geometry, geometry.faces[caster_of], about)
    in_the_way = (blockers.t > above[blockers.ray]) & (blockers.t < reach[blockers.ray])
    in_the_way &= caster_of[blockers.triangle] != triangle[blockers.ray]
    lit = np.ones(len(directions), dtype=bool)
    lit[hit[blockers.ray[in_the_way]]] = False
    return receiver, lit | ~receiver


def sampled_pixels(truth: Truth, count: int) -> np.ndarray:
    """Flat indices of `count` pixels: three of five within two pixels of an edge, the rest anywhere."""
    code = truth.receivers + truth.visibility
    edges = np.zeros(code.shape, dtype=bool)
    edges[:, 1:] |= code[:, 1:] != code[:, :-1]
    edges[1:] |= code[1:] != code[:-1]
    near = np.flatnonzero(binary_dilation(edges, iterations=2))
    random = np.random.default_rng(7)
    near_edges = random.choice(near, min(3 * count // 5, len(near)), replace=False)
    anywhere = random.choice(code.size, min(2 * count // 5, code.size), replace=False)
    return np.unique(np.concatenate([near_edges, anywhere]))


class Judged(NamedTuple):
    """Decided pixels: (N,) whether each receives and is lit, and how many of either a truth has wrong."""

    receiver: np.ndarray
    lit: np.ndarray
    decided: np.ndarray
    wrong: int


@pytest.fixture(scope="session")
def judged(pixel_rays: Callable[[View], tuple[Floats, Floats]]) -> Callable[..., Judged]:
    """A truth against every triangle and every ray, in float64 and the file's own units: no tree, no float32.

    The shadow ray starts at the hit itself. A triangle does not shadow itself, and of the others those count that lie
    farther along the ray than δ/(N·L), where the definition of the truth lets the ray begin. That leans on no answer of
    the tracer: δ is 1e-6 of the scene's own diagonal, and pixels for which four times as much or as little matters are
    undecided.
    """

    def judge(view: View, truth: Truth, count: int = 2000) -> Judged:
        pixels = sampled_pixels(truth, count)
        receiver, lit = by_brute_force(view, pixel_rays(view)[1][pixels])
        decided = ~truth.undecided.ravel()[pixels]
        wrong = (truth.receivers.ravel()[pixels] != receiver) | ((truth.visibility.ravel()[pixels] == 1) != lit)
        return Judged(receiver[decided], lit[decided], decided, int((wrong & decided).sum()))

    return judge
