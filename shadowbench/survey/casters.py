"""What casts: whether it is closed, and how many edges of it are outlines for the light."""

from dataclasses import dataclass

import numpy as np

from shadowbench.geometry.topology import topology_of
from shadowbench.scenes.model import View


@dataclass(frozen=True)
class Casters:
    """The triangles that cast. Exact: all of them are looked at, welded as volumes weld them.

    closed: how many of them are in closed parts wound outwards, a part being what hangs together; open: in parts with a
    loose edge; all others are in closed parts that are not wound outwards. silhouette: edges that bound what the light
    sees, from which volumes are extruded; edges: how many there are in all.
    """

    triangles: int
    closed: int
    open: int
    silhouette: int
    edges: int


def casters_of(view: View) -> Casters:
    """The casters of a view in local coordinates."""
    topology, vertices = topology_of(view.scene), view.scene.geometry.vertices
    faces, closed = topology.faces, topology.closed[topology.part]
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    source, w = view.light.homogeneous
    lit = np.einsum("ij,ij->i", np.array(source) - w * a, np.cross(b - a, c - a)) > 0
    # Each triangle adds its walls in the sense that the light sees it; where they cancel there is none.
    start, end = faces.ravel(), np.roll(faces, -1, axis=1).ravel()
    wall = np.append(np.where((start < end) == np.repeat(lit, 3), 1, -1), 0)  # 0 at −1, for no side
    edges = topology.edges[:, 1:3]
    first = np.flatnonzero((np.diff(edges, axis=0, prepend=-1) != 0).any(axis=1))
    walls = np.add.reduceat(wall[topology.half_edges].sum(axis=1), first) if len(first) else first
    return Casters(
        triangles=len(faces),
        closed=int(np.count_nonzero(closed)),
        open=int(np.count_nonzero(topology.open[topology.part])),
        silhouette=int(np.count_nonzero(walls)),
        edges=len(first),
    )
