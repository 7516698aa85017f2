"""What casts: whether it is closed, and how many edges of it are outlines for the light."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import connected_components

from shadowbench.scenes.model import Floats, View, crosses_of


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
    a = np.ascontiguousarray(geometry.vertices.take(faces[:, 0], axis=0).T)
    normal = crosses_of(geometry.vertices, faces)
    source, w = view.light.homogeneous
    towards = np.array(source, dtype=a.dtype)[:, None] - w * a if w else np.array(source)[:, None]
    lit = np.einsum("ij,ij->j", *np.broadcast_arrays(normal, towards)) > 0

    # A side is one number: its edge, the way it runs along that, whether the light sees its triangle. Numbers sort
    # faster than their places do.
    columns = np.ascontiguousarray(faces.T)
    start, end = columns.ravel(), np.roll(columns, -1, axis=0).ravel()  # side k of all triangles, then side k + 1
    sides = np.minimum(start, end).astype(np.int64)
    sides *= count
    sides += np.maximum(start, end)
    sides <<= 2
    sides |= (start < end).view(np.int8) << 1
    sides |= np.tile(lit.view(np.int8), 3)
    sides.sort()
    way, side = (sides >> 1 & 1).astype(np.int8) * 2 - 1, (sides & 1).astype(np.int8) * 2 - 1
    sides >>= 2
    first = np.flatnonzero(np.diff(sides, prepend=-1))
    # Each triangle adds its walls in the sense that the light sees it; where they cancel there is none.
    walls = np.add.reduceat(way * side, first, dtype=np.int32)
    balance = np.add.reduceat(way, first, dtype=np.int32)
    loose = sides[first[balance != 0]] // count
    closed, is_open = _parted(faces, np.einsum("ij,ij->j", a, normal), loose, count)
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
