"""Casters: closed parts, silhouette edges, and cut-outs, as shadow volumes and maps have them."""

from dataclasses import dataclass

import numpy as np

from shadowbench.geometry.topology import topology_of
from shadowbench.scenes.geometry import Geometry
from shadowbench.scenes.model import View

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
