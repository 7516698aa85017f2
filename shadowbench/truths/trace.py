"""The ray-traced truth of a view: how much of the light each receiver sees, and which pixels are undecided."""

from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

from shadowbench.errors import InputError
from shadowbench.files import png_of
from shadowbench.scenes.model import Scene, View
from shadowbench.scenes.vectors import Floats
from shadowbench.truths.embree import over_rows
from shadowbench.truths.rays import GRAZING, Indices, Mask, Receivers, ViewRays, dot

Single = NDArray[np.float32]

OFFSET = 1e-6  # δ, as a share of the diagonal of casters and visible receivers
STANDARD_ERROR = 1 / 255
"""Default standard error of visibility that 95% of a penumbra's pixels stay below."""


@dataclass(frozen=True, eq=False)
class Truth:
    """Ray-traced shadows of a view. All arrays are (height, width), row 0 at the top.

    visibility: share of the light that is seen, 1 lit, 0 in shadow, 1 outside receivers, but 0 where a triangle faces
    away from a light that its smooth normal faces. standard_error: of visibility,
    0 where it is not sampled (see `soft`). irradiance: as visibility, with the light's points weighted by N·ω.
    receivers: the hit faces both camera and the light's centre. undecided: visibility changes within the rasteriser's
    subpixel grid or with the shadow ray's offset (see `hard`, `soft`). area: visibility averaged over the pixel's
    samples that hit receivers. blocker: metres along L to the nearest occluder, inf if none. triangle: index in the
    scene's geometry, −1 for a miss. cosine: N·L, 0 where there is no receiver. diagonal: of the bounding box of casters
    and visible receivers, in metres. L points to the light's centre. view: that was traced, None if unknown. Where a
    surface is smooth (see `terminator`), shading_cosine: Nₛ·L by its smooth normal, where above 0 and it receives, else
    0; facet_shadow: its own triangles take that light; None in scenes of flat surfaces, facet_shadow also under a light
    with a size.
    """

    visibility: Single
    standard_error: Single
    irradiance: Single
    receivers: Mask
    undecided: Mask
    area: Single
    blocker: Single
    triangle: NDArray[np.int32]
    cosine: Single
    diagonal: float
    view: View | None = None
    shading_cosine: Single | None = None
    facet_shadow: Mask | None = None

    @property
    def sampled(self) -> bool:
        """Whether any visibility is an estimate, as under a light with a size."""
        return bool(self.standard_error.any())

    @property
    def facets(self) -> Mask:
        """(height, width) bool: decided pixels of smooth surfaces that their own triangles darken."""
        return np.zeros_like(self.undecided) if self.facet_shadow is None else self.facet_shadow & ~self.undecided

    def __repr__(self) -> str:
        """One line: view, light, and the shares of receivers in shadow and in penumbra."""
        (height, width), lit, view = self.visibility.shape, self.visibility[self.receivers], self.view
        of = "" if view is None else f"{view.scene.name}, {view.camera.name}, {view.light.name} ({view.light.kind}), "
        shadow, penumbra = ((lit < 0.5).sum(), ((lit > 0) & (lit < 1)).sum()) / np.maximum(len(lit), 1)
        parts = f"{len(lit)} receivers, {shadow:.1%} in shadow, {penumbra:.1%} in penumbra"
        return f"<Truth of {of}{width} × {height} pixels, {parts}>"

    def _repr_png_(self) -> bytes:
        """PNG of the visibility, for notebooks; pixels without a receiver are white."""
        return png_of(np.round(self.visibility * 255).astype(np.uint8))

    def arrays(self) -> dict[str, NDArray[Any]]:
        """All fields but the view, and those that are None, as arrays by name, as stored in `truth.npz`."""
        values = {field.name: getattr(self, field.name) for field in fields(self) if field.name != "view"}
        return {name: np.asarray(value) for name, value in values.items() if value is not None}


def trace(view: View, pixel_samples: int = 4, standard_error: float = STANDARD_ERROR) -> Truth:
    """Ray-trace the truth of a view, with `pixel_samples`² samples per pixel for `area`.

    standard_error: that 95% of a penumbra's pixels stay below, unless they reach the limit of 8 · `soft.MOST` rays.
    Raises InputError if no pixel shows the scene.
    """
    placed, placement = view.placed()
    rays = ViewRays(placed)
    triangle, edge_on, diagonal = _visible_triangles(placed, rays)
    delta = OFFSET * diagonal
    if view.light.soft:
        from shadowbench.truths.soft import soft_shadows  # imports Numba, 0.2 s

        arrays = soft_shadows(rays, placed.light, triangle, delta, pixel_samples, standard_error)
    else:
        from shadowbench.truths.hard import hard_shadows

        arrays = hard_shadows(rays, placed.scene.geometry, triangle, delta, pixel_samples)
    arrays["undecided"] |= edge_on
    if placed.scene.geometry.smooth:
        shadowed, receivers = arrays["visibility"] < 0.5, arrays["receivers"]
        smooth = terminator(placed.scene, rays, triangle, shadowed, receivers, delta)
        for name in ("visibility", "irradiance", "area"):
            arrays[name][~receivers & (smooth["shading_cosine"] > 0)] = 0
        if view.light.soft:
            del smooth["facet_shadow"]
        arrays |= smooth
    arrays["blocker"] = (arrays["blocker"] / placement.scale).astype(np.float32)
    arrays["triangle"] = triangle.astype(np.int32)
    images = {name: array.reshape(view.size.shape) for name, array in arrays.items()}
    return Truth(diagonal=diagonal / placement.scale, view=view, **images)


