"""Every triangle against every ray, in float64 and the file's own coordinates: no tree, no float32, no placement.

The shadow ray starts at the hit itself. A triangle does not shadow itself, and of the others those count that lie
farther along the ray than δ/(N·L), where the definition of the truth lets the ray begin. That leans on no answer of
the tracer: δ is 1e-6 of the scene's own diagonal, and pixels for which four times as much or as little matters are
undecided.
"""

from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest
from scipy.ndimage import binary_dilation

from shadowbench.scenes.library import load_scene
from shadowbench.scenes.model import Floats, Geometry, Scene, View, view_of
from shadowbench.truth.trace import Truth, trace

TRIANGLES_AT_ONCE = 1024
NEAR_EDGES, ANYWHERE = 1200, 800


class Crossings(NamedTuple):
    """All pairs of a ray and a triangle that it goes through: (K,) each, t in lengths of the ray."""

    ray: np.ndarray
    triangle: np.ndarray
    t: Floats


def crossings(origins: Floats, directions: Floats, geometry: Geometry, faces: np.ndarray) -> Crossings:
    """By Plücker coordinates: a line goes through a triangle when it passes all three edges on the same side."""
    rays = np.hstack([directions, np.cross(origins, directions)])
    parts = []
    for start in range(0, len(faces), TRIANGLES_AT_ONCE):
        corners = [geometry.vertices[faces[start : start + TRIANGLES_AT_ONCE, k]] for k in range(3)]
        sides = [
            rays @ np.hstack([np.cross(a, b), b - a]).T for a, b in zip(corners, corners[1:] + corners[:1], strict=True)
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


def brute_force(view: View, directions: Floats) -> tuple[np.ndarray, np.ndarray]:
    """(receiver, lit) of some rays from the eye."""
    geometry, light = view.scene.geometry, view.light
    eye = np.broadcast_to(view.camera.position, directions.shape)
    near, far = view.near_far
    seen = crossings(eye, directions, geometry, geometry.faces)
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
    blockers = crossings(points, to_light, geometry, geometry.faces[caster_of])
    in_the_way = (blockers.t > above[blockers.ray]) & (blockers.t < reach[blockers.ray])
    in_the_way &= caster_of[blockers.triangle] != triangle[blockers.ray]
    lit = np.ones(len(directions), dtype=bool)
    lit[hit[blockers.ray[in_the_way]]] = False
    return receiver, lit | ~receiver


def sampled_pixels(truth: Truth) -> np.ndarray:
    """Flat indices: many within two pixels of an edge, the rest anywhere."""
    code = truth.receivers + truth.visibility
    edges = np.zeros(code.shape, dtype=bool)
    edges[:, 1:] |= code[:, 1:] != code[:, :-1]
    edges[1:] |= code[1:] != code[:-1]
    near = np.flatnonzero(binary_dilation(edges, iterations=2))
    random = np.random.default_rng(7)
    chosen = random.choice(near, min(NEAR_EDGES, len(near)), replace=False)
    return np.unique(np.concatenate([chosen, random.choice(code.size, ANYWHERE, replace=False)]))


def assert_agrees(scene: Scene, size: int, pixel_rays: Callable[[View], tuple[Floats, Floats]]) -> None:
    view = view_of(scene, scene.cameras[0], scene.lights[0], size)
    truth = trace(view, pixel_samples=1)
    pixels = sampled_pixels(truth)
    receiver, lit = brute_force(view, pixel_rays(view)[1][pixels])
    decided = ~truth.undecided.ravel()[pixels]
    assert decided.mean() > 0.95
    assert (receiver & lit & decided).sum() > 100
    assert (receiver & ~lit & decided).sum() > 100
    assert (truth.receivers.ravel()[pixels] == receiver)[decided].all()
    assert ((truth.visibility.ravel()[pixels] == 1) == lit)[decided].all()


@pytest.mark.parametrize("name", ["spot-lamp", "railings"])
def test_builtin_agrees_with_every_triangle_against_every_ray(
    name: str, pixel_rays: Callable[[View], tuple[Floats, Floats]]
) -> None:
    assert_agrees(load_scene(name), 512, pixel_rays)


def test_armadillo_agrees_with_every_triangle_against_every_ray(
    shared_scenes: Path, pixel_rays: Callable[[View], tuple[Floats, Floats]]
) -> None:
    assert_agrees(load_scene(shared_scenes / "armadillo.obj"), 512, pixel_rays)


@pytest.mark.slow
@pytest.mark.parametrize("file", ["armadillo.obj", "retroufo.gltf", "2CylinderEngine.glb", "bgfx_tree.obj"])
def test_mesh_agrees_with_every_triangle_against_every_ray(
    file: str, shared_scenes: Path, pixel_rays: Callable[[View], tuple[Floats, Floats]]
) -> None:
    assert_agrees(load_scene(shared_scenes / file), 1024, pixel_rays)
