"""Needs of depth: the format that separates casters from receivers, the bias against acne, and the light's size."""

from dataclasses import dataclass, replace

import numpy as np

from shadowbench.geometry.lights import window
from shadowbench.measure.scoring import prepare_truth
from shadowbench.scenes.model import SUN_RADIUS, Light, View
from shadowbench.scenes.vectors import Floats
from shadowbench.scores.comparison import Comparison
from shadowbench.scores.metrics import rmse
from shadowbench.survey.samples import REFERENCE_SIZE, FittedMap, Samples, hard_view, longest
from shadowbench.truths.cache import cached_truth
from shadowbench.truths.rays import Indices, Mask

TOLERATED = 0.001  # tolerated share of wrong samples, of those in shadow or of those lit
CONTACT = 0.01  # share of the shadow with the smallest gaps, excluded as contact
BIAS_STEPS = 4.0  # quantization steps of the depth format that biases add by default
BULB = 0.03
"""Radius of a common household bulb, in metres (A60: 60 mm across)."""
HARD_RMSE = 0.02
"""RMSE up to which hard shadows suffice: what `recommend` asks of soft shadows by default."""


@dataclass(frozen=True)
class DepthBits:
    """The depth format that separates casters from receivers.

    bits: 16, 24, or 32 for reversed floats; None if no format suffices. range: metres from near to far. closest:
    quantile TOLERATED of the gap between caster and receiver along the light's axis, in metres. lost: share of the
    shadow whose gap is below BIAS_STEPS steps of a format, by bits.
    """

    bits: int | None
    range: float
    closest: float
    lost: dict[int, float]


@dataclass(frozen=True)
class BiasNeed:
    """The needed bias along the light, in metres, without filtering, for a map of REFERENCE_SIZE.

    needed: leaves acne on a share TOLERATED of the lit samples; worst: on none; thinnest: quantile CONTACT of the gap
    between caster and receiver; bridged: share of the shadow that `needed` would light. The last two are None without a
    shadow.
    """

    needed: float
    worst: float
    thinnest: float | None
    bridged: float | None


@dataclass(frozen=True, eq=False)
class Depths:
    """Depths of the samples in their fitted map, at REFERENCE_SIZE.

    near, far: local distances with depth 0 and 1; gap: (R,) from caster to receiver along the map's depth direction, in
    local lengths, inf where lit: of the caster that the light meets first, where that is known, else of the receiver's
    nearest; known: (R,) bool; per_length: (R,) derivative of stored depth by that length; stored: (R,) depth in [0, 1].
    """

    near: float
    far: float
    gap: Floats
    known: Mask
    per_length: Floats
    stored: Floats


def depths_of(fitted: FittedMap) -> Depths:
    """The depths of the samples in a fitted map."""
    samples, z = fitted.samples, fitted.stored(fitted.footprint.coords)
    surface, known = first_surface(fitted, np.arange(len(z)))
    behind = np.where(known, z - surface, 0.0)
    if fitted.cube:  # which stores the distance to the light
        away = samples.view.scene.geometry.vertices - samples.view.light.position
        far = float(np.linalg.norm(away, axis=1).max())
        gap = np.where(samples.shadowed, np.maximum(samples.blocker, behind), np.inf)
        return Depths(0.0, far, gap, known, np.full(len(z), 1 / far), z / far)
    (space,) = fitted.spaces
    box = window(fitted.box, space, REFERENCE_SIZE, fitted.padding, (0.0, 0.0))
    near, far = float(box.low[2]), float(box.high[2])
    along = np.einsum("ij,i->j", samples.to_light, space.basis[2])
    # Casters in front of the near plane are clamped to it.
    gap = np.minimum(np.maximum(samples.blocker * along, behind), z - near)
    gap, share = np.where(samples.shadowed, gap, np.inf), (z - near) / (far - near)
    if not space.perspective:
        return Depths(near, far, gap, known, np.full(len(z), 1 / (far - near)), share)
    return Depths(near, far, gap, known, far * near / (far - near) / z**2, share * far / z)


def first_surface(fitted: FittedMap, chosen: Indices, offset: Floats | float = 0.0) -> tuple[Floats, Mask]:
    """(N,) depth of the surface that the light meets first, at (2, N) offsets in the map from chosen samples.

    It is the triangle of the lit sample that is nearest in the map. (N,) bool: whether the place is in its pixel, and
    the camera sees that surface.
    """
    samples, footprint = fitted.samples, fitted.footprint
    half = np.abs(footprint.jacobian).sum(axis=1) * samples.step  # a pixel either way
    places = footprint.coords[:2, chosen] + offset
    surface, known = np.zeros(len(chosen)), np.zeros(len(chosen), dtype=bool)
    for index, space in enumerate(fitted.spaces):
        lit, tree = fitted.lit_samples[index]
        own = np.flatnonzero(fitted.face[chosen] == index)
        if len(lit) and len(own):
            near = lit[tree.query(places[:, own].T)[1]]
            away = places[:, own] - footprint.coords[:2, near]
            plane = footprint.coords[2, near] + (footprint.slope[:, near] * away).sum(axis=0)
            ahead = (space.origin - samples.view.scene.geometry.corners(samples.triangle[near])) @ space.basis[2]
            surface[own] = np.clip(plane, ahead.min(axis=1), ahead.max(axis=1))
            known[own] = (np.abs(away) <= half[:, near]).all(axis=0)
    return fitted.stored(np.vstack([places, surface])), known


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
    closest = float(np.quantile(depths.gap[dark], TOLERATED))
    return DepthBits(bits, (depths.far - depths.near) * metres, closest * metres, lost)


