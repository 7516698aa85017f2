"""Rays through points of the picture to surfaces, and from there to the light: one each, in local coordinates."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from shadowbench.scenes.model import Floats, View, unit
from shadowbench.truths.embree import NEVER, Tracer
from shadowbench.truths.rays import EDGE_ON, dot

Indices = NDArray[np.intp]
Mask = NDArray[np.bool_]

FACING = 1e-6  # N·L from which a surface receives


@dataclass(frozen=True, eq=False)
class Surfaces:
    """What rays meet, S of them that receive, N turned to the camera.

    ray: (S,) index of each in the rays; triangle: (S,); point, normal: (3, S); across, down: (3, S) how the point moves
    on its plane for a pixel to the right and downwards.
    """

    ray: Indices
    triangle: Indices
    point: Floats
    normal: Floats
    across: Floats
    down: Floats


@dataclass(frozen=True, eq=False)
class Lighting:
    """What surfaces get of the light.

    receives: (S,) bool, they face it and are in its cone; to_light: (3, S) unit; distance: (S,) to it, inf for a
    directional one; blocker: (S,) distance to the nearest caster on the way, inf for none and where nothing receives.
    """

    receives: Mask
    to_light: Floats
    distance: Floats
    blocker: Floats


def surfaces(view: View, tracer: Tracer, x: Floats, y: Floats) -> Surfaces:
    """What is seen at (N,) points of the picture, in pixels from its upper left corner."""
    geometry, camera = view.scene.geometry, view.camera
    right, up, back = camera.basis()[:, :, None]
    eye, (near, far) = np.array(camera.position)[:, None], view.near_far
    pixel = 2 * float(np.tan(camera.fov_y / 2)) / view.size
    moves = pixel * right, -pixel * up
    rays = (x - view.size / 2) * moves[0] + (y - view.size / 2) * moves[1] - back
    low, high = geometry.bounds
    gap = float(np.linalg.norm((low + high) / 2 - eye[:, 0]) - np.linalg.norm(high - low) / 2)
    # Every ray has length 1 along the view's axis; those of far cameras start near the scene, to be exact in float32.
    start = np.maximum(near, gap / np.sqrt(dot(rays, rays)))
    triangle = tracer.nearest((eye + rays * start).T, rays.T, far - start).astype(np.intp)
    ray = np.flatnonzero((triangle >= 0) & geometry.receives[triangle])
    triangle, rays = triangle[ray], rays[:, ray]

    a, b, c = (geometry.vertices.take(geometry.faces[triangle, k], axis=0).T for k in range(3))
    normal = np.cross(b - a, c - a, axis=0)
    normal *= -np.sign(dot(normal, rays)) / np.sqrt(dot(normal, normal))
    slant = np.minimum(dot(normal, rays), -EDGE_ON)
    depth = dot(normal, a - eye) / slant
    # P = eye + t·d with t = N·(A − eye)/(N·d), derived along the image's axes.
    across, down = (depth * (move - rays * (dot(normal, move) / slant)) for move in moves)
    return Surfaces(ray, triangle, eye + rays * depth, normal, across, down)


def lighting(view: View, casters: Tracer, met: Surfaces, above: float) -> Lighting:
    """What surfaces get of the view's light, by a ray each from a local length above them."""
    source, w = view.light.homogeneous
    way = np.array(source)[:, None] - w * met.point
    length = np.sqrt(dot(way, way))
    to_light = way / np.maximum(length, np.finfo(float).tiny)
    cosine = dot(met.normal, to_light)
    receives = cosine > FACING
    if view.light.kind == "spot":
        axis = unit(view.light.direction)[:, None]
        receives &= -dot(to_light, axis) >= view.light.cos_half_angle
    ahead = above / np.maximum(cosine, FACING)
    reach = np.maximum(length - ahead, 0.0) if w else np.full(len(length), NEVER)
    left = casters.distance((met.point + to_light * ahead).T, to_light.T, reach)
    blocked = receives & (left < reach.astype(np.float32))  # `distance` answers the reach itself for none
    return Lighting(
        receives=receives,
        to_light=to_light,
        distance=length if w else np.full(len(length), np.inf),
        blocker=np.where(blocked, ahead + left, np.inf),
    )
