"""What casts: whether it is closed, and how many edges of it are outlines for the light."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import connected_components

from shadowbench.scenes.model import Floats, View, in_slices


@dataclass(frozen=True)
class Casters:
    """The triangles that cast. Exact: all of them are looked at.

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
    """The casters of a view. Vertices at one place are one, as scene files are loaded."""
    geometry = view.scene.geometry
    faces, count = geometry.caster_faces, len(geometry.vertices)
    if not len(faces):
        return Casters(0, 0, 0, 0, 0)
    crosses = geometry.crosses if faces is geometry.faces else geometry.crosses[:, geometry.casts]
    source, w = (np.array(part)[..., None] for part in view.light.homogeneous)
    volume, numbers = np.empty(len(faces)), np.empty((3, len(faces)), dtype=np.int64)
    for part in in_slices(len(faces)):
        cross, start = crosses[:, part], np.ascontiguousarray(faces[part].T)
        a = geometry.vertices.take(start[0], axis=0).T
        volume[part] = (a * cross).sum(axis=0)
        lit = ((source - w * a) * cross).sum(axis=0) > 0
        # A side is one number: its edge, the way it runs along that, whether the light sees its triangle. Numbers sort
        # faster than their places do.
        end = np.roll(start, -1, axis=0)
        edge = np.minimum(start, end).astype(np.int64) * count + np.maximum(start, end)
        numbers[:, part] = edge << 2 | (start < end) << 1 | lit
    sides = numbers.ravel()
    sides.sort()
    bits = sides.astype(np.int8)  # the lowest
    way, side = (bits & 2) - 1, 2 * (bits & 1) - 1
    sides >>= 2
    first = np.append(0, np.flatnonzero(sides[1:] != sides[:-1]) + 1)
    # Each triangle adds its walls in the sense that the light sees it; where they cancel there is none.
    walls = np.add.reduceat(way * side, first, dtype=np.int32)
    balance = np.add.reduceat(way, first, dtype=np.int32)
    loose = sides[first[balance != 0]] // count
    closed, is_open = _parted(faces, volume, loose, count)
    return Casters(
        triangles=len(faces),
        closed=int(np.count_nonzero(closed)),
        open=int(np.count_nonzero(is_open)),
        silhouette=int(np.count_nonzero(walls)),
        edges=len(first),
    )


def _parted(
    faces: NDArray[np.int32], volume: Floats, loose: NDArray[np.int64], vertices: int
) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """(F,) whether each triangle is of a part without a loose edge, that is wound outwards; whether of one with any.

    volume: (F,) of each triangle with the origin, of which a part's own is the sum, times six.
    """
    links = np.concatenate([faces[:, :2], faces[:, 1:]])
    ones = np.ones(len(links), dtype=np.int8)
    graph = csr_matrix((ones, (links[:, 0], links[:, 1])), shape=(vertices, vertices))
    parts, part = connected_components(graph, directed=False)
    is_open = np.zeros(parts, dtype=bool)
    is_open[part[loose]] = True
    of = part[faces[:, 0]]
    outwards = np.bincount(of, volume, minlength=parts) > 0
    return (outwards & ~is_open)[of], is_open[of]
