"""The map sizes that a view needs, of one map and of cascades, from the extent of texels in pixels."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from shadowbench.geometry.convex import caster_and_receiver_vertices, practical_depths, slices
from shadowbench.geometry.lights import LightSpace
from shadowbench.scenes.model import View
from shadowbench.scenes.triangles import bounds_of
from shadowbench.scenes.vectors import Floats
from shadowbench.survey.depth import Depths, first_surface
from shadowbench.survey.samples import FLAT, REFERENCE_SIZE, FittedMap

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
