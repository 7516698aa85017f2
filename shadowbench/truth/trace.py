"""The ray-traced truth of a view: which receivers see the light, and which pixels nobody can decide.

Rays are made and hits refined in float64; Embree's float32 only chooses triangles. A shadow ray starts on the true
ray to the light, P + L·δ/(N·L), which is δ above the surface: an offset along N instead would slide every shadow by
δ/tan(elevation).
"""

from dataclasses import dataclass, fields
from itertools import product

import numpy as np
from numpy.typing import NDArray

from shadowbench.errors import InputError
from shadowbench.scenes.model import Floats, View
from shadowbench.truth.embree import NEVER, Tracer, over_slices

Mask = NDArray[np.bool_]
Single = NDArray[np.float32]

OFFSET = 1e-6  # δ, as a share of the diagonal of casters and visible receivers
GRAZING = 1e-4  # N·L up to which a receiver is undecided
EDGE_ON = 1e-6  # |N·ray| below which a hit cannot be refined
SUBPIXEL = 1 / 256  # the rasteriser's grid, as common as it is


@dataclass(frozen=True, eq=False)
class Truth:
    """What a view's shadows are. All arrays are (size, size), row 0 at the top.

    visibility: float32, 1 lit, 0 in shadow, 1 outside receivers. receivers: bool, the hit faces both camera and light.
    undecided: bool, the answer hangs on less than the rasteriser's grid or the ray's offset. area: float32, visibility
    averaged over the pixel's samples that hit receivers. blocker: float32 metres along L to the nearest occluder, inf
    where there is none. triangle: int32 index in the scene's geometry, −1 a miss. cosine: float32 N·L, 0 outside
    receivers. diagonal: metres, of casters and visible receivers.
    """

    visibility: Single
    receivers: Mask
    undecided: Mask
    area: Single
    blocker: Single
    triangle: NDArray[np.int32]
    cosine: Single
    diagonal: float

    def arrays(self) -> dict[str, NDArray[np.generic]]:
        """Everything by name, as `truth.npz` holds it."""
        return {field.name: np.asarray(getattr(self, field.name)) for field in fields(self)}


@dataclass(frozen=True, eq=False)
class _Hits:
    """Primary hits of some rays: index into them, triangle, point, normal turned to the camera, edge-on or not."""

    rays: NDArray[np.intp]
    triangle: NDArray[np.int32]
    point: Floats
    normal: Floats
    edge_on: Mask


@dataclass(frozen=True, eq=False)
class _Lit:
    """Shading of hits: direction and distance to the light, N·L, and whether each is a receiver at all."""

    to_light: Floats
    distance: Floats
    cosine: Floats
    receiver: Mask


