"""Visibility of a light that has a size: the share of its points that a receiver sees, with a standard error.

A pilot of 64 points finds the penumbra, which is widened by 2 pixels; an audit of the rest with 4096 points repeats the
pilot with 256 points if it missed anything, and warns if these do too. A second pilot decides how many points a pixel
of the penumbra needs; the estimate is made from fresh points, since stopping on the sample itself would make the error
look too small. Each replication and each pixel has points of its own; their spread is the standard error.

A pixel is undecided if its receiver or its triangle changes within the rasteriser's subpixel grid, or its visibility,
at the same points of the light, changes there by more than 1/64; likewise, in low light, if it does so with rays that
start above the surface along the normal.
"""

import logging
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from shadowbench.options import ViewSize
from shadowbench.scenes.model import Light
from shadowbench.scenes.vectors import Floats
from shadowbench.truths.embree import over_rows, over_slices
from shadowbench.truths.light_samples import LightSampler, scrambles_of
from shadowbench.truths.rays import GRAZING, LOW_LIGHT, SUBPIXEL_OFFSETS, Indices, Mask, Receivers, ViewRays

Single = NDArray[np.float32]

REPLICATIONS = 8
PILOT = 64  # points of the first pilot
FEWEST = 32  # points of a replication of the estimate: 256 in all, so that 1/256 bounds its error from below
MOST = 2048  # points of a replication, 16,384 rays a pixel in all, however large the standard error
AUDITED = 0.01  # share of the pixels outside the penumbra that are audited
MISSED = 1e-3  # share of the audited pixels in penumbra above which the pilot is repeated
DILATION = 2  # pixels
CHANGE = 1 / 64  # least change of visibility that matters
AREA_SAMPLES = 16  # points of the light for each sample of a pixel in the penumbra
SAFETY = 2.0  # two standard errors of 7 degrees of freedom each differ by less than this, √F, in 95% of the pixels
CONVERGENCE = 0.75  # exponent of n with which the error of a Sobol set falls at edges
_RAYS_A_BLOCK = 1 << 16
_FIRST, _SECOND, _ESTIMATE, _AUDIT, _AREA = range(5)  # what scrambles are for, so that no two share them

_log = logging.getLogger(__name__)


@dataclass(frozen=True, eq=False)
class Sums:
    """Weights, weights of the points seen, and both times N·ω, summed over each replication: (R, replications)."""

    weight: Floats
    seen: Floats
    weight_cosine: Floats
    seen_cosine: Floats

    @property
    def visibility(self) -> Floats:
        """(R,) share of the light that is seen, of the part above the receiver's plane; NaN if there is none."""
        with np.errstate(invalid="ignore"):
            share: Floats = self.seen.sum(axis=1) / self.weight.sum(axis=1)
        return share

    @property
    def spread(self) -> Floats:
        """(R,) standard error of `visibility` by the replications alone, a ratio estimator (Cochran 1977, 2.11)."""
        count = self.weight.shape[1]
        residual = self.seen - self.visibility[:, np.newaxis] * self.weight
        mean = np.maximum(self.weight.mean(axis=1), np.finfo(np.float32).tiny)
        spread: Floats = np.sqrt((residual**2).sum(axis=1) / (count * (count - 1))) / mean
        return spread


