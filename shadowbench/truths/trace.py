"""The ray-traced truth of a view: which receivers see the light, and which pixels are undecided.

A pixel is undecided if its visibility changes within the rasteriser's subpixel grid or with the shadow ray's offset δ.
Under grazing light a shadow ray starts so far along L that it misses casters lower than δ; these are found by tests
from the surface itself (`near`), which are made for N·L below LOW_LIGHT only. Above it, a receiver counts as lit even
if a caster lower than δ/4 above its plane, at most 2.5 δ along L, blocks it.
"""

from dataclasses import dataclass, fields
from itertools import product

import numpy as np
from numpy.typing import NDArray

from shadowbench.errors import InputError
from shadowbench.files import png_of
from shadowbench.scenes.geometry import bounds_of, used_by
from shadowbench.scenes.model import Floats, View
from shadowbench.truths.embree import RAYS_A_SLICE, over_slices
from shadowbench.truths.near import NearCasters
from shadowbench.truths.rays import Indices, Mask, Receivers, ShadowRays, ViewRays

Single = NDArray[np.float32]

OFFSET = 1e-6  # δ, as a share of the diagonal of casters and visible receivers
LAMP_MARGIN = 1e-3  # share of δ: a caster this close to a lamp may be before or behind it
GRAZING = 1e-4  # N·L up to which a receiver is undecided
LOW_LIGHT = 0.1  # N·L below which casters before the shadow ray's start, then 10 δ or more along L, are tested too
NO_RECEIVER, SHADOWED, LIT = range(3)
SUBPIXEL = 1 / 256  # pixels; the subpixel grid of common rasterisers


@dataclass(frozen=True, eq=False)
class Truth:
    """Ray-traced shadows of a view. All arrays are (size, size), row 0 at the top.

    visibility: float32, 1 lit, 0 in shadow, 1 outside receivers. receivers: bool, the hit faces both camera and light.
    undecided: bool, visibility changes within the rasteriser's subpixel grid or with the shadow ray's offset; at N·L
    of 0.1 and more, a receiver whose only blockers are lower than a quarter of the offset counts as lit. area: float32,
    visibility averaged over the pixel's samples that hit receivers. blocker: float32 metres along L to the nearest
    occluder, inf if none. triangle: int32 index in the scene's geometry, −1 for a miss. cosine: float32 N·L, 0 where
    there is no receiver. diagonal: of the bounding box of casters and visible receivers, in metres.
    """

    visibility: Single
    receivers: Mask
    undecided: Mask
    area: Single
    blocker: Single
    triangle: NDArray[np.int32]
    cosine: Single
    diagonal: float

    def _repr_png_(self) -> bytes:
        """PNG of the visibility, for notebooks; pixels without a receiver are white."""
        return png_of(np.round(self.visibility * 255).astype(np.uint8))

    def arrays(self) -> dict[str, NDArray[np.generic]]:
        """All fields as arrays by name, as stored in `truth.npz`."""
        return {field.name: np.asarray(getattr(self, field.name)) for field in fields(self)}


