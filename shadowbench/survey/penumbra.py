"""Penumbrae for the light's size: their width in pixels, their share of the shadow, and the error of hard shadows."""

from dataclasses import dataclass, replace

import numpy as np

from shadowbench.scenes.model import SUN_RADIUS, Floats, Light
from shadowbench.survey.footprint import longest
from shadowbench.survey.rays import Mask
from shadowbench.survey.sampling import Estimate, Samples
from shadowbench.truths.embree import RAYS_A_SLICE, over_slices
from shadowbench.truths.light_samples import LightSampler, scrambles_of
from shadowbench.truths.rays import SUBPIXEL_OFFSETS
from shadowbench.truths.soft import CHANGE
from shadowbench.truths.trace import OFFSET

BULB = 0.03
"""Radius of a common household bulb, in metres (A60: 60 mm across)."""
HARD_RMSE = 0.02
"""RMSE up to which hard shadows suffice: what `recommend` asks of soft shadows by default."""
RECEIVERS = 1 << 16  # most receivers whose visibility is sampled
POINTS = 16  # of the light, in each of two replications
_STAGE = 1 << 15  # of random shifts, beyond the truth's


@dataclass(frozen=True)
class Penumbra:
    """The penumbrae of a view. Widths are in pixels, at the shadows' edges, in the widest direction.

    radius: of the light, in radians for a directional one, else in metres; half the longer side of a rectangle;
    assumed: True if the scene has none; median and p95: widths over edge pixels; share: of the shadow that is penumbra;
    hard_rmse: RMSE of exact hard shadows, those of the light's centre, over decided receivers.
    """

    radius: float
    assumed: bool
    median: Estimate
    p95: Estimate
    share: Estimate
    hard_rmse: Estimate

    @property
    def hard_is_enough(self) -> bool:
        """Whether their error is at most HARD_RMSE.

        Widths do not tell: narrow penumbrae are a large error where they cover much of the view, wide ones a small
        error where they cover little.
        """
        return self.hard_rmse.value <= HARD_RMSE


def penumbra_of(samples: Samples) -> Penumbra | None:
    """The penumbrae for the light's size, by default that of the sun or a bulb; None without shadow edges."""
    edges = samples.edges
    if not len(edges):
        return None
    light = sized_light(samples)
    radius = light.radius or max(light.size) / 2
    width = widths(samples, radius)
    share, hard_rmse = _softness(samples, light)
    return Penumbra(
        radius=float(radius if light.kind == "directional" else radius / samples.placement.scale),
        assumed=not samples.view.light.soft,
        median=samples.estimate(lambda chosen: float(np.median(width[chosen])), edges),
        p95=samples.estimate(lambda chosen: float(np.percentile(width[chosen], 95)), edges),
        share=share,
        hard_rmse=hard_rmse,
    )


def sized_light(samples: Samples) -> Light:
    """The light in local coordinates, with the size of the sun or a bulb if it has none."""
    light, bulb = samples.view.light, samples.placement.length(BULB)
    if light.soft:
        return light
    if light.kind == "rectangle":
        return replace(light, size=(2 * bulb, 2 * bulb))
    return replace(light, radius=SUN_RADIUS if light.kind == "directional" else bulb)


def widths(samples: Samples, radius: float) -> Floats:
    """(R,) width of the penumbra at each sample in pixels; 0 where lit.

    By similar triangles, perpendicular to the light ray: 2 tan(radius) · blocker for a sun; 2 radius ·
    blocker/(distance − blocker) otherwise, as in PCSS (Fernando 2005), with the denominator at least the radius.
    """
    if samples.view.light.kind == "directional":
        across = 2 * np.tan(radius) * samples.blocker
    else:
        blocker_to_light = np.maximum(samples.distance - samples.blocker, radius)
        across = 2 * radius * samples.blocker / blocker_to_light
    derivatives = [
        step - samples.to_light * (step * samples.to_light).sum(axis=0) for step in (samples.across, samples.down)
    ]
    with np.errstate(invalid="ignore"):
        return np.where(samples.shadowed, across * longest(*derivatives), 0.0)


