"""Casters: closed parts, silhouette edges, and those that cannot shadow any visible receiver.

The last conservatively: a grid in light space has the depth of the farthest visible receiver in each cell. A triangle
matters if any cell that its bounds overlap has a receiver behind the triangle's nearest corner.
"""

from dataclasses import dataclass, field
from itertools import product

import numpy as np

from shadowbench.geometry.topology import topology_of
from shadowbench.scenes.model import View
from shadowbench.scenes.triangles import Geometry, in_slices
from shadowbench.scenes.vectors import Floats
from shadowbench.survey.maps import FittedMap, Footprint
from shadowbench.truths.rays import Indices, Mask

CELLS = 1024  # along a side of the grid; a power of two
ROUNDING = 1e-6  # tolerance of depths and bounds
LEVELS = CELLS.bit_length()  # of the grid's pyramid, each with half the resolution of the previous, down to one cell
_POINTS = 1 << 16  # on cut-out casters
_OFFSETS = np.cumsum([0, *((CELLS >> k) ** 2 for k in range(LEVELS - 1))])
IN_FRONT = 1e-6  # distance from the plane of a spot or point light within which triangles always matter, local length


@dataclass(frozen=True)
class Casters:
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


def casters_of(view: View) -> Casters:
    """The casters of a view in local coordinates."""
    topology, vertices = topology_of(view.scene), view.scene.geometry.vertices
    faces, closed = topology.faces, topology.closed[topology.part]
    a, b, c = (vertices[faces[:, k]] for k in range(3))
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
    return Casters(
        triangles=len(faces),
        closed=int(np.count_nonzero(closed)),
        open=int(np.count_nonzero(topology.open[topology.part])),
        silhouette=int(np.count_nonzero(walls)),
        walls=int(np.where(in_closed, np.abs(walls) // 2, np.abs(walls)).sum()),
        edges=len(first),
        cut_out=int((view.scene.geometry.casts & view.scene.geometry.is_cut_out).sum()),
        opaque=_opaque_share(view.scene.geometry),
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


@dataclass(frozen=True, eq=False)
class RelevantCasters:
    """The casters that can shadow visible receivers.

    triangles: number of caster triangles; useless: number of those that cannot shadow any visible receiver; matters:
    (C,) bool over `geometry.caster_faces`, the others. sure: False if not every pixel was sampled, so that receivers
    between the samples may be missed, or if the light has a size, as only its centre is considered.
    """

    triangles: int
    useless: int
    matters: Mask = field(repr=False)
    sure: bool


def relevant_casters(fitted: FittedMap) -> RelevantCasters:
    """The casters that can be between the light and a visible receiver."""
    samples = fitted.samples
    geometry = samples.view.scene.geometry
    faces = geometry.caster_faces
    matters = np.zeros(len(faces), dtype=bool)
    for _, space, footprint in fitted.light_spaces():
        if not footprint.coords.shape[1]:
            continue
        x, y, back = space.basis @ geometry.vertices.T - (space.basis @ space.origin)[:, None]
        in_front = np.maximum(-back, IN_FRONT) if space.perspective else 1.0
        coords = np.stack([x / in_front, y / in_front, -back])
        grid = _Grid(footprint, samples.step)
        for part in in_slices(len(faces)):
            a, b, c = (coords.take(corner, axis=1) for corner in faces[part].T)
            bounded = np.ones(a.shape[1], dtype=bool)
            if space.perspective:
                behind = np.sum([corner[2] <= IN_FRONT for corner in (a, b, c)], axis=0)
                bounded = behind == 0
                matters[part] |= ~bounded & (behind < 3)  # triangles through the light's plane have no bounds
            low, high = np.minimum(np.minimum(a, b), c), np.maximum(np.maximum(a, b), c)
            matters[part] |= bounded & grid.touches(low, high)
    sure = samples.step == 1 and not samples.view.light.soft
    return RelevantCasters(len(faces), int((~matters).sum()), matters, sure)


class _Grid:
    """The farthest visible receiver in each cell of a grid in light space, and of coarser grids: a pyramid.

    Each sample is enlarged to its whole pixel and half the sampling step.
    """

    def __init__(self, footprint: Footprint, step: int) -> None:
        half = np.abs(footprint.jacobian).sum(axis=1) * ((step + 1) / 2)
        depth = footprint.coords[2] + (np.abs(footprint.slope) * half).sum(axis=0)
        low, high = footprint.coords[:2] - half, footprint.coords[:2] + half
        self.start, self.end = low.min(axis=1)[:, None], high.max(axis=1)[:, None]
        self.cell = np.maximum(self.end - self.start, ROUNDING) / (CELLS - 2)
        levels = [np.full((CELLS >> k, CELLS >> k), -np.inf) for k in range(LEVELS)]
        x, y, level = self._cells(low, high)
        # Wide ranges are written to coarse levels, and propagate to the finer levels from there.
        for k in reversed(range(LEVELS)):
            mine = level == k
            for corner in product(x[:, mine], y[:, mine]):
                np.maximum.at(levels[k], corner, depth[mine])
            if k:
                levels[k - 1] = np.maximum(levels[k - 1], levels[k].repeat(2, axis=0).repeat(2, axis=1))
        for k in range(1, LEVELS):
            levels[k] = levels[k - 1].reshape(CELLS >> k, 2, CELLS >> k, 2).max(axis=(1, 3))
        self.farthest = np.concatenate([one.ravel() for one in levels])

    def _cells(self, low: Floats, high: Floats) -> tuple[Indices, Indices, Indices]:
        """First and last column and row, (2, N) each, and the finest level, (N,), at which these are neighbours.

        low, high: (2, N) bounds in light space.
        """
        first, last = (
            np.clip((corner - self.start) / self.cell + 1.0, 0.0, CELLS - 1.0).astype(np.intp) for corner in (low, high)
        )
        level = np.ceil(np.log2(np.maximum((last - first).max(axis=0), 1))).astype(np.intp)
        x, y = np.stack([first, last], axis=1) >> level
        return x, y, level

    def touches(self, low: Floats, high: Floats) -> Mask:
        """(F,) bool: whether triangles with (3, F) lowest and highest corners may be in front of visible receivers."""
        x, y, level = self._cells(low[:2] - ROUNDING * self.cell, high[:2] + ROUNDING * self.cell)
        cells = [self.farthest[_OFFSETS[level] + one * (CELLS >> level) + other] for one, other in product(x, y)]
        outside = (high[:2] < self.start).any(axis=0) | (low[:2] > self.end).any(axis=0)
        return np.asarray(~outside & (np.max(cells, axis=0) >= low[2] - ROUNDING * (1 + np.abs(low[2]))))
