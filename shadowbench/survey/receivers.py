"""What is seen and what casts: planarity of the visible receivers, closed parts and silhouette edges of the casters."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from shadowbench.geometry.planes import find_planes
from shadowbench.geometry.topology import topology_of
from shadowbench.scenes.model import Scene, View
from shadowbench.survey.sampling import Estimate, Samples

PLANAR_SHARE = 0.999  # least planar share of the visible receivers for which projection suffices


@dataclass(frozen=True)
class Receivers:
    """The visible receivers, which face the light.

    pixels: their share of the view; shadowed: their share in shadow; planar: their share on planes that
    `planar-projection` finds; lost: share of the shadow on other receivers; planes: number of visible planes.
    """

    pixels: Estimate
    shadowed: Estimate
    planar: Estimate
    lost: Estimate
    planes: int

    @property
    def projection_suffices(self) -> bool:
        """Whether practically all visible receivers are on planes."""
        return self.planar.value >= PLANAR_SHARE


def planes_of(scene: Scene) -> NDArray[np.int64]:
    """(T,) index of each triangle's plane, of those that `planar-projection` finds by default; −1 for none."""
    geometry = scene.geometry
    of_triangle = np.full(len(geometry.faces), -1)
    for index, plane in enumerate(find_planes(geometry, geometry.receives)):
        of_triangle[plane.triangles] = index
    return of_triangle


def receivers_of(samples: Samples, of_triangle: NDArray[np.int64]) -> Receivers:
    """Statistics of the visible receivers. of_triangle: (T,) planes of the triangles, from `planes_of`."""
    plane_of = of_triangle[samples.triangle]
    planar, everything, shadow = plane_of >= 0, np.arange(len(samples.pixel)), np.flatnonzero(samples.shadowed)
    side = -(-samples.view.size // samples.step)
    share = len(everything) / side**2
    return Receivers(
        pixels=Estimate(share, 0.0 if samples.step == 1 else float(np.sqrt(share * (1 - share)) / side)),
        shadowed=samples.estimate(lambda chosen: float(samples.shadowed[chosen].mean()), everything),
        planar=samples.estimate(lambda chosen: float(planar[chosen].mean()), everything),
        lost=samples.estimate(lambda chosen: float((~planar[chosen]).mean()), shadow) if len(shadow) else Estimate(0.0),
        planes=len(np.unique(plane_of[planar])),
    )


@dataclass(frozen=True)
class Casters:
    """Exact counts over all caster triangles, welded as for shadow volumes.

    triangles: number of caster triangles; closed: those in closed parts that are wound outwards, a part being a set of
    triangles connected by edges; open: those in parts with boundary edges; all others are in closed parts not wound
    outwards. silhouette: number of silhouette edges for the light; walls: that shadow volumes extrude from them, two
    from an edge between triangles of a part that is not closed; edges: number of all edges.
    """

    triangles: int
    closed: int
    open: int
    silhouette: int
    walls: int
    edges: int


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
    )
