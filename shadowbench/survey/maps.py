"""What a view asks of its shadow map: sizes of one map and of cascades, depth format, bias, softness."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from shadowbench.geometry.convex import caster_and_receiver_vertices, practical_depths, slices
from shadowbench.geometry.lights import LightSpace, window
from shadowbench.measure.scoring import prepare_truth
from shadowbench.scenes.geometry import bounds_of
from shadowbench.scenes.model import SUN_RADIUS, Light, View
from shadowbench.scenes.vectors import Floats
from shadowbench.scores.comparison import Comparison
from shadowbench.scores.metrics import rmse
from shadowbench.survey.samples import FLAT, REFERENCE_SIZE, FittedMap, Samples, hard_view, longest
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


WRONG = 0.05  # tolerated share of wrong edge pixels; above it `edge_p95` is at least a pixel
LIMIT, GRAZING_SLOPE = 16.0, 50.0  # of the bias `texel`, the techniques' default
COUNTS = (2, 3, 4, 5, 6, 7, 8)  # of cascades
STEP, STEPS = 2**0.25, 24  # in which a map size is enlarged until the shadow that the bias lights is small enough


@dataclass(frozen=True)
class Texels:
    """Extents of texels, and needed sizes, of a fitted map or of a cube's face.

    largest, p95: maximum and 95th percentile, over the visible receivers, of a texel's extent in pixels, for a map of
    REFERENCE_SIZE; size: map size at which the 95th percentile is one pixel; edge_size: map size at which 95% of the
    shadows' edge pixels are right, so that `edge_p95` is below 1, with the default bias and 2×2 comparisons, None
    without edges; faces: 6 for a cube, else 1.
    """

    largest: float
    p95: float
    size: float
    edge_size: float | None
    faces: int


def texels_of(fitted: FittedMap, depths: Depths) -> Texels:
    """The needed size of one map, or of a cube's faces."""
    pixels, texels = fitted.unit.longest, fitted.texels(REFERENCE_SIZE)  # of a 1 × 1 map
    p95 = float(np.quantile(pixels, 0.95))
    return Texels(
        largest=float(pixels.max()) / texels,
        p95=p95 / texels,
        size=p95 + 2 * fitted.padding,
        edge_size=edge_size(fitted, depths, fitted.extent),
        faces=len(fitted.spaces),
    )


def edge_size(fitted: FittedMap, depths: Depths, extent: Floats) -> float | None:
    """The map size at which at most a share WRONG of the edge pixels is wrong; None without edges.

    extent: (2,) or (2, R) of the map, or of each sample's cascade. Wrong are edges that texels displace, and those
    around shadow that the bias lights: a lit pixel counts as one.
    """
    samples = fitted.samples
    if not len(samples.edges):
        return None
    displacement = fitted.footprint.scaled(extent).select(samples.edges).displacement
    displaced = texels_for(displacement)
    edges = 2 * len(samples.edges)  # of the mask and of the truth
    lit_by_bias = _lit_by_bias(fitted, depths, extent)
    for step in range(STEPS + 1):
        texels = displaced * STEP**step
        # In a lattice of samples, edges are as sparse as its rows: a lit sample stands for `step` pixels of an edge.
        lit = lit_by_bias(texels) * samples.step
        wrong = np.minimum(displacement / texels, 1).mean() * edges + lit
        if wrong <= (1 + 1e-9) * WRONG * (edges + lit):
            break
    return float(displaced * STEP ** max(step - 0.5, 0.0) + 2 * fitted.padding)


def _lit_by_bias(fitted: FittedMap, depths: Depths, extent: Floats) -> Callable[[float], int]:
    """The number of samples in shadow, but not at its edge, that the default bias lights, by texels along a map's side.

    The bias `texel` is the depth change of the receiver's plane across a texel's diagonal, at most LIMIT texels, or
    twice that under a lamp; from GRAZING_SLOPE on, the receiver is moved off its surface by the diagonal instead. What
    the light meets first is counted where the camera sees it: most other casters are not that close to their shadow.
    """
    samples, coords = fitted.samples, fitted.footprint.coords
    dark = np.setdiff1d(np.flatnonzero(samples.shadowed & depths.known), samples.edges)
    cosine = samples.cosine[dark]
    sine = np.sqrt(np.maximum(1 - cosine**2, 0.0))
    ahead = coords[2, dark] if fitted.spaces[0].perspective else np.ones(len(dark))
    texel = np.broadcast_to(extent.reshape(2, -1), (2, len(samples.pixel)))[:, dark] * ahead
    most = LIMIT * (1 if samples.view.light.kind == "directional" else 2) * texel.max(axis=0)
    off, low = np.hypot(*texel) * sine, sine >= GRAZING_SLOPE * cosine
    bias = np.minimum(off / cosine, most)[~low] / np.maximum(depths.gap[dark[~low]], np.finfo(float).tiny)
    grazing, off = dark[low], off[low]
    bases = np.array([space.basis[:2] for space in fitted.spaces])[fitted.face[grazing]]
    shift = np.einsum("rij,jr->ir", bases, samples.normal[:, grazing]) * off / ahead[low]
    depth, rise = fitted.stored(coords[:, grazing]), off * cosine[low]

    def lit(texels: float) -> int:
        surface, known = first_surface(fitted, grazing, shift / texels)
        return int(np.count_nonzero(texels < bias) + np.count_nonzero(known & (depth - rise / texels <= surface)))

    return lit


