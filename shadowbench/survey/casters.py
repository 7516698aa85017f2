"""Casters: closed parts, silhouette edges, and those that cannot shadow any visible receiver.

The last conservatively: a grid in light space has the depth of the farthest visible receiver in each cell. A triangle
matters if any cell that its bounds overlap has a receiver behind the triangle's nearest corner.
"""

from dataclasses import dataclass, field

import numpy as np

from shadowbench.compiled import compiled
from shadowbench.geometry.topology import topology_of
from shadowbench.scenes.model import View
from shadowbench.scenes.triangles import Geometry
from shadowbench.scenes.vectors import Floats
from shadowbench.survey.samples import FittedMap
from shadowbench.truths.rays import Indices, Mask

CELLS = 512  # along a side of the grid
ROUNDING = 1e-6  # tolerance of depths and bounds
IN_FRONT = 1e-6  # distance from the plane of a spot or point light within which triangles always matter, local length
_POINTS = 1 << 16  # on cut-out casters


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


def relevant_casters(fitted: FittedMap, sure: bool) -> RelevantCasters:
    """The casters that can be between the light and a visible receiver."""
    geometry = fitted.samples.view.scene.geometry
    faces = geometry.caster_faces
    matters = np.zeros(len(faces), dtype=bool)
    for chosen, space in fitted.parts():
        at = fitted.footprint.select(chosen)
        # Each sample is enlarged to its whole pixel and half the distance to the next sample.
        half = np.abs(at.jacobian).sum(axis=1) * ((fitted.samples.step + 1) / 2)
        farthest = at.coords[2] + (np.abs(at.slope) * half).sum(axis=0)
        start, end = (at.coords[:2] - half).min(axis=1), (at.coords[:2] + half).max(axis=1)
        cell = np.maximum(end - start, ROUNDING) / CELLS

        def cells(corner: Floats, start: Floats = start[:, None], cell: Floats = cell[:, None]) -> Indices:
            inside: Indices = np.clip((corner - start) / cell, 0, CELLS - 1).astype(np.intp)
            return inside

        grid = np.full((CELLS, CELLS), -np.inf)
        _deepen(grid, cells(at.coords[:2] - half), cells(at.coords[:2] + half), farthest)
        x, y, back = space.basis @ geometry.vertices.T - (space.basis @ space.origin)[:, None]
        in_front = np.maximum(-back, IN_FRONT) if space.perspective else 1.0
        corners = np.stack([x / in_front, y / in_front, -back])[:, faces]  # (3, C, 3)
        low, high = corners.min(axis=2), corners.max(axis=2)
        through = space.perspective & (low[2] <= IN_FRONT) & (high[2] > IN_FRONT)  # the light's plane: no bounds
        before = (high[2] > IN_FRONT) | (not space.perspective)
        outside = (high[:2] < (start - ROUNDING)[:, None]).any(axis=0) | (low[:2] > (end + ROUNDING)[:, None]).any(
            axis=0
        )
        nearest = low[2] - ROUNDING * (1 + np.abs(low[2]))
        hides = np.zeros(len(faces), dtype=bool)
        _find_hiding(grid, cells(low[:2] - ROUNDING), cells(high[:2] + ROUNDING), nearest, hides)
        matters |= through | (before & hides & ~outside)
    return RelevantCasters(len(faces), int((~matters).sum()), matters, sure)


@compiled()
def _deepen(grid, first, last, depth):  # type: ignore[no-untyped-def]
    """Raise the cells from first to last, (2, N), of each sample to its depth."""
    for i in range(len(depth)):
        for x in range(first[0, i], last[0, i] + 1):
            for y in range(first[1, i], last[1, i] + 1):
                grid[x, y] = max(grid[x, y], depth[i])


@compiled()
def _find_hiding(grid, first, last, depth, hides):  # type: ignore[no-untyped-def]
    """Mark the triangles in front of a receiver in any of the cells from first to last, (2, C)."""
    for i in range(len(depth)):
        for x in range(first[0, i], last[0, i] + 1):
            for y in range(first[1, i], last[1, i] + 1):
                if grid[x, y] >= depth[i]:
                    hides[i] = True
                    break
            if hides[i]:
                break
