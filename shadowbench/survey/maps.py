"""What a view asks of the map that techniques fit to it: sizes of one map and of cascades, depth format, bias."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.spatial import cKDTree

from shadowbench.geometry.convex import caster_and_receiver_vertices, practical_depths, slices
from shadowbench.geometry.lights import Box, LightSpace, light_space, window
from shadowbench.scenes.triangles import bounds_of
from shadowbench.scenes.vectors import Floats, perpendicular_basis
from shadowbench.survey.samples import Samples, longest
from shadowbench.truths.rays import Indices, Mask

REFERENCE_SIZE = 1024  # map size, the techniques' default, for which texels and biases are reported
PADDING = 2.0  # default texels around the receivers: one for a 2×2 comparison, one for receivers offset by a bias
FLAT = 1e-9  # least extent of a map, a local length
TOLERATED = 0.001  # tolerated share of wrong samples, of those in shadow or of those lit
CONTACT = 0.01  # share of the shadow with the smallest gaps, excluded as contact
BIAS_STEPS = 4.0  # quantization steps of the depth format that biases add by default
WRONG = 0.05  # tolerated share of wrong edge pixels; above it `edge_p95` is at least a pixel
LIMIT, GRAZING_SLOPE = 16.0, 50.0  # of the bias `texel`, the techniques' default
COUNTS = (2, 3, 4, 5, 6, 7, 8)  # of cascades
STEP, STEPS = 2**0.25, 24  # in which a map size is enlarged until the shadow that the bias lights is small enough
DIRECTIONS = 16  # of shadow edges in the map, over 180°, all equally likely
# Mean displacement, in texels, of a straight edge by a 2×2 linear comparison, by its angle to the grid's nearer axis:
# Monte Carlo over the grid's position, ± 0.001, repeated by tests/survey/test_sizes.py.
ANGLES = np.radians([0.0, 10.0, 20.0, 30.0, 40.0, 45.0])
DISPLACEMENTS = np.array([0.250, 0.218, 0.182, 0.159, 0.168, 0.181])


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


@dataclass(frozen=True, eq=False)
class FittedMap:
    """One map fitted to samples, as by `fit=visible`, or a point light's cube map.

    spaces: the map's light space, or those of a cube's six faces; face: (R,) index of each sample's; coords: (3, R) u,
    v and distance along the light's axis, as in `Box`, in units of light space, or of a cube's face at distance 1;
    jacobian: (2, 2, R) d(u, v)/d(x, y), with x and y in pixels, y downwards; slope: (2, R) derivative of the receiver
    plane's distance by u and v; extent: (2,) width and height of the map without its padding, texels on each side;
    oriented: whether maps and cascades are rotated to the least area, as by the parameter of that name.
    """

    samples: Samples
    spaces: tuple[LightSpace, ...]
    face: Indices
    coords: Floats
    jacobian: Floats
    slope: Floats
    extent: Floats
    padding: float
    oriented: bool

    @property
    def cube(self) -> bool:
        """Whether it is a cube map."""
        return len(self.spaces) > 1

    @property
    def texels(self) -> float:
        """Number of texels along a side of a map of REFERENCE_SIZE, without the padding."""
        return REFERENCE_SIZE - 2 * self.padding

    @cached_property
    def lit_samples(self) -> list[tuple[Indices, cKDTree]]:
        """For each light space the indices of its lit samples, and a tree of their places in the map."""
        lit = [np.flatnonzero(~self.samples.shadowed & (self.face == index)) for index in range(len(self.spaces))]
        return [(own, cKDTree(self.coords[:2, own].T)) for own in lit]

    def stored(self, coords: Floats) -> Floats:
        """(N,) what the map stores at (3, N) coordinates, a local length: a cube the distance to the light."""
        u, v, ahead = coords
        return np.asarray(ahead * np.sqrt(u**2 + v**2 + 1) if self.cube else ahead)

    def first_surface(self, chosen: Indices, offset: Floats | float = 0.0) -> tuple[Floats, Mask]:
        """(N,) depth of the surface that the light meets first, at (2, N) offsets in the map from chosen samples.

        It is the triangle of the lit sample that is nearest in the map. (N,) bool: whether the place is in its pixel,
        and the camera sees that surface.
        """
        half = np.abs(self.jacobian).sum(axis=1) * self.samples.step  # a pixel either way
        places = self.coords[:2, chosen] + offset
        surface, known = np.zeros(len(chosen)), np.zeros(len(chosen), dtype=bool)
        for index, space in enumerate(self.spaces):
            lit, tree = self.lit_samples[index]
            own = np.flatnonzero(self.face[chosen] == index)
            if len(lit) and len(own):
                near = lit[tree.query(places[:, own].T)[1]]
                away = places[:, own] - self.coords[:2, near]
                plane = self.coords[2, near] + (self.slope[:, near] * away).sum(axis=0)
                corners = self.samples.view.scene.geometry.corners(self.samples.triangle[near])
                ahead = (space.origin - corners) @ space.basis[2]
                surface[own] = np.clip(plane, ahead.min(axis=1), ahead.max(axis=1))
                known[own] = (np.abs(away) <= half[:, near]).all(axis=0)
        return self.stored(np.vstack([places, surface])), known

    @cached_property
    def depths(self) -> Depths:
        """The depths of the samples."""
        samples, z = self.samples, self.stored(self.coords)
        surface, known = self.first_surface(np.arange(len(z)))
        behind = np.where(known, z - surface, 0.0)
        if self.cube:  # which stores the distance to the light
            away = samples.view.scene.geometry.vertices - samples.view.light.position
            far = float(np.linalg.norm(away, axis=1).max())
            gap = np.where(samples.shadowed, np.maximum(samples.blocker, behind), np.inf)
            return Depths(0.0, far, gap, known, np.full(len(z), 1 / far), z / far)
        (space,) = self.spaces
        samples_box = Box(self.coords.min(axis=1), self.coords.max(axis=1))
        box = window(samples_box, space, REFERENCE_SIZE, self.padding, (0.0, 0.0))
        near, far = float(box.low[2]), float(box.high[2])
        along = np.einsum("ij,i->j", samples.to_light, space.basis[2])
        # Casters in front of the near plane are clamped to it.
        gap = np.minimum(np.maximum(samples.blocker * along, behind), z - near)
        gap, share = np.where(samples.shadowed, gap, np.inf), (z - near) / (far - near)
        if not space.perspective:
            return Depths(near, far, gap, known, np.full(len(z), 1 / (far - near)), share)
        return Depths(near, far, gap, known, far * near / (far - near) / z**2, share * far / z)


def fitted_map(samples: Samples, oriented: bool = True) -> FittedMap:
    """The map that techniques fit to samples by default. oriented: as the parameter of the fits."""
    light, face = samples.view.light, np.zeros(len(samples.pixel), dtype=np.intp)
    if light.kind == "point":
        origin = np.array(light.position)
        away = samples.point - origin[:, None]
        face = 2 * np.abs(away).argmax(axis=0)
        face += np.take_along_axis(away, face[None] // 2, axis=0)[0] < 0
        backs = [np.eye(3)[index // 2] * (1 if index % 2 else -1) for index in range(6)]
        spaces = tuple(LightSpace(perpendicular_basis(back, (0.0, 1.0, 0.0)), origin, True, 1.0) for back in backs)
    else:
        level = light_space(light)
        spaces = (level.oriented(samples.point.T)[0] if oriented else level,)
    bases = np.array([space.basis for space in spaces])[face]

    def turned(vectors: Floats) -> Floats:
        """(3, R) vectors in the light space of each sample."""
        return np.asarray(np.einsum("rij,jr->ir", bases, vectors))

    x, y, back = turned(samples.point - spaces[0].origin[:, None])
    uv, ahead = np.stack([x, y]), -back
    derivatives = np.stack([turned(samples.across), turned(samples.down)], axis=1)
    jacobian, slope = derivatives[:2], turned(samples.normal)[:2] / samples.cosine
    if spaces[0].perspective:
        uv /= ahead
        jacobian = (jacobian + uv[:, None] * derivatives[2]) / ahead
        # On the plane N·P = c, seen along d = (u, v, −1), ahead = c/(N·d), and N·d = −(N·L)|d|.
        slope *= ahead**2 / samples.distance
    coords = np.vstack([uv, ahead])
    extent, padding = np.maximum(np.ptp(uv, axis=1), FLAT), PADDING
    if light.kind == "point":  # whose faces cover all around
        extent, padding = np.full(2, 2.0), 0.0
    return FittedMap(samples, spaces, face, coords, jacobian, slope, extent, padding, oriented)


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


def bits_of(samples: Samples, depths: Depths) -> DepthBits | None:
    """The smallest sufficient depth format; None if nothing is in shadow."""
    dark = samples.shadowed
    if not dark.any():
        return None
    gap, stored = (depths.gap * depths.per_length)[dark], depths.stored[dark]
    # Floats have 24 significant bits; with reversed depth, relative to the distance from the far plane.
    steps: dict[int, float | Floats] = {16: 2.0**-16, 24: 2.0**-24, 32: 2.0**-24 * (1 - stored)}
    lost = {bits: float((gap < BIAS_STEPS * step).mean()) for bits, step in steps.items()}
    bits = next((bits for bits, share in lost.items() if share <= TOLERATED), None)
    metres = 1 / samples.placement.scale
    closest = float(np.quantile(depths.gap[dark], TOLERATED))
    return DepthBits(bits, (depths.far - depths.near) * metres, closest * metres, lost)


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


def bias_of(fitted: FittedMap) -> BiasNeed | None:
    """The bias that the lit samples need, and the shadow that it costs; None if nothing is lit.

    A lit sample needs its distance behind the depth stored in its texel, whose centre is at a random offset of up to
    half a texel from it. There the stored depth is that of the receiver's plane, but no nearer to the light than the
    first surface: a facet at grazing light is narrower than a texel.
    """
    samples, lit = fitted.samples, np.flatnonzero(~fitted.samples.shadowed)
    if not len(lit):
        return None
    offset = (np.random.default_rng(0).random(fitted.slope.shape) - 0.5)[:, lit]
    offset *= fitted.extent[:, None] / fitted.texels
    surface, known = fitted.first_surface(lit, -offset)
    u, v, ahead = fitted.coords[:, lit]
    plane = np.stack([u - offset[0], v - offset[1], ahead - (fitted.slope[:, lit] * offset).sum(axis=0)])
    behind = fitted.stored(fitted.coords[:, lit]) - np.maximum(fitted.stored(plane), surface)
    required = np.where(known, np.maximum(behind, 0.0), 0.0)
    metres, needed = 1 / samples.placement.scale, float(np.quantile(required, 1 - TOLERATED))
    gap, thinnest, bridged = fitted.depths.gap[samples.shadowed], None, None
    if len(gap):
        thinnest, bridged = float(np.quantile(gap, CONTACT)) * metres, float((gap < needed).mean())
    return BiasNeed(needed * metres, float(required.max()) * metres, thinnest, bridged)


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


def texels_of(fitted: FittedMap) -> Texels:
    """The needed size of one map, or of a cube's faces."""
    pixels = longest(fitted.jacobian / fitted.extent[:, None, None])  # of a 1 × 1 map
    p95 = float(np.quantile(pixels, 0.95))
    return Texels(
        largest=float(pixels.max()) / fitted.texels,
        p95=p95 / fitted.texels,
        size=p95 + 2 * fitted.padding,
        edge_size=_edge_size(fitted, fitted.extent[:, None], fitted.jacobian) if len(fitted.samples.edges) else None,
        faces=len(fitted.spaces),
    )


