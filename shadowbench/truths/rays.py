"""Camera rays of a view and the shadow rays from their hits to the light.

Float64 in local coordinates; Embree's float32 only selects triangles. Vectors are (3, N), one row per component, on
which NumPy is several times faster than on (N, 3).
"""

from collections.abc import Sequence
from itertools import product
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from shadowbench.scenes.model import View
from shadowbench.scenes.vectors import Floats, unit
from shadowbench.truths.embree import INFINITE, Tracer, tracer_of

Mask = NDArray[np.bool_]
Indices = NDArray[np.intp]

FROM_LIGHT = 2.0  # local distance of the light from the centre up to which shadow rays are traced from the light
BESIDE_LAMP = 4e-6  # local distance from the lamp, beyond which no rounding changes a caster's side of it
EDGE_ON = 1e-6  # |N·ray| below which a hit cannot be refined
GRAZING = 1e-4  # N·L up to which a receiver is undecided
LOW_LIGHT = 0.1  # N·L below which a shadow ray starts so far along L, 10 δ or more, that it may miss low casters
SUBPIXEL = 1 / 256  # pixels; the subpixel grid of common rasterisers
SUBPIXEL_OFFSETS = tuple(product((0.5 - SUBPIXEL, 0.5 + SUBPIXEL), repeat=2))


class CameraRays(NamedTuple):
    """Rays through pixels, of N: (3, N) origins and directions, (3, 1) where shared; the parameter is view depth."""

    origins: Floats
    directions: Floats

    def take(self, chosen: Indices) -> "CameraRays":
        """The chosen rays."""
        return CameraRays(*(each if each.shape[1] == 1 else each.take(chosen, axis=1) for each in self))


class ShadowRays(NamedTuple):
    """Rays from points near surfaces to the light: (3, N) origins; (3, N) directions, or (3, 1) if shared.

    offset: (N,) distance of the origin from the surface along L; reach: from the origin to the light, (N,) or a number.
    """

    origins: Floats
    directions: Floats
    offset: Floats
    reach: Floats | float


class Receivers(NamedTuple):
    """Hits on surfaces that face both the camera and the light.

    rays: (R,) index of each camera ray; to_light: (3, R) unit vectors, (3, 1) for a directional light; distance: to the
    light, (R,) or a number; cosine: N·L.
    """

    rays: Indices
    triangle: Indices
    point: Floats
    to_light: Floats
    distance: Floats | float
    cosine: Floats

    def select(self, chosen: Mask | Indices | slice) -> "Receivers":
        """The selected subset; chosen: (R,) bool, indices or a slice."""
        index, own = np.arange(len(self.rays))[chosen], set(self._fields) - set(self._shared)
        return self._replace(**{name: getattr(self, name).take(index, axis=-1) for name in own})

    @property
    def _shared(self) -> tuple[str, ...]:
        return ("to_light", "distance") if isinstance(self.distance, float) else ()

    @classmethod
    def concatenate(cls, parts: "Sequence[Receivers]") -> "Receivers":
        """Concatenation of receivers of one view."""
        first = parts[0]
        of_each = {name: [getattr(part, name) for part in parts] for name in cls._fields if name not in first._shared}
        return first._replace(**{name: np.concatenate(values, axis=-1) for name, values in of_each.items()})