class _Tracing:
    """One view in local coordinates, with its two Embree scenes."""

    def __init__(self, view: View) -> None:
        self.view = view
        geometry = view.scene.geometry
        self.normals = geometry.normals
        self.plane = np.einsum("ij,ij->i", self.normals, geometry.vertices[geometry.faces[:, 0]])
        self.receives = geometry.receives
        self.all = Tracer(geometry.vertices, geometry.faces)
        whole = len(geometry.caster_faces) == len(geometry.faces)
        self.casters = self.all if whole else Tracer(geometry.vertices, geometry.caster_faces)

        camera = view.camera
        right, up, back = camera.basis()
        slope = np.tan(camera.fov_y / 2)
        self.right, self.up, self.forward = right * slope, up * slope, -back
        self.eye = np.asarray(camera.position)
        low, high = geometry.bounds
        self.gap = float(np.linalg.norm((low + high) / 2 - self.eye) - np.linalg.norm(high - low) / 2)
        self.light, self.light_w = (np.asarray(part) for part in view.light.homogeneous)
        self.axis = np.asarray(view.light.direction) / np.linalg.norm(view.light.direction)

    def rays(self, pixels: slice, across: float = 0.5, down: float = 0.5) -> Floats:
        """(N, 3) directions through a point of each pixel, of length 1 along the view's axis: t is the view depth."""
        row, column = np.divmod(np.arange(pixels.start, pixels.stop), self.view.size)
        x = (column + across) * (2 / self.view.size) - 1
        y = 1 - (row + down) * (2 / self.view.size)
        return self.forward + x[:, None] * self.right + y[:, None] * self.up

    def hits(self, directions: Floats) -> _Hits:
        """What the rays from the eye meet between the camera's planes."""
        near, far = self.view.near_far
        # Starting near the scene keeps the float32 origin exact for cameras far away.
        start = np.maximum(near, self.gap / np.linalg.norm(directions, axis=1))
        triangle = self.all.nearest(self.eye + directions * start[:, None], directions, far - start)
        rays = np.flatnonzero(triangle >= 0)
        return self.refined(rays, triangle[rays], directions[rays])

    def refined(self, rays: NDArray[np.intp], triangle: NDArray[np.int32], directions: Floats) -> _Hits:
        """The hits moved, in float64, to where the true rays meet the planes of their triangles."""
        near, far = self.view.near_far
        normal = self.normals[triangle]
        toward = np.einsum("ij,ij->i", normal, directions)
        edge_on = np.abs(toward) < EDGE_ON
        depth = (self.plane[triangle] - normal @ self.eye) / np.where(edge_on, EDGE_ON, toward)
        point = self.eye + directions * np.clip(depth, near, far)[:, None]
        return _Hits(rays, triangle, point, normal * -np.sign(toward)[:, None], edge_on)

    def lit(self, hits: _Hits) -> _Lit:
        """How the light meets the hits."""
        to_light = self.light - self.light_w * hits.point
        distance = np.sqrt(np.einsum("ij,ij->i", to_light, to_light))
        to_light = to_light / np.maximum(distance, np.finfo(float).tiny)[:, None]
        cosine = np.einsum("ij,ij->i", hits.normal, to_light)
        receiver = self.receives[hits.triangle] & (cosine > 0)
        if self.view.light.kind == "spot":
            receiver &= -(to_light @ self.axis) >= self.view.light.cos_half_angle
        if self.light_w == 0:
            distance = np.full_like(distance, NEVER)
        return _Lit(to_light, distance, cosine, receiver)

    def blocked(self, hits: _Hits, lit: _Lit, delta: float, along_normal: bool = False) -> Mask:
        """Whether a caster stands between each receiver and the light; False where there is no receiver."""
        blocked = np.zeros(len(hits.rays), dtype=bool)
        chosen = np.flatnonzero(lit.receiver)
        point, to_light, reach = hits.point[chosen], lit.to_light[chosen], lit.distance[chosen]
        if along_normal:
            point = point + hits.normal[chosen] * delta
        else:
            offset = delta / lit.cosine[chosen]
            point, reach = point + to_light * offset[:, None], reach - offset
        room = reach > 0
        blocked[chosen[room]] = self.casters.occluded(point[room], to_light[room], reach[room])
        return blocked

    def answer(self, pixels: slice, across: float, down: float, delta: float) -> tuple[Mask, Mask]:
        """(receiver, visible) at one point of each pixel."""
        hits = self.hits(self.rays(pixels, across, down))
        lit = self.lit(hits)
        receiver = np.zeros(pixels.stop - pixels.start, dtype=bool)
        visible = np.ones_like(receiver)
        receiver[hits.rays] = lit.receiver
        visible[hits.rays] = ~self.blocked(hits, lit, delta)
        return receiver, visible