def _edge_size(fitted: FittedMap, extent: Floats, jacobian: Floats) -> float:
    """The map size at which at most a share WRONG of the edge pixels, of which there are some, is wrong.

    extent: (2, 1) of the map, or (2, R) of each sample's cascade; jacobian: (2, 2, R) along its sides. Wrong are edges
    that texels displace, and those around shadow that the bias lights: a lit pixel counts as one.
    """
    samples = fitted.samples
    displacement = _displacement((jacobian / extent[:, None])[..., samples.edges])
    displaced = texels_for(displacement)
    edges = 2 * len(samples.edges)  # of the mask and of the truth
    lit_by_bias = _lit_by_bias(fitted, extent)
    for step in range(STEPS + 1):
        texels = displaced * STEP**step
        # In a lattice of samples, edges are as sparse as its rows: a lit sample stands for `step` pixels of an edge.
        lit = lit_by_bias(texels) * samples.step
        wrong = np.minimum(displacement / texels, 1).mean() * edges + lit
        if wrong <= (1 + 1e-9) * WRONG * (edges + lit):
            break
    return float(displaced * STEP ** max(step - 0.5, 0.0) + 2 * fitted.padding)


def _displacement(jacobian: Floats) -> Floats:
    """(E, DIRECTIONS) mean displacement of a shadow edge in pixels by a 2×2 comparison, if a unit is a texel.

    Measured along the image's column or row, whichever is closer to the edge's normal: below 1 it is the share of the
    edge's pixels that are wrong.
    """
    angle = (np.arange(DIRECTIONS) + 0.5) * (np.pi / DIRECTIONS)
    normal = np.stack([np.cos(angle), np.sin(angle)])
    from_axis = np.arcsin(np.abs(normal).min(axis=0))
    texels = np.abs(np.einsum("id,ijr->jrd", normal, jacobian)).max(axis=0)
    return np.asarray(np.interp(from_axis, ANGLES, DISPLACEMENTS) / np.maximum(texels, np.finfo(float).tiny))


