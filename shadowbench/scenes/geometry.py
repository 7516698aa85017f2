"""The triangles of a scene as arrays, with their normals and bounds."""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Geometry:
    """All triangles of a scene in one indexed list, meshes in file order; an index identifies a triangle.

    vertices: (V, 3) float64; faces: (F, 3) int32; casts, receives, planar: (F,) bool; colors: (F, 3) float64, linear.
    """

    vertices: Floats
    faces: NDArray[np.int32]
    casts: NDArray[np.bool_]
    receives: NDArray[np.bool_]
    planar: NDArray[np.bool_]
    colors: Floats

    @cached_property
    def crosses(self) -> Floats:
        """(3, F) float64 normals of length twice the area, towards the side seen counter-clockwise."""
        crosses = np.empty((3, len(self.faces)))
        for part in in_slices(len(self.faces)):
            a, b, c = (np.ascontiguousarray(self.vertices.take(self.faces[part, k], axis=0).T) for k in range(3))
            b -= a
            c -= a
            for k in range(3):  # faster than np.cross
                i, j = (k + 1) % 3, (k + 2) % 3
                crosses[k, part] = b[i] * c[j] - b[j] * c[i]
        return crosses

    @cached_property
    def normals(self) -> Floats:
        """(F, 3) float64 unit normals, towards the side seen counter-clockwise; 0 for areas that round to 0."""
        normals = np.empty((len(self.faces), 3))
        for part in in_slices(len(self.faces)):
            lengths = np.linalg.norm(self.crosses[:, part], axis=0)
            lengths[lengths == 0] = 1.0
            normals[part] = (self.crosses[:, part] / lengths).T
        return normals

    @cached_property
    def bounds(self) -> Floats:
        """(2, 3) lowest and highest corner of all triangles."""
        return bounds_of(used_by(self.faces, self.vertices))

    @cached_property
    def caster_faces(self) -> NDArray[np.int32]:
        """(C, 3) int32 faces of the casters."""
        return self.faces if bool(self.casts.all()) else self.faces[self.casts]


def in_slices(count: int, size: int = 1 << 15) -> Iterator[slice]:
    """Slices of `size` elements that cover `count`, small enough for temporary arrays to stay in the cache."""
    for start in range(0, count, size):
        yield slice(start, min(start + size, count))


def used_by(faces: NDArray[np.int32], vertices: Floats) -> Floats:
    """(N, 3) the vertices referenced by faces, each once, in the order of `vertices`."""
    used = np.zeros(len(vertices), dtype=bool)  # far faster than np.unique
    used[faces] = True
    return vertices[used]


def bounds_of(points: Floats) -> Floats:
    """(2, 3) lowest and highest corner of (N, 3) points."""
    axes = [points[:, axis] for axis in range(3)]  # eight times as fast as min and max with axis=0
    return np.array([[axis.min() for axis in axes], [axis.max() for axis in axes]])
