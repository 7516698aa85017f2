"""The visible receivers of a view, by the arrays of its truth, its casters, and the penumbrae of its light.

In local coordinates. `needs` traces nothing itself: a truth has a pixel's triangle, whether it is lit, and the distance
to its blocker; the geometry has the rest.
"""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from shadowbench.errors import InputError
from shadowbench.geometry.planes import find_planes
from shadowbench.geometry.topology import topology_of
from shadowbench.measure.scoring import prepare_truth
from shadowbench.scenes.model import SUN_RADIUS, Light, Placement, View
from shadowbench.scenes.triangles import Geometry
from shadowbench.scenes.vectors import Floats
from shadowbench.scores.comparison import Comparison
from shadowbench.scores.metrics import rmse
from shadowbench.truths.cache import cached_truth
from shadowbench.truths.rays import EDGE_ON, Indices, Mask, dot

LATTICE = 512  # largest number of sampled pixels along a side
BULB = 0.03
"""Radius of a common household bulb, in metres (A60: 60 mm across)."""
HARD_RMSE = 0.02
"""RMSE up to which hard shadows suffice: what `recommend` asks of soft shadows by default."""
_POINTS = 1 << 16  # on cut-out casters


@dataclass(frozen=True, eq=False)
class Samples:
    """The R decided receivers at the centres of the sampled pixels.

    view, placement: in local coordinates, the view being as large as the lattice of sampled pixels; step: pixels of the
    whole view between them; pixel: (R,) index in the lattice, row by row; triangle: (R,); point, normal (towards the
    camera), to_light (unit): (3, R); distance: (R,) to the light, inf for a directional one; across, down: (3, R)
    derivatives of the point, on its plane, by a pixel of the view to the right and downwards; blocker: (R,) distance
    along L to the nearest caster, inf where lit.
    """

    view: View
    placement: Placement
    step: float
    pixel: Indices
    triangle: Indices
    point: Floats
    normal: Floats
    to_light: Floats
    distance: Floats
    across: Floats
    down: Floats
    blocker: Floats

    @cached_property
    def cosine(self) -> Floats:
        """(R,) N·L."""
        return dot(self.normal, self.to_light)

    @cached_property
    def shadowed(self) -> Mask:
        """(R,) bool: whether each sample is in shadow."""
        return np.isfinite(self.blocker)

    @cached_property
    def edges(self) -> Indices:
        """(E,) indices of the edge pixels: samples in shadow with a lit receiver among their four neighbours."""
        width, height = self.view.size
        lit = np.zeros((height + 2, width + 2), dtype=bool)
        row, column = np.divmod(self.pixel, width)
        lit[row + 1, column + 1] = ~self.shadowed
        beside = lit[row, column + 1] | lit[row + 2, column + 1] | lit[row + 1, column] | lit[row + 1, column + 2]
        return np.flatnonzero(self.shadowed & beside)


def hard_view(view: View) -> View:
    """The view of at most LATTICE pixels along its longer side, with the centre of the light alone."""
    light = replace(view.light, radius=0.0, size=(0.0, 0.0))
    return replace(view, size=view.size.times(min(1.0, LATTICE / max(view.size))), light=light)


def sample_view(view: View) -> Samples:
    """The samples of a view from `view_of`. Raises InputError if no receiver is visible."""
    hard = hard_view(view)
    truth, (width, height) = cached_truth(hard), hard.size
    pixel = np.flatnonzero(truth.receivers & ~truth.undecided)
    if not len(pixel):
        raise InputError(
            f"view {view.camera.name!r} of {view.scene.name}: no pixel shows a receiver that {view.light.name!r} "
            "lights; needs are those of the visible receivers"
        )
    placed, placement = hard.placed()
    triangle = truth.triangle.ravel()[pixel].astype(np.intp)
    a, b, c = placed.scene.geometry.corners(triangle).transpose(1, 2, 0)
    right, up, back = placed.camera.basis()[:, :, None]
    position, extent, step = np.array(placed.camera.position)[:, None], placed.pixel, view.size.height / height
    moves, converging = (extent * right, -extent * up), placed.camera.converging
    y, x = np.divmod(pixel, width)
    beside = (x + 0.5 - width / 2) * moves[0] + (y + 0.5 - height / 2) * moves[1]
    starts, rays = position + (1 - converging) * beside, converging * beside - back
    normal = np.cross(b - a, c - a, axis=0)
    normal *= -np.sign(dot(normal, rays)) / np.sqrt(dot(normal, normal))
    slant = np.minimum(dot(normal, rays), -EDGE_ON)
    depth = dot(normal, a - starts) / slant
    # Derivatives of P = S + t·d, t = N·(A − S)/(N·d), along the image's axes. Pixels are as large as at depth `spread`.
    spread = converging * depth + (1 - converging)
    across, down = (spread / step * (move - rays * (dot(normal, move) / slant)) for move in moves)
    point = starts + rays * depth
    source, w = placed.light.homogeneous
    to_light = np.array(source)[:, None] - w * point
    length = np.sqrt(dot(to_light, to_light))
    return Samples(
        view=placed,
        placement=placement,
        step=step,
        pixel=pixel,
        triangle=triangle,
        point=point,
        normal=normal,
        to_light=to_light / length,
        distance=length if w else np.full(len(pixel), np.inf),
        across=across,
        down=down,
        blocker=truth.blocker.ravel()[pixel].astype(np.float64) * placement.scale,
    )