def _lit_by_bias(fitted: FittedMap, extent: Floats) -> Callable[[float], int]:
    """The number of samples in shadow, but not at its edge, that the default bias lights, by texels along a map's side.

    The bias `texel` is the depth change of the receiver's plane across a texel's diagonal, at most LIMIT texels, or
    twice that under a lamp; from GRAZING_SLOPE on, the receiver is moved off its surface by the diagonal instead. What
    the light meets first is counted where the camera sees it: most other casters are not that close to their shadow.
    """
    samples, coords, depths = fitted.samples, fitted.coords, fitted.depths
    dark = np.setdiff1d(np.flatnonzero(samples.shadowed & depths.known), samples.edges)
    cosine = samples.cosine[dark]
    sine = np.sqrt(np.maximum(1 - cosine**2, 0.0))
    ahead = coords[2, dark] if fitted.spaces[0].perspective else np.ones(len(dark))
    texel = np.broadcast_to(extent, (2, len(samples.pixel)))[:, dark] * ahead
    most = LIMIT * (1 if samples.view.light.kind == "directional" else 2) * texel.max(axis=0)
    off, low = np.hypot(*texel) * sine, sine >= GRAZING_SLOPE * cosine
    bias = np.minimum(off / cosine, most)[~low] / np.maximum(depths.gap[dark[~low]], np.finfo(float).tiny)
    grazing, off = dark[low], off[low]
    bases = np.array([space.basis[:2] for space in fitted.spaces])[fitted.face[grazing]]
    shift = np.einsum("rij,jr->ir", bases, samples.normal[:, grazing]) * off / ahead[low]
    depth, rise = fitted.stored(coords[:, grazing]), off * cosine[low]

    def lit(texels: float) -> int:
        surface, known = fitted.first_surface(grazing, shift / texels)
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

    depth_ratio: farthest over nearest view depth of the visible receivers; edge_size: of each map, as in `Texels`;
    best: number of cascades with the fewest texels in total; saving: texels of one map divided by those of this number.
    """

    depth_ratio: float
    edge_size: Mapping[int, float]
    best: int
    saving: float

    @property
    def worthwhile(self) -> bool:
        """Whether some number of cascades needs fewer texels than one map for the edges of the view."""
        return self.saving > 1.0


def cascades_of(fitted: FittedMap, one: Texels) -> CascadeSizes | None:
    """The needed sizes of cascades; None without edges, or for a light that is not directional. one: of one map."""
    samples, space = fitted.samples, fitted.spaces[0]
    if space.perspective or one.edge_size is None:
        return None
    bounds = bounds_of(caster_and_receiver_vertices(samples.view.scene.geometry))
    sizes = {count: _edge_size(fitted, *_cascade_frames(fitted, bounds, count)) for count in COUNTS}
    best = min(COUNTS, key=lambda count: count * sizes[count] ** 2)
    ahead = samples.view.camera.basis()[2] @ (np.array(samples.view.camera.position)[:, None] - samples.point)
    return CascadeSizes(
        depth_ratio=float(ahead.max() / ahead.min()),
        edge_size=sizes,
        best=best,
        saving=one.edge_size**2 / (best * sizes[best] ** 2),
    )


def _cascade_frames(fitted: FittedMap, bounds: Floats, count: int) -> tuple[Floats, Floats]:
    """(2, R) width and height of the first cascade that contains each sample, (2, 2, R) jacobian along its sides."""
    view, points, level = fitted.samples.view, fitted.samples.point.T, light_space(fitted.samples.view.light)
    extents, jacobian = np.zeros((2, len(points))), fitted.jacobian.copy()
    remaining = np.arange(len(points))
    parts = slices(view, practical_depths(*view.near_far, count), 0.0)
    for part in parts:
        corners = part.corners_within(bounds, float(np.abs(bounds).max()))
        space = level.oriented(corners)[0] if fitted.oriented else level
        box, coords = space.box(corners), space.coords(points[remaining])
        inside = ((coords >= box.low) & (coords <= box.high)).all(axis=1)
        inside |= part is parts[-1]  # samples outside the last box are so by rounding only
        chosen = remaining[inside]
        extents[:, chosen] = np.maximum((box.high - box.low)[:2, None], FLAT)
        if fitted.oriented:
            turn = space.basis[:2] @ fitted.spaces[0].basis[:2].T
            jacobian[..., chosen] = np.einsum("ij,jkr->ikr", turn, jacobian[..., chosen])
        remaining = remaining[~inside]
    return extents, jacobian