def _softness(samples: Samples, light: Light) -> tuple[Estimate, Estimate]:
    """Share of the shadow that is penumbra, and the rmse of exact hard shadows, from up to RECEIVERS samples."""
    everything = np.arange(len(samples.pixel))
    if len(everything) > RECEIVERS:
        everything = np.sort(np.random.default_rng(0).choice(everything, RECEIVERS, replace=False))
    visibility = _visibility(samples.select(everything), light)
    hard, mean = ~samples.shadowed[everything], visibility.mean(axis=1)
    partly = (mean > 0) & (mean < 1)
    decided = np.ones(len(everything), dtype=bool)
    decided[partly] = ~_undecided(samples.select(everything[partly]), light)
    decided |= not decided.any()
    # The product of the errors of two independent estimates has no bias by their variance, as a square would have.
    squared = ((visibility[:, 0] - hard) * (visibility[:, 1] - hard))[decided]
    rmse = float(np.sqrt(max(squared.mean(), 0.0)))
    # Errors by the points of the light, and by the pixels left out.
    spread = ((visibility[:, 0] - visibility[:, 1]) ** 2 / 2)[decided]
    by_points = float((2 * np.maximum(squared, 0.0) * spread + spread**2).mean())
    by_pixels = float(squared.var()) * (1 - samples.part * len(everything) / len(samples.pixel))
    error = float(np.sqrt((by_points + by_pixels) / len(squared)))
    shadow = max(int((mean < 1).sum()), 1)
    share = int(partly.sum()) / shadow
    return (
        Estimate(share, float(np.sqrt(share * (1 - share) / shadow))),
        Estimate(rmse, error / (2 * rmse) if rmse else 0.0),
    )


def _undecided(samples: Samples, light: Light) -> Mask:
    """(R,) whether visibility changes within the rasteriser's subpixel grid: scores leave such pixels out.

    As in the truth, by the same 64 points of the light at both places, confirmed by 1024.
    """
    undecided = np.zeros(len(samples.pixel), dtype=bool)
    for x, y in SUBPIXEL_OFFSETS:
        moved = replace(samples, point=samples.point + (x - 0.5) * samples.across + (y - 0.5) * samples.down)
        changed = np.ones(len(undecided), dtype=bool)
        for count in (2 * POINTS, 32 * POINTS):
            one, other = (_visibility(part.select(changed), light, count).mean(axis=1) for part in (samples, moved))
            changed[changed] = np.abs(one - other) > CHANGE
        undecided |= changed
    return undecided


def _visibility(samples: Samples, light: Light, count: int = POINTS) -> Floats:
    """(R, 2) share of the light that each sample sees, in two replications; 1 if all of it is below its horizon.

    count: points of the light in each of them.
    """
    sampler = LightSampler(light)
    low, high = samples.view.scene.geometry.bounds
    above = OFFSET * float(np.linalg.norm(high - low))

    def work(part: slice) -> Floats:
        points, normals = (np.ascontiguousarray(array[:, part]) for array in (samples.point, samples.normal))
        shifts = scrambles_of(samples.pixel[part], 2, _STAGE)
        origins, directions, reach, weight, _ = sampler.rays(points, normals, shifts, count, above)
        seen = weight * ~samples.casters.occluded(origins.T, directions.T, reach)
        total, visible = (array.reshape(-1, 2, count).sum(axis=2, dtype=np.float64) for array in (weight, seen))
        return np.where(total > 0, visible / np.maximum(total, np.finfo(float).tiny), 1.0)

    parts = list(over_slices(work, len(samples.pixel), max(1, RAYS_A_SLICE // (2 * count))))
    return np.concatenate(parts) if parts else np.ones((0, 2))