def trace(view: View, pixel_samples: int = 4, light_samples: int = 1) -> Truth:
    """The truth of a view, `pixel_samples`² samples a pixel for `area`.

    Lights are hard for now: every light sample is the light's centre, so their number changes nothing. Raises
    InputError when no pixel of the view shows the scene.
    """
    if pixel_samples < 1 or light_samples < 1:
        raise InputError(f"pixel_samples {pixel_samples}, light_samples {light_samples}: allowed are 1 and more")
    placed, placement = view.placed()
    tracing = _Tracing(placed)
    count = view.size**2

    def primary(pixels: slice) -> tuple[NDArray[np.int32], Floats]:
        hits = tracing.hits(tracing.rays(pixels))
        triangle = np.full(pixels.stop - pixels.start, -1, dtype=np.int32)
        triangle[hits.rays] = hits.triangle
        return triangle, np.concatenate([hits.point.min(axis=0, initial=np.inf), hits.point.max(axis=0, initial=-np.inf)])

    first = list(over_slices(primary, count))
    triangle = np.concatenate([part for part, _ in first])
    if not (triangle >= 0).any():
        raise InputError(f"camera {view.camera.name!r} of {view.scene.name} looks at nothing: no pixel shows a triangle")
    diagonal = _diagonal(placed, np.array([extent for _, extent in first]))
    delta = OFFSET * diagonal

    def decide(pixels: slice) -> dict[str, NDArray[np.generic]]:
        return _decide(tracing, pixels, triangle[pixels], delta, pixel_samples)

    parts = list(over_slices(decide, count))
    shape = (view.size, view.size)
    arrays = {name: np.concatenate([part[name] for part in parts]).reshape(shape) for name in parts[0]}
    arrays["blocker"] = (arrays["blocker"] / placement.scale).astype(np.float32)
    return Truth(triangle=triangle.reshape(shape), diagonal=diagonal / placement.scale, **arrays)  # type: ignore[arg-type]


def _diagonal(view: View, visible: Floats) -> float:
    """Of the box around all casters and the visible points; `visible` (N, 6) lowest and highest corners of parts."""
    geometry = view.scene.geometry
    low, high = visible[:, :3].min(axis=0), visible[:, 3:].max(axis=0)
    if len(geometry.caster_faces):
        casters = geometry.vertices[np.unique(geometry.caster_faces)]
        low, high = np.minimum(low, casters.min(axis=0)), np.maximum(high, casters.max(axis=0))
    return float(np.linalg.norm(high - low))


def _decide(
    tracing: _Tracing, pixels: slice, triangle: NDArray[np.int32], delta: float, pixel_samples: int
) -> dict[str, NDArray[np.generic]]:
    """All of Truth's per-pixel arrays for a run of pixels, flat and in local lengths."""
    size = pixels.stop - pixels.start
    directions = tracing.rays(pixels)
    rays = np.flatnonzero(triangle >= 0)
    hits = tracing.refined(rays, triangle[rays], directions[rays])
    lit = tracing.lit(hits)
    blocked = tracing.blocked(hits, lit, delta)

    unsure = hits.edge_on | (lit.receiver & ((lit.cosine <= GRAZING) | (2 * delta > lit.distance * lit.cosine)))
    for other in (
        tracing.blocked(hits, lit, 4 * delta),
        tracing.blocked(hits, lit, delta / 4),
        tracing.blocked(hits, lit, delta, along_normal=True),
    ):
        unsure |= other != blocked

    receivers, visible, undecided = (np.zeros(size, dtype=bool) for _ in range(3))
    receivers[rays], visible[:], undecided[rays] = lit.receiver, True, unsure
    visible[rays] = ~blocked
    for across, down in product((0.5 - SUBPIXEL, 0.5 + SUBPIXEL), repeat=2):
        moved_receiver, moved_visible = tracing.answer(pixels, across, down, delta)
        undecided |= (moved_receiver != receivers) | (moved_visible != visible)

    counted, seen = np.zeros(size, dtype=np.int32), np.zeros(size, dtype=np.int32)
    steps = (np.arange(pixel_samples) + 0.5) / pixel_samples
    for across, down in product(steps, repeat=2):
        sample_receiver, sample_visible = tracing.answer(pixels, float(across), float(down), delta)
        counted += sample_receiver
        seen += sample_receiver & sample_visible
    area = np.where(receivers & (counted > 0), seen / np.maximum(counted, 1), visible)

    blocker = np.full(size, np.inf)
    chosen = np.flatnonzero(blocked)
    offset = delta / lit.cosine[chosen]
    origins = hits.point[chosen] + lit.to_light[chosen] * offset[:, None]
    blocker[rays[chosen]] = offset + tracing.casters.distance(
        origins, lit.to_light[chosen], lit.distance[chosen] - offset
    )
    cosine = np.zeros(size)
    cosine[rays] = np.where(lit.receiver, lit.cosine, 0.0)
    return {
        "visibility": visible.astype(np.float32),
        "receivers": receivers,
        "undecided": undecided,
        "area": area.astype(np.float32),
        "blocker": blocker,
        "cosine": cosine.astype(np.float32),
    }
