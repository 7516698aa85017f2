"""What triangles take of the light of the smooth surface that they stand for, along its terminator.

A surface is shaded by its smooth normal Nₛ and shadowed by flat triangles. Near the terminator, where Nₛ·L falls to 0,
triangles face away from a light that Nₛ still faces, or lie in the shadow of their neighbours: dark facets on a surface
that should be round (Woo, Pearce and Ouellette 1996, "It's really not a rendering bug, you see…"). A pixel's shadow is
such a facet's if a ray from the point P' on the smooth surface reaches the light (Hanika 2021, "Hacking the shadow
terminator"), and the ray from the triangle is blocked by the triangle itself or by another of its mesh.
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from shadowbench.scenes.model import Scene
from shadowbench.truths.embree import over_slices, rows_a_slice
from shadowbench.truths.rays import GRAZING, Indices, Mask, Receivers, ViewRays, dot

Floats = NDArray[np.float64]


class SmoothPoints(NamedTuple):
    """Points of the smooth surface over N points of triangles: (3, N) positions and unit normals towards the eye."""

    position: Floats
    normal: Floats


def smooth_points(points: Floats, corners: Floats, corner_normals: Floats, normals: Floats) -> SmoothPoints:
    """The smooth surface over (3, N) points of triangles: Phong's normal, and Hanika's P' = Σ wᵢ (P − min(0, hᵢ) Nᵢ).

    corners, corner_normals: (N, 3, 3) of the triangles; normals: (3, N), towards the eye; w: barycentric weights, hᵢ =
    (P − Vᵢ)·Nᵢ the height over the tangent plane at a corner. With a normal away from the eye all of them are turned.
    """
    away = points.T[:, np.newaxis] - corners
    areas = np.stack([dot(np.cross(away[:, k - 2], away[:, k - 1]).T, normals) for k in range(3)], axis=1)
    weights = areas / areas.sum(axis=1, keepdims=True)
    mean = np.einsum("nk,nki->in", weights, corner_normals)
    side = np.where(dot(mean, normals) < 0.0, -1.0, 1.0)
    turned = corner_normals * side[:, np.newaxis, np.newaxis]
    depth = np.minimum(np.einsum("nki,nki->nk", away, turned), 0.0)
    lift = np.einsum("nk,nki->in", weights * depth, turned)
    return SmoothPoints(points - lift, mean * side / np.sqrt(dot(mean, mean)))


def terminator(
    scene: Scene, rays: ViewRays, triangle: Indices, shadowed: Mask, receivers: Mask, delta: float
) -> dict[str, NDArray[Any]]:
    """Truth's `shading_cosine` and `facet_shadow`, flattened, of a scene with smooth surfaces.

    triangle: (size²,), −1 for a miss; shadowed, receivers: (size²,) bool, by the light's centre.
    """
    geometry = scene.geometry
    ends = np.cumsum([len(each.faces) for each in scene.meshes])
    smooth = np.array([each.receives and each.normals is not None for each in scene.meshes])

    def mesh_of(triangles: Indices) -> Indices:
        mesh: Indices = np.searchsorted(ends, triangles, side="right")
        return mesh

    def trace_rows(rows: slice) -> tuple[NDArray[np.float32], Mask]:
        part = slice(rows.start * rays.size, rows.stop * rays.size)
        hit = triangle[part]
        seen = np.flatnonzero((hit >= 0) & smooth[mesh_of(hit)])
        own, point = hit[seen], rays.points(rays.directions(rows).take(seen, axis=1), hit[seen])
        to_light, distance = rays.toward_light(point)
        normals = rays.normals(own)
        flat = Receivers(seen, own, point, to_light, distance, dot(normals, to_light))
        each, which = np.unique(own, return_inverse=True)
        shape = geometry.select(each)
        corners = shape.vertices.reshape(-1, 3, 3)[which], shape.shading_normals[which].astype(np.float64)
        surface = smooth_points(point, *corners, normals)
        shading = np.where(rays.in_cone(to_light), dot(surface.normal, to_light), 0.0)
        cosine, facets = np.zeros(len(hit), dtype=np.float32), np.zeros(len(hit), dtype=np.bool_)
        cosine[seen] = np.clip(shading, 0.0, 1.0)
        dark = np.flatnonzero((shading > GRAZING) & (shadowed | ~receivers)[part][seen])
        lifted = surface.position[:, dark]
        to_light, distance = rays.toward_light(lifted)
        smooth_rays = flat.select(dark)._replace(
            point=lifted, to_light=to_light, distance=distance, cosine=shading[dark]
        )
        free = dark[~rays.occluded(rays.shadow_rays(smooth_rays, delta))]
        facets[seen[free]] = True
        faced = flat.select(free[receivers[part][seen[free]]])
        nearest = rays.nearest_casters(faced, delta)
        facets[faced.rays] = (nearest < 0) | (mesh_of(nearest) == mesh_of(faced.triangle))
        return cosine, facets

    cosine, facets = zip(*over_slices(trace_rows, rays.size, rows_a_slice(rays.size)), strict=True)
    return {"shading_cosine": np.concatenate(cosine), "facet_shadow": np.concatenate(facets)}
