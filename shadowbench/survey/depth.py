"""What a depth map must tell apart: the closest casters and receivers, and a slope from itself."""

from dataclasses import dataclass

import numpy as np

from shadowbench.geometry.convex import box_planes, corners
from shadowbench.geometry.lights import window
from shadowbench.scenes.model import Floats
from shadowbench.survey.maps import REFERENCE_SIZE, FittedMap
from shadowbench.survey.rays import Indices
from shadowbench.survey.sampling import Estimate
from shadowbench.truths.embree import NEVER

LOST = 0.001  # share of the shadow, or of what is lit, that may be wrong for it
THIN = 0.01  # share of the shadow whose gaps are left out as contact
STEPS = 4.0  # of a format, by which biases stay clear of its rounding by default


@dataclass(frozen=True)
class DepthBits:
    """The depth format that separates casters from receivers.

    bits: 16, 24, or 32 for floats that are reversed; None where none does. range: metres between near and far. closest:
    metres between caster and receiver along the light's axis that all but LOST of the shadow exceed. lost: share of the
    shadow that a format's own steps lose, by bits.
    """

    bits: int | None
    range: float
    closest: Estimate
    lost: dict[int, float]


@dataclass(frozen=True)
class BiasNeed:
    """The bias along the light, in metres, for a hard comparison with a map of REFERENCE_SIZE.

    needed: leaves acne on LOST of what is lit; worst: on nothing of it; thinnest: the gap between caster and receiver
    that all but THIN of the shadow exceed; bridged: share of the shadow that `needed` lights. None without a shadow.
    """

    needed: Estimate
    worst: float
    thinnest: Estimate | None
    bridged: Estimate | None


@dataclass(frozen=True, eq=False)
class Depths:
    """Of the samples in their fitted map, at REFERENCE_SIZE.

    near, far: local distances with depth 0 and 1; gap: (R,) from caster to receiver along what the map stores, in local
    lengths, inf where lit; per_length: (R,) stored depth for such a length there; stored: (R,) depth in [0, 1].
    """

    near: float
    far: float
    gap: Floats
    per_length: Floats
    stored: Floats


def depths_of(fitted: FittedMap) -> Depths:
    """The depths of a fitted map, whose near and far are those of our fits."""
    samples, space, z = fitted.samples, fitted.space, fitted.footprint.coords[2]
    if space is None:
        away = samples.view.scene.geometry.vertices - samples.view.light.position
        far = float(np.linalg.norm(away, axis=1).max())
        return Depths(0.0, far, samples.blocker, np.full(len(z), 1 / far), z / far)
    box = window(fitted.box, space, REFERENCE_SIZE, fitted.padding, (0.0, 0.0))
    near, far = float(box.low[2]), float(box.high[2])
    along = np.einsum("ij,i->j", samples.to_light, space.basis[2])
    # A caster in front of near is kept at near.
    gap = np.where(samples.shadowed, np.minimum(samples.blocker * along, z - near), np.inf)
    share = (z - near) / (far - near)
    if not space.perspective:
        return Depths(near, far, gap, np.full(len(z), 1 / (far - near)), share)
    return Depths(near, far, gap, far * near / (far - near) / z**2, share * far / z)


def bits_of(fitted: FittedMap, depths: Depths) -> DepthBits | None:
    """The fewest bits that do; None where nothing is in shadow."""
    samples = fitted.samples
    dark = np.flatnonzero(samples.shadowed)
    if not len(dark):
        return None
    metres = 1 / samples.placement.scale
    apart, stored = (depths.gap * depths.per_length)[dark], depths.stored[dark]
    # A float has 24 bits of its own; reversed, they are of its distance to far.
    steps: dict[int, float | Floats] = {16: 2.0**-16, 24: 2.0**-24, 32: 2.0**-24 * (1 - stored)}
    lost = {bits: float((apart < STEPS * step).mean()) for bits, step in steps.items()}

    def closest(chosen: Indices) -> float:
        return float(np.quantile(depths.gap[chosen], LOST))

    return DepthBits(
        bits=next((bits for bits, share in lost.items() if share <= LOST), None),
        range=(depths.far - depths.near) * metres,
        closest=samples.estimate(closest, dark).times(metres),
        lost=lost,
    )


def bias_of(fitted: FittedMap, depths: Depths) -> BiasNeed | None:
    """The bias that what is lit needs, and what it costs in shadow; None where nothing is lit."""
    samples = fitted.samples
    lit, dark = np.flatnonzero(~samples.shadowed), np.flatnonzero(samples.shadowed)
    if not len(lit):
        return None
    metres = 1 / samples.placement.scale
    ahead = required_bias(fitted)
    needed = samples.estimate(lambda chosen: float(np.quantile(ahead[chosen], 1 - LOST)), lit)
    thinnest = bridged = None
    if len(dark):
        thinnest = samples.estimate(lambda chosen: float(np.quantile(depths.gap[chosen], THIN)), dark)
        bridged = samples.estimate(lambda chosen: float((depths.gap[chosen] < needed.value).mean()), dark)
    return BiasNeed(
        needed=needed.times(metres),
        worst=float(ahead[lit].max()) * metres,
        thinnest=thinnest.times(metres) if thinnest else None,
        bridged=bridged,
    )


def required_bias(fitted: FittedMap) -> Floats:
    """(R,) how far each sample is behind the depth in its texel, along what the map stores, in local lengths.

    A texel lies anywhere about its point: one place by lot. There its depth is that of the receiver's own plane, but no
    nearer to the light than what a ray from the light meets: facets that graze the light are narrower than texels, and
    what stands in front of them makes an edge, not acne.
    """
    count = fitted.texels(REFERENCE_SIZE)
    offset = (np.random.default_rng(0).random(fitted.unit.slope.shape) - 0.5) / count
    plane = np.maximum((fitted.unit.slope * offset).sum(axis=0), 0.0)
    behind: Floats = np.minimum(plane, np.maximum(_before(fitted, offset * fitted.extent[:, None]), 0.0))
    return behind


def _before(fitted: FittedMap, offset: Floats) -> Floats:
    """(R,) how much before each sample's depth the first caster is that the light meets at (2, R) from it."""
    samples, before = fitted.samples, np.empty(offset.shape[1])
    for mine, space, footprint in fitted.light_spaces():
        u, v = footprint.coords[:2] - offset[:, mine]
        if space.perspective:
            rays = space.basis.T @ np.stack([u, v, np.full(len(mine), -1.0)])
            origins = np.broadcast_to(space.origin, (len(mine), 3))
            met = samples.casters.distance(origins, rays.T, NEVER).astype(np.float64)
            met *= np.sqrt(u**2 + v**2 + 1) if fitted.space is None else 1.0  # a cube stores the distance itself
        else:
            start = float(space.box(corners(box_planes(samples.view.scene.geometry.bounds), 1.0)).low[2])
            origins = space.basis.T @ np.stack([u, v, np.full(len(mine), -start)])
            met = start + samples.casters.distance(origins.T, -space.basis[2:], NEVER).astype(np.float64)
        before[mine] = fitted.footprint.coords[2, mine] - met
    return before
