"""Camera rays to the visible surfaces and shadow rays to the light, one each, in local coordinates."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from shadowbench.scenes.model import View
from shadowbench.scenes.vectors import Floats, unit
from shadowbench.truths.embree import INFINITE, Tracer
from shadowbench.truths.rays import EDGE_ON, dot

Indices = NDArray[np.intp]
Mask = NDArray[np.bool_]

FACING = 1e-6  # least N·L of a receiver


@dataclass(frozen=True, eq=False)
class Surfaces:
    """The S camera-ray hits on surfaces that receive shadows.

    ray: (S,) index of the ray; triangle: (S,) index of the triangle; point, normal: (3, S), the normal towards the
    camera; across, down: (3, S) derivatives of the point, on its plane, by a pixel to the right and downwards.
    """

    ray: Indices
    triangle: Indices
    point: Floats
    normal: Floats
    across: Floats
    down: Floats


@dataclass(frozen=True, eq=False)
class Lighting:
    """The light at S surface points.

    receives: (S,) bool, whether the surface faces the light and is inside its cone or before its panel; to_light:
    (3, S) unit vectors; distance: (S,) to the light, inf for a directional one; blocker: (S,) distance to the nearest
    caster towards the light, inf for none and where `receives` is False.
    """

    receives: Mask
    to_light: Floats
    distance: Floats
    blocker: Floats


def surfaces(view: View, tracer: Tracer, x: Floats, y: Floats) -> Surfaces:
    """The visible surfaces at (N,) image points, in pixels from the upper left corner."""
    geometry, camera = view.scene.geometry, view.camera
    right, up, back = camera.basis()[:, :, None]
    eye, (near, far) = np.array(camera.position)[:, None], view.near_far
    pixel = 2 * float(np.tan(camera.fov_y / 2)) / view.size
    moves = pixel * right, -pixel * up
    rays = (x - view.size / 2) * moves[0] + (y - view.size / 2) * moves[1] - back
    low, high = geometry.bounds
    gap = float(np.linalg.norm((low + high) / 2 - eye[:, 0]) - np.linalg.norm(high - low) / 2)
    # Rays have length 1 along the view axis; those of distant cameras start near the scene, for float32 precision.
    start = np.maximum(near, gap / np.sqrt(dot(rays, rays)))
    triangle = tracer.nearest((eye + rays * start).T, rays.T, far - start).astype(np.intp)
    ray = np.flatnonzero((triangle >= 0) & geometry.receives[triangle])
    triangle, rays = triangle[ray], rays[:, ray]

    a, b, c = (geometry.vertices.take(geometry.faces[triangle, k], axis=0).T for k in range(3))
    normal = np.cross(b - a, c - a, axis=0)
    normal *= -np.sign(dot(normal, rays)) / np.sqrt(dot(normal, normal))
    slant = np.minimum(dot(normal, rays), -EDGE_ON)
    depth = dot(normal, a - eye) / slant
    # Derivatives of P = eye + t·d, t = N·(A − eye)/(N·d), along the image's axes.
    across, down = (depth * (move - rays * (dot(normal, move) / slant)) for move in moves)
    return Surfaces(ray, triangle, eye + rays * depth, normal, across, down)


def lighting(view: View, casters: Tracer, hits: Surfaces, above: float) -> Lighting:
    """The light at surface points, by a shadow ray each.

    above: height of the rays' origins above the surface, a local length.
    """
    source, w = view.light.homogeneous
    to_light = np.array(source)[:, None] - w * hits.point
    length = np.sqrt(dot(to_light, to_light))
    to_light = to_light / np.maximum(length, np.finfo(float).tiny)
    cosine = dot(hits.normal, to_light)
    receives = cosine > FACING
    if view.light.cos_half_angle > -1:
        axis = unit(view.light.direction)[:, None]
        receives &= -dot(to_light, axis) >= view.light.cos_half_angle
    ahead = above / np.maximum(cosine, FACING)
    reach = np.maximum(length - ahead, 0.0) if w else np.full(len(length), INFINITE)
    beyond = casters.distance((hits.point + to_light * ahead).T, to_light.T, reach)
    blocked = receives & (beyond < reach.astype(np.float32))  # without a hit `distance` returns the reach
    return Lighting(
        receives=receives,
        to_light=to_light,
        distance=length if w else np.full(len(length), np.inf),
        blocker=np.where(blocked, ahead + beyond, np.inf),
    )