def texels_for(displacement: Floats) -> float:
    """The texels along a map's side at which the share of wrong pixels, mean(min(displacement / texels, 1)), is WRONG.

    displacement: of edges in pixels for a map of one texel, of any shape, above 0. Exact: if the k smallest of n are
    below `texels` and the others saturate, the share is (sum of the k / texels + n − k) / n.
    """
    ordered = np.sort(displacement.ravel())
    count = len(ordered)
    before = np.concatenate([[0.0], np.cumsum(ordered)[:-1]])
    share = (before / ordered + np.arange(count, 0, -1)) / count  # with as many texels as each value
    k = int(np.flatnonzero(share > WRONG)[-1]) + 1  # exists, as at the smallest value all are wrong
    return float(ordered[:k].sum()) / (WRONG * count - (count - k))


@dataclass(frozen=True)
class CascadeSizes:
    """Needed map sizes by number of cascades, with default parameters otherwise.

    depth_ratio: farthest over nearest view depth of the visible receivers; size, edge_size: of each map, defined as in
    `Texels`; best: number of cascades with the fewest texels in total, by `edge_size`; saving: texels of one map
    divided by those of the best number of cascades; best_by_size, saving_by_size: the same by `size`, of the whole
    view, where edges may be at one distance only.
    """

    depth_ratio: float
    size: Mapping[int, float]
    edge_size: Mapping[int, float]
    best: int
    saving: float
    best_by_size: int
    saving_by_size: float

    @property
    def worthwhile(self) -> bool:
        """Whether some number of cascades needs fewer texels than one map for the edges of the view."""
        return self.saving > 1.0

    @property
    def worthwhile_elsewhere(self) -> bool:
        """Whether it does so for the visible receivers, though not for the edges that are there now."""
        return self.saving_by_size > 1.0 and not self.worthwhile


def cascades_of(fitted: FittedMap, depths: Depths, one: Texels) -> CascadeSizes | None:
    """The needed sizes of cascades; None without edges, or for a light that is not directional. one: of one map."""
    samples, space = fitted.samples, fitted.spaces[0]
    if space.perspective or one.edge_size is None:
        return None
    bounds = bounds_of(caster_and_receiver_vertices(samples.view.scene.geometry))
    sizes, edge_sizes = {}, {}
    for count in COUNTS:
        extents = _extents(samples.view, bounds, space, fitted.footprint.coords, count)
        sizes[count] = float(np.percentile(fitted.footprint.scaled(extents).longest, 95)) + 2 * fitted.padding
        by_edges = edge_size(fitted, depths, extents)
        assert by_edges is not None  # as there are edges
        edge_sizes[count] = by_edges
    best, best_by_size = (min(COUNTS, key=lambda count: count * some[count] ** 2) for some in (edge_sizes, sizes))
    ahead = samples.view.camera.basis()[2] @ (np.array(samples.view.camera.position)[:, None] - samples.point)
    return CascadeSizes(
        depth_ratio=float(ahead.max() / ahead.min()),
        size=sizes,
        edge_size=edge_sizes,
        best=best,
        saving=one.edge_size**2 / (best * edge_sizes[best] ** 2),
        best_by_size=best_by_size,
        saving_by_size=one.size**2 / (best_by_size * sizes[best_by_size] ** 2),
    )


def _extents(view: View, bounds: Floats, space: LightSpace, coords: Floats, count: int) -> Floats:
    """(2, R) width and height of the first cascade that contains each of (3, R) light-space coordinates."""
    extents = np.zeros((2, coords.shape[1]))
    remaining = np.arange(coords.shape[1])
    parts = slices(view.camera, practical_depths(*view.near_far, count), 0.0)
    for part in parts:
        box = space.box(part.corners_within(bounds, float(np.abs(bounds).max())))
        inside = np.full(len(remaining), True)
        if part is not parts[-1]:  # samples outside the last box are so by rounding only
            for row, low, high in zip(coords[:, remaining], box.low, box.high, strict=True):
                inside &= (row >= low) & (row <= high)
        extents[:, remaining[inside]] = np.maximum((box.high - box.low)[:2, None], FLAT)
        remaining = remaining[~inside]
    return extents