class ViewRays:
    """Camera and shadow rays of a view in local coordinates."""

    def __init__(self, view: View) -> None:
        self.size = view.size
        self._near, self._far = view.near_far
        geometry = view.scene.geometry
        casters = geometry.caster_faces, geometry.caster_cutouts
        self._all = tracer_of(geometry)
        self.casters = self._all if geometry.casts.all() else Tracer(geometry.vertices, *casters)
        self._numbers = np.append(np.flatnonzero(geometry.casts), -1)  # the last entry is that of index −1, a miss

        camera = view.camera
        self._right, self._up, back = camera.basis()[:, :, None]
        self._ahead, self._slope, self._half = -back, camera.slope, camera.height / 2
        self._position = np.array(camera.position)[:, None]
        self.eye = np.array(camera.eye)
        low, high = geometry.bounds
        middle = (low + high) / 2 - self._position[:, 0]
        away = np.linalg.norm(middle) if camera.converging else self._ahead[:, 0] @ middle
        self._gap = float(away - np.linalg.norm(high - low) / 2)

        light, w = view.light.homogeneous
        self.directional = w == 0
        self._light = np.array(light)[:, None]
        # In float32 relative to the light, casters keep their direction from the light, however close to it they are.
        self._from_light: Tracer | None = None
        self._beside_lamp = np.empty((0, 3))
        if not self.directional and np.abs(light).max() < FROM_LIGHT:
            from_light = geometry.vertices - self._light[:, 0]
            self._from_light = Tracer(from_light, *casters)
            self._beside_lamp = _of_unsure_side(from_light, geometry.caster_faces)
        self._axis = unit(view.light.direction)[:, None]
        self._cos_half_angle = view.light.cos_half_angle

        # The eye sees one side of each plane, so normals are flipped towards the camera here rather than for each hit.
        normals, corners = geometry.normals.T, geometry.vertices[geometry.faces[:, 0]].T
        level = dot(normals, corners)
        facing = np.sign(dot(normals, self.eye[:3, None]) - camera.converging * level)
        self._level = level * facing  # of each plane along its normal
        self._normals = np.ascontiguousarray(normals * facing)
        self._receives = np.append(geometry.receives, False)  # the last entry is that of index −1, a miss
        if self.directional:
            self._cosines = dot(self._normals, self._light)
            self._receives[:-1] &= self._cosines > 0

    def camera_rays(self, rows: slice, across: float = 0.5, down: float = 0.5) -> CameraRays:
        """The rays through a point of each pixel of some rows."""
        width, height = self.size
        x = (np.arange(width) + across) * (2 / height) - width / height
        y = 1 - (np.arange(rows.start, rows.stop) + down) * (2 / height)

        def grid(middle: Floats, reach: float) -> Floats:
            row = middle + x * (self._right * reach)
            points: Floats = row[:, None, :] + (y * (self._up * reach))[:, :, None]
            return points.reshape(3, -1) if reach else middle

        return CameraRays(grid(self._position, self._half), grid(self._ahead, self._slope))

    def nearest(self, rays: CameraRays) -> Indices:
        """(N,) nearest triangle on each camera ray between the near and far planes, −1 if none."""
        # For a camera far away, starting near the scene preserves float32 precision.
        start: Floats | float = self._near
        if self._gap > self._near:
            start = np.maximum(self._near, self._gap / np.sqrt(dot(rays.directions, rays.directions)))
        starts = rays.origins + rays.directions * start
        hits = self._all.hits(starts.T, rays.directions.T, self._far - start)
        return hits.triangle.astype(np.intp)

    def normals(self, triangle: Indices) -> Floats:
        """(3, N) unit normals of triangles, turned towards the camera."""
        return self._normals.take(triangle, axis=1)

    def edge_on(self, rays: CameraRays, triangle: Indices) -> Mask:
        """(N,) whether a ray hits its triangle at so grazing an angle that the hit cannot be refined."""
        flat: Mask = dot(self.normals(triangle), rays.directions) > -EDGE_ON
        return flat & (triangle >= 0)

    def points(self, rays: CameraRays, triangle: Indices) -> Floats:
        """(3, N) float64 intersections of rays with the planes of their triangles."""
        normals = self.normals(triangle)
        below = self._level.take(triangle) - dot(normals, rays.origins)  # along the normal, from the ray's origin
        depth = below / np.minimum(dot(normals, rays.directions), -EDGE_ON)
        return rays.origins + rays.directions * np.clip(depth, self._near, self._far)

    def receivers(self, rays: CameraRays, triangle: Indices) -> Receivers:
        """The receivers among ray hits; triangle: (N,) hit by each ray, −1 for a miss."""
        index = np.flatnonzero(self._receives.take(triangle))
        triangle = triangle.take(index)
        point = self.points(rays.take(index), triangle)
        if self.directional:
            return Receivers(index, triangle, point, self._light, INFINITE, self._cosines.take(triangle))
        to_light, distance = self.toward_light(point)
        cosine = dot(self.normals(triangle), to_light)
        found = Receivers(index, triangle, point, to_light, distance, cosine)
        return found.select(np.flatnonzero((cosine > 0) & self.in_cone(to_light)))

    def shadow_rays(self, receivers: Receivers, delta: float) -> ShadowRays:
        """Shadow rays offset along L to a height δ; an offset along N would shift shadows by δ/tan(elevation)."""
        offset = delta / receivers.cosine
        origins = receivers.point + receivers.to_light * offset
        # A light within the offset leaves a ray of length 0.
        reach = INFINITE if self.directional else np.maximum(receivers.distance - offset, 0.0)
        return ShadowRays(origins, receivers.to_light, offset, reach)

    def normal_offset_rays(self, receivers: Receivers, delta: float) -> ShadowRays:
        """Shadow rays offset by δ along N."""
        origins = receivers.point + self.normals(receivers.triangle) * delta
        to_light, distance = self.toward_light(origins)
        return ShadowRays(origins, to_light, np.zeros(len(receivers.rays)), distance)

    def occluded(self, rays: ShadowRays) -> Mask:
        """(N,) whether a caster blocks each ray."""
        if self._from_light is not None:
            ends = rays.origins - self._light + rays.directions * rays.reach
            return self._from_light.occluded(ends.T, -rays.directions.T, rays.reach)
        return self.casters.occluded(rays.origins.T, rays.directions.T, rays.reach)

    def lamp_error(self, rays: ShadowRays) -> Floats | float:
        """(N,) distance along each ray by which float32 may put a caster on the other side of the lamp, often 0."""
        across = np.abs(self._beside_lamp @ rays.directions)
        return 1 / np.maximum(across, 1.0).min(axis=0) if len(across) else 0.0

    def nearest_casters(self, receivers: Receivers, delta: float) -> tuple[Indices, Floats]:
        """(R,) triangle of the nearest caster along L from each receiver, −1 if none, and its distance."""
        rays = self.shadow_rays(receivers, delta)
        hits = self.casters.hits(rays.origins.T, rays.directions.T, rays.reach)
        return self._numbers[hits.triangle], rays.offset + hits.distance.astype(np.float64)

    def in_cone(self, to_light: Floats) -> Mask:
        """(N,) whether points in (3, N) directions towards the light are in its cone, before its panel."""
        inside: Mask = -dot(to_light, self._axis) >= self._cos_half_angle
        return inside if self._cos_half_angle > -1 else np.ones_like(inside)

    def toward_light(self, points: Floats) -> tuple[Floats, Floats | float]:
        """Unit vectors (3, N) from points to the light, (3, 1) to a directional one, and (N,) distances or a number."""
        if self.directional:
            return self._light, INFINITE
        to_light = self._light - points
        distance = np.sqrt(dot(to_light, to_light))
        to_light /= np.maximum(distance, np.finfo(float).tiny)
        return to_light, distance


def _of_unsure_side(vertices: Floats, faces: NDArray[np.int32]) -> Floats:
    """(K, 3) normals of planes at the origin within float32's error, each divided by that error."""
    near = np.ones(len(faces), dtype=bool)
    for along in vertices.T:
        near &= (along[faces].min(axis=1) <= BESIDE_LAMP) & (along[faces].max(axis=1) >= -BESIDE_LAMP)
    corners = vertices[faces[near]]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    products = corners * normals[:, None]
    # Float32 rounds away up to its epsilon times the products' magnitudes; 4 allows for the corners and the normal.
    error = 4 * np.finfo(np.float32).eps * np.abs(products).sum(axis=2).max(axis=1)
    unsure = np.abs(products[:, 0].sum(axis=1)) <= error
    return np.unique(normals[unsure] / np.maximum(error[unsure, None], np.finfo(float).tiny), axis=0)


def dot(a: Floats, b: Floats) -> Floats:
    """(N,) dot products of two (3, N); either may be (3, 1)."""
    product: Floats = np.einsum("ij,ij->j", a, b)
    return product