class Estimator:
    """Visibility of a light from receivers by shadow rays that start δ above them; other seeds take other points."""

    def __init__(self, rays: ViewRays, light: Light, delta: float, seed: int = 0) -> None:
        self._rays, self._delta, self._seed = rays, delta, seed
        self._sampler = LightSampler(light)

    def sums(
        self, receivers: Receivers, samples: int, replications: int, purpose: int, along_normal: bool = False
    ) -> Sums:
        """Sums for each receiver. Points depend on the camera ray's index and on `purpose` alone."""
        normals = self._rays.normals(receivers.triangle)
        size = max(1, _RAYS_A_BLOCK // (samples * replications))

        def work(part: slice) -> Floats:
            scrambles = scrambles_of(receivers.rays[part], replications, self._seed << 16 | purpose)
            points, normal = np.ascontiguousarray(receivers.point[:, part]), np.ascontiguousarray(normals[:, part])
            origins, directions, reach, weight, cosine = self._sampler.rays(
                points, normal, scrambles, samples, self._delta, along_normal
            )
            seen = weight * ~self._rays.casters.occluded(origins.T, directions.T, reach)
            values = np.stack([weight, seen, weight * cosine, seen * cosine])
            totals: Floats = values.reshape(4, -1, replications, samples).sum(axis=3, dtype=np.float64)
            return totals

        parts = list(over_slices(work, len(receivers.rays), size))
        return Sums(*np.concatenate(parts, axis=1)) if parts else Sums(*np.zeros((4, 0, replications)))


def soft_shadows(
    rays: ViewRays, light: Light, triangle: Indices, delta: float, pixel_samples: int, standard_error: float
) -> dict[str, NDArray[Any]]:
    """Truth's per-pixel arrays except `triangle`, (pixels,), −1 for a miss; flattened, in lengths as the light."""
    centres, _ = _receivers(rays, triangle=triangle)
    estimator = Estimator(rays, light, delta)
    value, penumbra = find_penumbra(estimator, centres, rays.size)
    error, irradiance = np.zeros(len(value)), value.copy()
    value[penumbra], error[penumbra], irradiance[penumbra] = estimate(
        estimator, centres.select(penumbra), standard_error
    )
    undefined = np.isnan(value)  # no point of the light is above the receiver's plane
    undecided = undefined | (centres.cosine <= GRAZING) | (2 * delta > centres.distance * centres.cosine)
    if light.kind in ("spot", "point"):
        undecided |= centres.distance <= light.radius  # inside a spherical light
    undecided |= _depends_on_offset(estimator, centres)

    def of_pixels(values: NDArray[Any], elsewhere: float) -> NDArray[Any]:
        image = np.full(len(triangle), elsewhere, dtype=bool if values.dtype == bool else np.float32)
        image[centres.rays] = values
        return image

    receivers, in_penumbra = of_pixels(np.ones(len(value), dtype=bool), False), of_pixels(penumbra, False)
    visibility = of_pixels(np.where(undefined, 1.0, value), 1.0)
    return {
        "visibility": visibility,
        "standard_error": of_pixels(np.where(undefined, 0.0, error), 0.0),
        "irradiance": of_pixels(np.where(undefined, 1.0, irradiance), 1.0),
        "receivers": receivers,
        "undecided": of_pixels(undecided, False)
        | _changes_within_a_pixel(rays, estimator, centres, in_penumbra, triangle),
        "area": np.where(receivers, _area(rays, estimator, in_penumbra, visibility, pixel_samples), visibility),
        "blocker": _blockers(rays, centres, delta, len(triangle)),
        "cosine": of_pixels(centres.cosine, 0.0),
    }


def _receivers(
    rays: ViewRays, across: float = 0.5, down: float = 0.5, triangle: Indices | None = None
) -> tuple[Receivers, Indices]:
    """Receivers at one point of each pixel, and (pixels,) triangles hit, which are traced unless given."""

    def work(rows: slice) -> tuple[Receivers, Indices]:
        lines = rays.camera_rays(rows, across, down)
        first = rows.start * rays.size.width
        hit = rays.nearest(lines) if triangle is None else triangle[first : rows.stop * rays.size.width]
        found = rays.receivers(lines, hit)
        return found._replace(rays=found.rays + first), hit

    parts, hits = zip(*over_rows(work, rays.size), strict=True)
    return Receivers.concatenate(parts), np.concatenate(hits)


def find_penumbra(estimator: Estimator, centres: Receivers, size: ViewSize) -> tuple[Floats, Mask]:
    """(R,) visibility by the pilot, and which receivers lie in a penumbra or within 2 pixels of one."""
    value = estimator.sums(centres, PILOT, 1, _FIRST).visibility
    for samples in (PILOT, 4 * PILOT):
        penumbra = _widened(centres.rays, value, size)
        outside = np.flatnonzero(~penumbra)
        audited = outside[scrambles_of(centres.rays[outside], 1, _AUDIT)[0, :, 0] < AUDITED * 2.0**32]
        found = estimator.sums(centres.select(audited), 16 * PILOT, 4, _AUDIT).visibility
        missed = np.count_nonzero(np.abs(found - value[audited]) > CHANGE)
        if missed <= MISSED * len(audited):
            break
        if samples == PILOT:
            value[outside] = estimator.sums(centres.select(outside), 4 * PILOT, 1, _FIRST).visibility
        else:
            _log.warning(
                "%d of %d pixels audited outside the penumbra lie in one that %d points of the light do not show: "
                "the truth has no standard error there",
                *(missed, len(audited), samples),
            )
    return value, penumbra


def _widened(pixels: Indices, visibility: Floats, size: ViewSize) -> Mask:
    """(R,) whether visibility is neither 0 everywhere nor 1 everywhere within DILATION pixels of each receiver."""
    window = 2 * DILATION + 1
    low, high = np.full(size.pixels, 2.0, np.float32), np.full(size.pixels, -1.0, np.float32)
    low[pixels] = high[pixels] = np.nan_to_num(visibility, nan=0.5)
    lowest = ndimage.minimum_filter(low.reshape(size.shape), window, mode="nearest").ravel()[pixels]
    highest = ndimage.maximum_filter(high.reshape(size.shape), window, mode="nearest").ravel()[pixels]
    widened: Mask = (lowest < 1) & (highest > 0)
    return widened


def estimate(estimator: Estimator, receivers: Receivers, target: float) -> tuple[Floats, Floats, Floats]:
    """(R,) visibility, its standard error, and visibility weighted by N·ω; points as a pilot of its own decides."""
    points = REPLICATIONS * 2
    pilot = estimator.sums(receivers, points, REPLICATIONS, _SECOND)
    partly = (pilot.visibility > 0) & (pilot.visibility < 1)  # elsewhere all rays agree, and few are enough
    spread = np.maximum(pilot.spread, partly / (REPLICATIONS * points))
    wanted = points * (SAFETY * spread / target) ** (1 / CONVERGENCE)
    # NaN, where no light is above the horizon, counts as few.
    samples = 2 ** np.ceil(np.log2(np.clip(np.nan_to_num(wanted), FEWEST, MOST))).astype(int)
    visibility, error, irradiance = (np.empty(len(samples)) for _ in range(3))
    for count in np.unique(samples):
        chosen = samples == count
        sums = estimator.sums(receivers.select(chosen), int(count), REPLICATIONS, _ESTIMATE)
        visibility[chosen] = sums.visibility
        error[chosen] = np.maximum(sums.spread, 1 / (REPLICATIONS * count))  # eight equal answers are not exact
        with np.errstate(invalid="ignore"):
            irradiance[chosen] = sums.seen_cosine.sum(axis=1) / sums.weight_cosine.sum(axis=1)
    return visibility, error, irradiance


def _changes_within_a_pixel(
    rays: ViewRays, estimator: Estimator, centres: Receivers, in_penumbra: Mask, triangle: Indices
) -> Mask:
    """(pixels,) whether receiver, triangle or visibility change within the rasteriser's subpixel grid."""
    changes = np.zeros(len(triangle), dtype=bool)
    for across, down in SUBPIXEL_OFFSETS:
        moved, hit = _receivers(rays, across, down)
        common = np.zeros((2, len(triangle)), dtype=bool)
        common[0, centres.rays], common[1, moved.rays] = True, True
        changes |= (common[0] != common[1]) | (common[0] & (hit != triangle))
        compared = common.all(axis=0) & in_penumbra & ~changes
        here, there = centres.select(compared[centres.rays]), moved.select(compared[moved.rays])
        changes[here.rays] |= _differ(estimator, here, there)
    return changes


def _depends_on_offset(estimator: Estimator, centres: Receivers) -> Mask:
    """(R,) whether visibility in low light changes if rays start above the surface along the normal instead of L."""
    low = centres.cosine < LOW_LIGHT
    depends = np.zeros(len(low), dtype=bool)
    depends[low] = _differ(estimator, centres.select(low), centres.select(low), along_normal=True)
    return depends


def _differ(estimator: Estimator, one: Receivers, other: Receivers, along_normal: bool = False) -> Mask:
    """(R,) whether visibility at the same points of the light differs by more than 1/64; more points confirm it."""
    differ = np.ones(len(one.rays), dtype=bool)
    for samples in (PILOT, 16 * PILOT):
        first = estimator.sums(one.select(differ), samples, 1, _FIRST).visibility
        second = estimator.sums(other.select(differ), samples, 1, _FIRST, along_normal).visibility
        differ[differ] = np.abs(first - second) > CHANGE
    return differ


def _area(
    rays: ViewRays, estimator: Estimator, in_penumbra: Mask, visibility: NDArray[Any], pixel_samples: int
) -> Single:
    """(pixels,) visibility averaged over the pixel's samples that hit receivers, `visibility` where none does."""
    total, count = np.zeros(len(visibility)), np.zeros(len(visibility))
    steps = (np.arange(pixel_samples) + 0.5) / pixel_samples
    for number, (across, down) in enumerate(product(steps, repeat=2)):
        receivers, _ = _receivers(rays, across, down)
        penumbra = in_penumbra[receivers.rays]
        for chosen, samples in ((penumbra, AREA_SAMPLES), (~penumbra, 1)):  # where all points answer as one does
            part = receivers.select(chosen)
            value = estimator.sums(part, samples, 1, _AREA + number).visibility
            defined = ~np.isnan(value)
            total[part.rays[defined]] += value[defined]
            count[part.rays[defined]] += 1
    return np.where(count > 0, total / np.maximum(count, 1), visibility).astype(np.float32)


def _blockers(rays: ViewRays, centres: Receivers, delta: float, pixels: int) -> Floats:
    """(pixels,) distance along L to the nearest caster before the light's centre, inf if none."""

    def work(part: slice) -> Floats:
        receivers = centres.select(part)
        distance = np.full(len(receivers.rays), np.inf)
        blocked = rays.occluded(rays.shadow_rays(receivers, delta))
        _, distance[blocked] = rays.nearest_casters(receivers.select(blocked), delta)
        return distance

    blocker = np.full(pixels, np.inf)
    parts = list(over_slices(work, len(centres.rays)))
    blocker[centres.rays] = np.concatenate(parts) if parts else []
    return blocker