def longest(derivatives: Floats) -> Floats:
    """(R,) largest extent of a unit in pixels: 1/σ of the smaller singular value σ.

    derivatives: (K, 2, R) of coordinates by a pixel across and down.
    """
    across, down = derivatives[:, 0], derivatives[:, 1]
    square_a, square_b = (across**2).sum(axis=0), (down**2).sum(axis=0)
    both = (across * down).sum(axis=0)
    # σ² are the eigenvalues of the Gram matrix; the smaller one as a quotient, which avoids cancellation.
    larger = (square_a + square_b + np.hypot(square_a - square_b, 2 * both)) / 2
    determinant = np.maximum(square_a * square_b - both**2, np.finfo(float).tiny)
    return np.asarray(np.sqrt(larger / determinant))


@dataclass(frozen=True)
class Receivers:
    """The visible receivers, which face the light.

    pixels: their share of the view; shadowed: their share in shadow; planar: their share on planes that
    `planar-projection` finds by default; lost: share of the shadow on other receivers; planes: number of visible
    planes.
    """

    pixels: float
    shadowed: float
    planar: float
    lost: float
    planes: int


def receivers_of(samples: Samples) -> Receivers:
    """Statistics of the visible receivers."""
    geometry = samples.view.scene.geometry
    planes = np.full(len(geometry.faces), -1)
    for index, plane in enumerate(find_planes(geometry)):
        planes[plane.triangles] = index
    seen = planes[samples.triangle]
    return Receivers(
        pixels=len(samples.pixel) / samples.view.size.pixels,
        shadowed=float(samples.shadowed.mean()),
        planar=float((seen >= 0).mean()),
        lost=float((seen[samples.shadowed] < 0).mean()) if samples.shadowed.any() else 0.0,
        planes=len(np.unique(seen[seen >= 0])),
    )


@dataclass(frozen=True)
class CasterCounts:
    """Exact counts over all caster triangles, welded as for shadow volumes.

    triangles: number of caster triangles; closed: those in closed parts that are wound outwards, a part being a set of
    triangles connected by edges; open: those in parts with boundary edges; all others are in closed parts not wound
    outwards. silhouette: number of silhouette edges for the light; walls: that shadow volumes extrude from them, two
    from an edge between triangles of a part that is not closed; edges: number of all edges. cut_out: number of those
    that are cut out by alpha; opaque: share of their area that is opaque, to about 0.2%, 1 without any.
    """

    triangles: int
    closed: int
    open: int
    silhouette: int
    walls: int
    edges: int
    cut_out: int
    opaque: float


def count_casters(view: View) -> CasterCounts:
    """The casters of a view in local coordinates."""
    topology, geometry = topology_of(view.scene), view.scene.geometry
    faces, closed = topology.faces, topology.closed[topology.part]
    a, b, c = (geometry.vertices[faces[:, k]] for k in range(3))
    source, w = view.light.homogeneous
    lit = np.einsum("ij,ij->i", np.array(source) - w * a, np.cross(b - a, c - a)) > 0
    # Each triangle adds a signed wall per half-edge, by its orientation towards the light; an edge whose walls cancel
    # is not a silhouette edge.
    start, end = faces.ravel(), np.roll(faces, -1, axis=1).ravel()
    wall = np.append(np.where((start < end) == np.repeat(lit, 3), 1, -1), 0)  # the last, index −1, for no half-edge
    edges = topology.edges[:, 1:3]
    first = np.flatnonzero((np.diff(edges, axis=0, prepend=-1) != 0).any(axis=1))
    walls = np.add.reduceat(wall[topology.half_edges].sum(axis=1), first) if len(first) else first
    in_closed = closed[topology.half_edges[first].max(axis=1) // 3] if len(first) else np.zeros(0, dtype=bool)
    return CasterCounts(
        triangles=len(faces),
        closed=int(np.count_nonzero(closed)),
        open=int(np.count_nonzero(topology.open[topology.part])),
        silhouette=int(np.count_nonzero(walls)),
        walls=int(np.where(in_closed, np.abs(walls) // 2, np.abs(walls)).sum()),
        edges=len(first),
        cut_out=int((geometry.casts & geometry.is_cut_out).sum()),
        opaque=_opaque_share(geometry),
    )


def _opaque_share(geometry: Geometry) -> float:
    """Share of the cut-out casters' area that is opaque, by random points on it."""
    cut = geometry.caster_cutouts
    if cut is None:
        return 1.0
    random, areas = np.random.default_rng(0), np.linalg.norm(geometry.crosses, axis=0)
    ends = np.cumsum(areas[geometry.casts & geometry.is_cut_out])
    chosen = np.searchsorted(ends, random.random(_POINTS) * ends[-1], side="right")
    return float(cut.opaque(np.minimum(chosen, len(ends) - 1), random.dirichlet(np.ones(3), _POINTS)).mean())


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
    width = _widths(samples, radius if light.kind == "directional" else samples.placement.length(radius))
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


def _widths(samples: Samples, radius: float) -> Floats:
    """(E,) width of the penumbra at each edge pixel.

    By similar triangles, perpendicular to the light ray: 2 tan(radius) · blocker for a sun; 2 radius ·
    blocker/(distance − blocker) otherwise, as in PCSS (Fernando 2005), with the denominator at least the radius.
    """
    blocker, to_light = samples.blocker[samples.edges], samples.to_light[:, samples.edges]
    if samples.view.light.kind == "directional":
        across = 2 * np.tan(radius) * blocker
    else:
        across = 2 * radius * blocker / np.maximum(samples.distance[samples.edges] - blocker, radius)
    steps = np.stack([samples.across, samples.down], axis=1)[..., samples.edges]
    return np.asarray(across * longest(steps - to_light[:, None] * (steps * to_light[:, None]).sum(axis=0)))
