"""Visibility of a light without a size: one shadow ray per sample, and tests of what that ray cannot decide.

A pixel is undecided if its visibility changes within the rasteriser's subpixel grid or with the shadow ray's offset δ.
For N·L below LOW_LIGHT, casters lower than δ, which the ray misses, are found by tests from the surface (`near`). Above
it, a receiver counts as lit even if a caster lower than δ/4 above its plane, at most 2.5 δ along L, blocks it.
"""

from itertools import product
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from shadowbench.truths.embree import over_slices, rows_a_slice
from shadowbench.truths.rays import GRAZING, LOW_LIGHT, SUBPIXEL_OFFSETS, Indices, Mask, Receivers, ShadowRays, ViewRays

if TYPE_CHECKING:
    from shadowbench.truths.near import NearCasters

LAMP_MARGIN = 1e-3  # share of δ: a caster this close to a lamp may be before or behind it
NO_RECEIVER, SHADOWED, LIT = range(3)


def hard_shadows(
    rays: ViewRays, near: "NearCasters", triangle: Indices, delta: float, pixel_samples: int
) -> dict[str, NDArray[Any]]:
    """Truth's per-pixel arrays except `triangle`, flattened, in local lengths; triangle: (size²,), −1 for a miss."""

    def decide(rows: slice) -> dict[str, NDArray[Any]]:
        part = triangle[rows.start * rays.size : rows.stop * rays.size]
        return _decide(rays, near, rows, part, delta, pixel_samples)

    parts = list(over_slices(decide, rays.size, rows_a_slice(rays.size)))
    return {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}


def _decide(
    rays: ViewRays, near: "NearCasters", rows: slice, triangle: Indices, delta: float, pixel_samples: int
) -> dict[str, NDArray[Any]]:
    """Truth's per-pixel arrays except `triangle`, for some rows, flattened, in local lengths."""
    directions = rays.directions(rows)
    centres = rays.receivers(directions, triangle)
    shadow_rays = rays.shadow_rays(centres, delta)
    blocked = rays.occluded(shadow_rays)

    steps = (np.arange(pixel_samples) + 0.5) / pixel_samples
    samples = [
        _sample(rays, rows, across, down, delta) for across, down in (*SUBPIXEL_OFFSETS, *product(steps, repeat=2))
    ]
    codes = np.stack([_classify(centres, blocked, len(triangle)), *(code for code, _ in samples)])
    blocker = np.full(len(triangle), np.inf)
    blocker[centres.rays[blocked]] = rays.blockers(centres.select(blocked), delta)
    undecided = np.zeros(len(triangle), dtype=bool)
    undecided[centres.rays] = _depends_on_offset(rays, centres, shadow_rays, blocked, delta)

    low = [centres.select(_in_low_light(centres)), *(receivers for _, receivers in samples)]
    sample = np.repeat(np.arange(len(low)), [len(receivers.rays) for receivers in low])
    together = Receivers.concatenate(low)
    distance, covered = near.nearest_blockers(together, 4 * delta, rays.eye)
    hidden = np.isfinite(distance)
    codes[sample[hidden], together.rays[hidden]] = SHADOWED
    centre = sample == 0
    ray = together.rays[centre]
    blocker[ray] = np.minimum(blocker[ray], distance[centre])
    undecided[ray] &= ~hidden[centre]  # the test from the surface itself depends on no offset
    undecided[ray] |= covered[centre] & (codes[0, ray] == LIT)

    undecided[centres.rays] |= (centres.cosine <= GRAZING) | (2 * delta > centres.distance * centres.cosine)
    undecided |= (codes[1:5] != codes[0]).any(axis=0)

    code, inside = codes[0], codes[5:]
    receivers, visible = code != NO_RECEIVER, code != SHADOWED
    counted, seen = (inside != NO_RECEIVER).sum(axis=0), (inside == LIT).sum(axis=0)
    area = np.where(receivers & (counted > 0), seen / np.maximum(counted, 1), visible)
    cosine = np.zeros(len(triangle), dtype=np.float32)
    cosine[centres.rays] = centres.cosine
    return {
        "visibility": visible.astype(np.float32),
        "irradiance": visible.astype(np.float32),
        "standard_error": np.zeros(len(triangle), dtype=np.float32),
        "receivers": receivers,
        "undecided": undecided,
        "area": area.astype(np.float32),
        "blocker": blocker,
        "cosine": cosine,
    }


def _depends_on_offset(
    rays: ViewRays, receivers: Receivers, shadow_rays: ShadowRays, blocked: Mask, delta: float
) -> Mask:
    """(R,) whether visibility changes with another offset of the shadow ray, or an end just before or past the lamp."""
    depends = np.zeros(len(blocked), dtype=bool)
    margin = LAMP_MARGIN * delta + rays.lamp_error(shadow_rays)
    for others in (
        rays.shadow_rays(receivers, 4 * delta),
        rays.shadow_rays(receivers, delta / 4),
        rays.normal_offset_rays(receivers, delta),
    ):
        depends |= rays.occluded(others) != blocked
    for longer in () if rays.directional else (-margin, margin):
        others = shadow_rays._replace(reach=np.maximum(shadow_rays.reach + longer, 0.0))
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