def bias_of(fitted: FittedMap, depths: Depths) -> BiasNeed | None:
    """The bias that the lit samples need, and the shadow that it costs; None if nothing is lit."""
    samples = fitted.samples
    lit, dark = np.flatnonzero(~samples.shadowed), np.flatnonzero(samples.shadowed)
    if not len(lit):
        return None
    metres = 1 / samples.placement.scale
    required = required_bias(fitted, lit)
    needed, worst = float(np.quantile(required, 1 - TOLERATED)), float(required.max())
    thinnest = bridged = None
    if len(dark):
        thinnest = float(np.quantile(depths.gap[dark], CONTACT)) * metres
        bridged = float((depths.gap[dark] < needed).mean())
    return BiasNeed(needed * metres, worst * metres, thinnest, bridged)


def required_bias(fitted: FittedMap, lit: Indices) -> Floats:
    """(L,) distance of each lit sample behind the depth stored in its texel, in local lengths along the map's depth.

    The texel's centre is at a random offset of up to half a texel from the sample. There the stored depth is that of
    the receiver's plane, but no nearer to the light than the first surface: a facet at grazing light is narrower than a
    texel.
    """
    at = fitted.footprint.select(lit)
    offset = (np.random.default_rng(0).random(fitted.footprint.slope.shape) - 0.5)[:, lit]
    offset *= fitted.extent[:, None] / fitted.texels(REFERENCE_SIZE)
    surface, known = first_surface(fitted, lit, -offset)
    plane = np.vstack([at.coords[:2] - offset, at.coords[2] - (at.slope * offset).sum(axis=0)])
    behind = fitted.stored(at.coords) - np.maximum(fitted.stored(plane), surface)
    return np.where(known, np.maximum(behind, 0.0), 0.0)


@dataclass(frozen=True)
class Penumbra:
    """The penumbrae of a view. Widths are in pixels, at the shadows' edges, in the widest direction.

    radius: of the light, in radians for a directional one, else in metres; half the longer side of a rectangle;
    assumed: True if the scene has none; median and p95: widths over edge pixels; share: of the scored pixels that see
    less than all of the light, those that see some of it; hard_rmse: the metric `rmse` of exact hard shadows, those of
    the light's centre.
    """

    radius: float
    assumed: bool
    median: float
    p95: float
    share: float
    hard_rmse: float

    @property
    def hard_is_enough(self) -> bool:
        """Whether their error is at most HARD_RMSE.

        Widths do not tell: narrow penumbrae are a large error where they cover much of the view, wide ones a small
        error where they cover little.
        """
        return self.hard_rmse <= HARD_RMSE


def penumbra_of(view: View, samples: Samples) -> Penumbra | None:
    """The penumbrae for the light's size, by default that of the sun or a bulb; None without edges or scored pixels.

    samples: of the view, from `sample_view`.
    """
    if not len(samples.edges):
        return None
    light, hard = sized_light(view.light), hard_view(view)
    truth = prepare_truth(cached_truth(replace(hard, light=light)))
    error = rmse(Comparison(cached_truth(hard).visibility, truth))
    if error is None:
        return None
    shadow = truth.visibility[truth.valid & (truth.visibility < 1)]
    radius = light.radius or max(light.size) / 2
    width = widths(samples, radius if light.kind == "directional" else samples.placement.length(radius))[samples.edges]
    return Penumbra(
        radius=float(radius),
        assumed=not view.light.soft,
        median=float(np.median(width)),
        p95=float(np.quantile(width, 0.95)),
        share=float((shadow > 0).mean()) if len(shadow) else 0.0,
        hard_rmse=error,
    )


def sized_light(light: Light) -> Light:
    """The light, with the size of the sun or a bulb if it has none."""
    if light.soft:
        return light
    if light.kind == "rectangle":
        return replace(light, size=(2 * BULB, 2 * BULB))
    return replace(light, radius=SUN_RADIUS if light.kind == "directional" else BULB)


def widths(samples: Samples, radius: float) -> Floats:
    """(R,) width of the penumbra at each sample in pixels; 0 where lit.

    By similar triangles, perpendicular to the light ray: 2 tan(radius) · blocker for a sun; 2 radius ·
    blocker/(distance − blocker) otherwise, as in PCSS (Fernando 2005), with the denominator at least the radius.
    """
    if samples.view.light.kind == "directional":
        across = 2 * np.tan(radius) * samples.blocker
    else:
        with np.errstate(invalid="ignore"):
            across = 2 * radius * samples.blocker / np.maximum(samples.distance - samples.blocker, radius)
    steps = samples.across, samples.down
    derivatives = (step - samples.to_light * (step * samples.to_light).sum(axis=0) for step in steps)
    with np.errstate(invalid="ignore"):
        return np.where(samples.shadowed, across * longest(*derivatives), 0.0)
