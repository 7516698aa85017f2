"""Needed depth precision and bias: gaps between casters and receivers, and self-shadowing of slopes."""

from dataclasses import dataclass

import numpy as np

from shadowbench.geometry.convex import box_planes, corners
from shadowbench.geometry.lights import window
from shadowbench.scenes.vectors import Floats
from shadowbench.survey.maps import REFERENCE_SIZE, FittedMap
from shadowbench.survey.sampling import Estimate
from shadowbench.truths.embree import INFINITE

TOLERATED = 0.001  # tolerated share of wrong samples, of those in shadow or of those lit
CONTACT = 0.01  # share of the shadow with the smallest gaps, excluded as contact
BIAS_STEPS = 4.0  # quantization steps of the depth format that biases add by default


@dataclass(frozen=True)
class DepthBits:
    """The depth format that separates casters from receivers.

    bits: 16, 24, or 32 for reversed floats; None if no format suffices. range: metres from near to far. closest:
    quantile TOLERATED of the gap between caster and receiver along the light's axis, in metres. lost: share of the
    shadow whose gap is below BIAS_STEPS steps of a format, by bits.
    """

    bits: int | None
    range: float
    closest: Estimate
    lost: dict[int, float]


@dataclass(frozen=True)
class BiasNeed:
    """The needed bias along the light, in metres, without filtering, for a map of REFERENCE_SIZE.

    needed: leaves acne on a share TOLERATED of the lit samples; worst: on none; thinnest: quantile CONTACT of the gap
    between caster and receiver; bridged: share of the shadow that `needed` would light. The last two are None without a
    shadow.
    """

    needed: Estimate
    worst: float
    thinnest: Estimate | None
    bridged: Estimate | None


@dataclass(frozen=True, eq=False)
class Depths:
    """Depths of the samples in their fitted map, at REFERENCE_SIZE.

    near, far: local distances with depth 0 and 1; gap: (R,) from caster to receiver along the map's depth direction, in
    local lengths, inf where lit; per_length: (R,) derivative of stored depth by that length; stored: (R,) depth in
    [0, 1].
    """

    near: float
    far: float
    gap: Floats
    per_length: Floats
    stored: Floats


def depths_of(fitted: FittedMap) -> Depths:
    """The depths of the samples in a fitted map."""
    samples, space, z = fitted.samples, fitted.space, fitted.footprint.coords[2]
    if space is None:
        away = samples.view.scene.geometry.vertices - samples.view.light.position
        far = float(np.linalg.norm(away, axis=1).max())
        return Depths(0.0, far, samples.blocker, np.full(len(z), 1 / far), z / far)
    box = window(fitted.box, space, REFERENCE_SIZE, fitted.padding, (0.0, 0.0))
    near, far = float(box.low[2]), float(box.high[2])
    along = np.einsum("ij,i->j", samples.to_light, space.basis[2])
    # Casters in front of the near plane are clamped to it.
    gap = np.where(samples.shadowed, np.minimum(samples.blocker * along, z - near), np.inf)
    share = (z - near) / (far - near)
    if not space.perspective:
        return Depths(near, far, gap, np.full(len(z), 1 / (far - near)), share)
    return Depths(near, far, gap, far * near / (far - near) / z**2, share * far / z)


def bits_of(fitted: FittedMap, depths: Depths) -> DepthBits | None:
    """The smallest sufficient depth format; None if nothing is in shadow."""
    samples = fitted.samples
    dark = np.flatnonzero(samples.shadowed)
    if not len(dark):
        return None
    gap, stored = (depths.gap * depths.per_length)[dark], depths.stored[dark]
    # Floats have 24 significant bits; with reversed depth, relative to the distance from the far plane.
    steps: dict[int, float | Floats] = {16: 2.0**-16, 24: 2.0**-24, 32: 2.0**-24 * (1 - stored)}
    lost = {bits: float((gap < BIAS_STEPS * step).mean()) for bits, step in steps.items()}
    bits = next((bits for bits, share in lost.items() if share <= TOLERATED), None)
    metres = 1 / samples.placement.scale
    closest = samples.quantile(depths.gap, TOLERATED, dark).times(metres)
    return DepthBits(bits, (depths.far - depths.near) * metres, closest, lost)


def bias_of(fitted: FittedMap, depths: Depths) -> BiasNeed | None:
    """The bias that the lit samples need, and the shadow that it costs; None if nothing is lit."""
    samples = fitted.samples
    lit, dark = np.flatnonzero(~samples.shadowed), np.flatnonzero(samples.shadowed)
    if not len(lit):
        return None
    metres = 1 / samples.placement.scale
    required = required_bias(fitted)
    needed = samples.quantile(required, 1 - TOLERATED, lit)
    thinnest = bridged = None
    if len(dark):
        thinnest = samples.quantile(depths.gap, CONTACT, dark).times(metres)
        bridged = samples.mean(depths.gap < needed.value, dark)
    return BiasNeed(needed.times(metres), float(required[lit].max()) * metres, thinnest, bridged)


def required_bias(fitted: FittedMap) -> Floats:
    """(R,) distance of each sample behind the depth stored in its texel, in local lengths along the map's depth.

    The texel's centre is at a random offset of up to half a texel from the sample. There the stored depth is that of
    the receiver's plane, but no nearer to the light than the first caster on the light ray: a facet at grazing light is
    narrower than a texel, and a caster in front of it makes a shadow edge, not acne.
    """
    offset = np.random.default_rng(0).random(fitted.unit.slope.shape) - 0.5
    offset /= fitted.texels(REFERENCE_SIZE)
    plane = np.maximum((fitted.unit.slope * offset).sum(axis=0), 0.0)
    gap = occluder_gap(fitted, offset * fitted.extent[:, None])
    return np.asarray(np.minimum(plane, np.maximum(gap, 0.0)))


def occluder_gap(fitted: FittedMap, offset: Floats) -> Floats:
    """(R,) depth gap from each sample to the first occluder, on the light ray at (2, R) light-space offsets from it."""
    samples, gap = fitted.samples, np.empty(offset.shape[1])
    for mine, space, footprint in fitted.light_spaces():
        u, v = footprint.coords[:2] - offset[:, mine]
        if space.perspective:
            rays = space.basis.T @ np.stack([u, v, np.full(len(mine), -1.0)])
            origins = np.broadcast_to(space.origin, (len(mine), 3))
            occluder = samples.casters.hits(origins, rays.T, INFINITE).distance.astype(np.float64)
            occluder *= np.sqrt(u**2 + v**2 + 1) if fitted.space is None else 1.0  # cubes store the distance itself
        else:
            start = float(space.box(corners(box_planes(samples.view.scene.geometry.bounds), 1.0)).low[2])
            origins = space.basis.T @ np.stack([u, v, np.full(len(mine), -start)])
            occluder = start + samples.casters.hits(origins.T, -space.basis[2:], INFINITE).distance.astype(np.float64)
        gap[mine] = fitted.footprint.coords[2, mine] - occluder
    return gap