def trace(view: View, pixel_samples: int = 4, light_samples: int = 1) -> Truth:
    """Ray-trace the truth of a view, with `pixel_samples`² samples per pixel for `area`.

    Lights have no extent yet: every light sample is the light's centre, so their number has no effect. Raises
    InputError if no pixel shows the scene.
    """
    if pixel_samples < 1 or light_samples < 1:
        raise InputError(f"pixel_samples {pixel_samples}, light_samples {light_samples}: allowed are 1 and more")
    placed, placement = view.placed()
    rays = ViewRays(placed)
    rows_a_slice = max(1, RAYS_A_SLICE // view.size)

    def trace_rows(rows: slice) -> tuple[Indices, Floats]:
        directions = rays.directions(rows)
        triangle = rays.nearest(directions)
        seen = np.flatnonzero(triangle >= 0)
        seen = seen[placed.scene.geometry.receives[triangle[seen]]]
        points = rays.points(directions.take(seen, axis=1), triangle[seen])
        return triangle, np.stack([points.min(axis=1, initial=np.inf), points.max(axis=1, initial=-np.inf)])

    first = list(over_slices(trace_rows, view.size, rows_a_slice))
    triangle = np.concatenate([part for part, _ in first])
    if not (triangle >= 0).any():
        raise InputError(f"camera {view.camera.name!r} of {view.scene.name} shows nothing: no pixel shows a triangle")
    diagonal = _diagonal(placed, np.array([extent for _, extent in first]))
    delta = OFFSET * diagonal
    near = NearCasters(placed.scene.geometry)

    def decide(rows: slice) -> dict[str, NDArray[np.generic]]:
        part = triangle[rows.start * view.size : rows.stop * view.size]
        return _decide(rays, near, rows, part, delta, pixel_samples)

    parts = list(over_slices(decide, view.size, rows_a_slice))
    shape = (view.size, view.size)
    arrays = {name: np.concatenate([part[name] for part in parts]).reshape(shape) for name in parts[0]}
    arrays["blocker"] = (arrays["blocker"] / placement.scale).astype(np.float32)
    arrays["triangle"] = triangle.astype(np.int32).reshape(shape)
    return Truth(diagonal=diagonal / placement.scale, **arrays)


def _diagonal(view: View, visible: Floats) -> float:
    """Diagonal of the bounding box of all casters and visible receivers, or of the scene if there are neither.

    visible: (N, 2, 3) lowest and highest corners of the visible receivers in parts of the image.
    """
    geometry = view.scene.geometry
    low, high = visible[:, 0].min(axis=0), visible[:, 1].max(axis=0)
    if len(geometry.caster_faces):
        casters = bounds_of(used_by(geometry.caster_faces, geometry.vertices))
        low, high = np.minimum(low, casters[0]), np.maximum(high, casters[1])
    if not np.isfinite(low).all():
        low, high = geometry.bounds
    return float(np.linalg.norm(high - low))


def _decide(
    rays: ViewRays, near: NearCasters, rows: slice, triangle: Indices, delta: float, pixel_samples: int
) -> dict[str, NDArray[np.generic]]:
    """Truth's per-pixel arrays except `triangle`, for some rows, flattened, in local lengths."""
    directions = rays.directions(rows)
    centres = rays.receivers(directions, triangle)
    shadow_rays = rays.shadow_rays(centres, delta)
    blocked = rays.occluded(shadow_rays)

    subpixel_offsets = product((0.5 - SUBPIXEL, 0.5 + SUBPIXEL), repeat=2)
    steps = (np.arange(pixel_samples) + 0.5) / pixel_samples
    samples = [
        _sample(rays, rows, across, down, delta) for across, down in (*subpixel_offsets, *product(steps, repeat=2))
    ]
    codes = np.stack([_classify(centres, blocked, len(triangle)), *(code for code, _ in samples)])
    blocker = np.full(len(triangle), np.inf)
    blocker[centres.rays[blocked]] = rays.blockers(shadow_rays.select(blocked))
    undecided = np.zeros(len(triangle), dtype=bool)
    undecided[centres.rays] = _depends_on_offset(rays, centres, shadow_rays, blocked, delta)

    low = [centres.select(_in_low_light(centres)), *(receivers for _, receivers in samples)]
    sample = np.repeat(np.arange(len(low)), [len(receivers.rays) for receivers in low])
    together = Receivers.concatenate(low)
    distance, covered = near.nearest_blockers(together, 4 * delta, rays.pixels(together), rays.eye)
    hidden = np.isfinite(distance)
    codes[sample[hidden], together.rays[hidden]] = SHADOWED
    centre = sample == 0
    ray = together.rays[centre]
    blocker[ray] = np.minimum(blocker[ray], distance[centre])
    undecided[ray] &= ~hidden[centre]  # the test from the surface itself depends on no offset
    undecided[ray] |= covered[centre] & (codes[0, ray] == LIT)

    undecided[centres.rays] |= (centres.cosine <= GRAZING) | (2 * delta > centres.distance * centres.cosine)
    undecided |= rays.edge_on(directions, triangle)
    undecided |= (codes[1:5] != codes[0]).any(axis=0)

    code, inside = codes[0], codes[5:]
    receivers, visible = code != NO_RECEIVER, code != SHADOWED
    counted, seen = (inside != NO_RECEIVER).sum(axis=0), (inside == LIT).sum(axis=0)
    area = np.where(receivers & (counted > 0), seen / np.maximum(counted, 1), visible)
    cosine = np.zeros(len(triangle), dtype=np.float32)
    cosine[centres.rays] = centres.cosine
    return {
        "visibility": visible.astype(np.float32),
        "receivers": receivers,
        "undecided": undecided,
        "area": area.astype(np.float32),
        "blocker": blocker,
        "cosine": cosine,
    }


def _depends_on_offset(
    rays: ViewRays, receivers: Receivers, shadow_rays: ShadowRays, blocked: Mask, delta: float
) -> Mask:
    """(R,) whether visibility changes with another offset of the shadow ray, or with an end just before the lamp."""
    depends = np.zeros(len(blocked), dtype=bool)
    for others in (
        rays.shadow_rays(receivers, 4 * delta),
        rays.shadow_rays(receivers, delta / 4),
        rays.normal_offset_rays(receivers, delta),
        *(
            []
            if rays.directional
            else [shadow_rays._replace(reach=np.maximum(shadow_rays.reach - LAMP_MARGIN * delta, 0.0))]
        ),
    ):
        depends |= rays.occluded(others) != blocked
    return depends


def _sample(
    rays: ViewRays, rows: slice, across: float, down: float, delta: float
) -> tuple[NDArray[np.uint8], Receivers]:
    """Class of one sample of each pixel of some rows, flattened, and the unblocked receivers in low light."""
    directions = rays.directions(rows, across, down)
    receivers = rays.receivers(directions, rays.nearest(directions))
    blocked = rays.occluded(rays.shadow_rays(receivers, delta))
    return _classify(receivers, blocked, directions.shape[1]), receivers.select(_in_low_light(receivers) & ~blocked)


def _in_low_light(receivers: Receivers) -> Mask:
    low: Mask = (receivers.cosine > GRAZING) & (receivers.cosine < LOW_LIGHT)
    return low


def _classify(receivers: Receivers, blocked: Mask, count: int) -> NDArray[np.uint8]:
    """(count,) class of each ray: NO_RECEIVER, SHADOWED or LIT."""
    code = np.full(count, NO_RECEIVER, dtype=np.uint8)
    code[receivers.rays] = np.where(blocked, np.uint8(SHADOWED), np.uint8(LIT))
    return code