def _visible_triangles(view: View, rays: ViewRays) -> tuple[Indices, Mask, float]:
    """(pixels,) triangle at each pixel's centre, −1 for a miss, and whether it is seen edge-on.

    Also the diagonal of the bounding box of all casters and visible receivers, or of the scene if there are neither.
    """
    geometry = view.scene.geometry

    def trace_rows(rows: slice) -> tuple[Indices, Mask, Floats]:
        lines = rays.camera_rays(rows)
        triangle = rays.nearest(lines)
        seen = np.flatnonzero(triangle >= 0)
        seen = seen[geometry.receives[triangle[seen]]]
        points = rays.points(lines.take(seen), triangle[seen])
        ends = np.stack([points.min(axis=1, initial=np.inf), points.max(axis=1, initial=-np.inf)])
        return triangle, rays.edge_on(lines, triangle), ends

    triangles, edge_on, ends = zip(*over_rows(trace_rows, view.size), strict=True)
    triangle = np.concatenate(triangles)
    if not (triangle >= 0).any():
        raise InputError(f"camera {view.camera.name!r} of {view.scene.name} shows nothing: no pixel shows a triangle")
    low, high = np.min(ends, axis=0)[0], np.max(ends, axis=0)[1]
    if geometry.casts.any():
        casters = geometry.caster_bounds
        low, high = np.minimum(low, casters[0]), np.maximum(high, casters[1])
    if not np.isfinite(low).all():
        low, high = geometry.bounds
    return triangle, np.concatenate(edge_on), float(np.linalg.norm(high - low))


def smooth_points(points: Floats, corners: Floats, corner_normals: Floats, normals: Floats) -> tuple[Floats, Floats]:
    """The smooth surface over (3, N) points of triangles: Hanika's P' = Σ wᵢ (P − min(0, hᵢ) Nᵢ), and Phong's normal.

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
    return points - lift, mean * side / np.sqrt(dot(mean, mean))


def terminator(
    scene: Scene, rays: ViewRays, triangle: Indices, shadowed: Mask, receivers: Mask, delta: float
) -> dict[str, NDArray[Any]]:
    """Truth's `shading_cosine` and `facet_shadow`, flattened, of a scene with smooth surfaces.

    A facet's shadow (Woo, Pearce and Ouellette 1996, "It's really not a rendering bug, you see…") is one that a
    triangle casts on itself or on another of its mesh, where a ray from the smooth surface reaches the light (Hanika
    2021, "Hacking the shadow terminator"). triangle: (pixels,), −1 for a miss; shadowed, receivers: (size²,) bool.
    """
    geometry = scene.geometry
    mesh = np.repeat(np.arange(len(scene.meshes)), [len(each.faces) for each in scene.meshes])
    smooth = np.array([each.receives and each.normals is not None for each in scene.meshes])[mesh]

    def trace_rows(rows: slice) -> tuple[NDArray[np.float32], Mask]:
        part = slice(rows.start * rays.size.width, rows.stop * rays.size.width)
        hit = triangle[part]
        seen = np.flatnonzero((hit >= 0) & smooth[hit])
        own, point = hit[seen], rays.points(rays.camera_rays(rows).take(seen), hit[seen])
        to_light, distance = rays.toward_light(point)
        normals = rays.normals(own)
        flat = Receivers(seen, own, point, to_light, distance, dot(normals, to_light))
        each, which = np.unique(own, return_inverse=True)
        shape = geometry.select(each)
        corners = shape.vertices.reshape(-1, 3, 3)[which], shape.shading_normals[which].astype(np.float64)
        position, normal = smooth_points(point, *corners, normals)
        shading = np.where(rays.in_cone(to_light), dot(normal, to_light), 0.0)
        cosine, facets = np.zeros(len(hit), dtype=np.float32), np.zeros(len(hit), dtype=np.bool_)
        cosine[seen] = np.clip(shading, 0.0, 1.0)
        dark = np.flatnonzero((shading > GRAZING) & (shadowed | ~receivers)[part][seen])
        lifted = position[:, dark]
        to_light, distance = rays.toward_light(lifted)
        smooth_rays = flat.select(dark)._replace(
            point=lifted, to_light=to_light, distance=distance, cosine=shading[dark]
        )
        free = dark[~rays.occluded(rays.shadow_rays(smooth_rays, delta))]
        facets[seen[free]] = True
        faced = flat.select(free[receivers[part][seen[free]]])
        nearest, _ = rays.nearest_casters(faced, delta)
        facets[faced.rays] = (nearest < 0) | (mesh[nearest] == mesh[faced.triangle])
        return cosine, facets

    cosine, facets = zip(*over_rows(trace_rows, rays.size), strict=True)
    return {"shading_cosine": np.concatenate(cosine), "facet_shadow": np.concatenate(facets)}
