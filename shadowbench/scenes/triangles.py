"""Triangles as arrays: welded, validated, transformed, with normals of smooth surfaces; and all of a scene."""

import hashlib
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from shadowbench.errors import InputError
from shadowbench.options import LARGEST as LARGEST
from shadowbench.scenes.cutouts import CutoutFaces
from shadowbench.scenes.vectors import Floats

Faces = NDArray[np.int32]

FLATTEST = 1e-10
"""Height of a triangle, as a share of its longest edge, below which float64 cannot distinguish its area from zero."""

MOST_TRIANGLES = 10_000_000
"""Limit on the triangles of a scene, each copy of a mesh counted: their truth takes 4 GiB."""


class Triangles(NamedTuple):
    """vertices: (V, 3) float64; faces: (F, 3) int32 indices into them, counter-clockwise seen from outside."""

    vertices: Floats
    faces: Faces


def triangles_of(vertices: NDArray[Any], faces: NDArray[Any], where: str) -> Triangles:
    """Welded triangles of (V, 3) vertices and (F, 3) indices. Raises InputError if these are invalid."""
    check_indices(faces, len(vertices), where)
    if not len(faces):
        return Triangles(np.zeros((0, 3)), np.zeros((0, 3), dtype=np.int32))
    return welded(checked(np.asarray(vertices, dtype=np.float64), where), faces)


def welded(vertices: Floats, faces: NDArray[np.integer]) -> Triangles:
    """The triangles with one vertex per distinct position, as rays may leak through edges with unshared vertices."""
    used, faces = np.unique(faces, return_inverse=True)
    rows = np.ascontiguousarray(vertices[used] + 0.0)  # + 0.0 turns −0 into 0, as bytes are compared
    _, first, inverse = np.unique(rows.view("V24").ravel(), return_index=True, return_inverse=True)
    return Triangles(rows[first], inverse[faces].reshape(-1, 3).astype(np.int32))


def check_indices(indices: NDArray[Any], count: int, where: str) -> NDArray[np.int64]:
    """The indices as int64. Raises InputError for one that is not an integer from 0 to count − 1."""
    wrong = ~((indices >= 0) & (indices < count) & (indices == np.floor(indices)))
    if wrong.any():
        found = indices[wrong][0]
        raise InputError(f"{where}: a triangle uses vertex {found:g}; the mesh has {count}, counted from 0")
    return indices.astype(np.int64)


def without_zero_area(triangles: Triangles) -> tuple[Triangles, int]:
    """The triangles without those of zero area, and the number removed."""
    kept = with_area(triangles)
    return Triangles(triangles.vertices, triangles.faces[kept]), int(len(kept) - kept.sum())


def transformed(triangles: Triangles, matrix: Floats) -> Triangles:
    """The triangles under an affine (4, 4) matrix; a mirroring one reverses the winding, which stays outwards."""
    faces = np.ascontiguousarray(triangles.faces[:, ::-1]) if mirrors(matrix) else triangles.faces
    return Triangles(moved(triangles.vertices, matrix), faces)


def moved(points: Floats, matrix: Floats) -> Floats:
    """(…, 3) points under affine matrices, (4, 4) or one for each, (…, 4, 4); to the same bits on every machine."""
    x, y, z = (points[..., axis] for axis in range(3))
    result = np.empty(points.shape)
    with np.errstate(over="ignore", invalid="ignore"):  # `checked` reports what overflows
        for k in range(3):
            a, b, c, d = (matrix[..., k, axis] for axis in range(4))
            result[..., k] = x * a + y * b + z * c + d
    return result


def mirrors(matrix: Floats) -> bool:
    """Whether an affine (4, 4) matrix mirrors."""
    return bool(np.linalg.det(matrix[:3, :3]) < 0.0)


def with_area(triangles: Triangles) -> NDArray[np.bool_]:
    """(F,) bool, False for triangles of zero area."""
    vertices, faces = triangles.vertices, triangles.faces
    kept = [heights(Triangles(vertices, faces[part]))[0] > FLATTEST for part in in_slices(len(faces))]
    return np.concatenate(kept) if kept else np.zeros(0, dtype=bool)


def heights(triangles: Triangles) -> tuple[Floats, Floats]:
    """(F,) heights of triangles over their longest edges, as shares of these; and these."""
    a, b, c = (triangles.vertices[triangles.faces[:, k]] for k in range(3))
    edges = np.stack([b - a, c - b, a - c])
    longest = np.linalg.norm(edges, axis=2).max(axis=0)
    # Relative to the longest edge, as squares of tiny or huge edges would underflow or overflow.
    scale = np.where(longest > 0.0, longest, 1.0)[:, None]
    return np.linalg.norm(np.cross(edges[0] / scale, edges[2] / scale), axis=1), longest


def checked(vertices: Floats, where: str) -> Floats:
    """The same vertices. Raises InputError that begins with `where` if one is not finite or above LARGEST."""
    if not np.isfinite(vertices).all():
        raise InputError(f"{where}: a vertex is NaN or infinite; coordinates must be finite")
    largest = float(np.abs(vertices).max(initial=0.0))
    if largest > LARGEST:
        raise InputError(f"{where}: a coordinate is {largest:.3g}; allowed are at most {LARGEST:.0e} either way")
    return vertices


@dataclass(frozen=True, eq=False)
class Geometry:
    """All triangles of a scene in one indexed list, meshes in file order; an index identifies a triangle.

    vertices: (V, 3) float64; faces: (F, 3) int32; casts, receives: (F,) bool; colors: (F, 3) float64, linear;
    cutouts: the cut-out triangles, None without any; corner_normals: (F, 3, 3) float32 of smooth surfaces, zero at
    corners without one, None if there is none at all.
    """

    vertices: Floats
    faces: Faces
    casts: NDArray[np.bool_]
    receives: NDArray[np.bool_]
    colors: Floats
    cutouts: CutoutFaces | None = None
    corner_normals: NDArray[np.float32] | None = None

    @property
    def count(self) -> int:
        """Number of triangles."""
        return len(self.faces)

    @property
    def smooth(self) -> bool:
        """Whether any surface is."""
        return self.corner_normals is not None

    def corners(self, triangles: NDArray[np.intp] | NDArray[np.int32]) -> Floats:
        """(N, 3, 3) corners of (N,) triangles."""
        return self.vertices[self.faces[triangles]]

    def weights(self, triangles: NDArray[np.int32], points: Floats) -> Floats:
        """(N, 3) barycentric weights of points (N, 3) on the planes of (N,) triangles."""
        first, *others = np.moveaxis(self.corners(triangles), 1, 0)
        along, across, away = (place - first for place in (*others, points))
        normal = np.cross(along, across)
        area = np.einsum("ni,ni->n", normal, normal)
        second, third = np.einsum("kni,ni->kn", np.cross([away, along], [across, away]), normal) / area
        return np.stack([1 - second - third, second, third], axis=1)

    def select(self, triangles: NDArray[np.intp]) -> "Geometry":
        """Only these triangles, given in ascending order, opaque; each with vertices of its own."""
        faces = np.arange(3 * len(triangles), dtype=np.int32).reshape(-1, 3)
        flags = self.casts[triangles], self.receives[triangles]
        normals = None if self.corner_normals is None else self.corner_normals[triangles]
        corners = self.corners(triangles).reshape(-1, 3)
        return Geometry(corners, faces, *flags, self.colors[triangles], corner_normals=normals)

    @cached_property
    def crosses(self) -> Floats:
        """(3, F) float64 normals of length twice the area, towards the side seen counter-clockwise."""
        crosses = np.empty((3, len(self.faces)))
        for part in in_slices(len(self.faces)):
            crosses[:, part] = _crosses(*(self.vertices.take(self.faces[part, k], axis=0).T for k in range(3)))
        return crosses

    @cached_property
    def normals(self) -> Floats:
        """(F, 3) float64 unit normals, towards the side seen counter-clockwise; 0 for areas that round to 0."""
        return _units(self.crosses)

    @cached_property
    def shading_normals(self) -> NDArray[np.float32]:
        """(F, 3, 3) float32 normals at the corners, those of the triangles where there are no others."""
        flat: NDArray[np.float32] = np.repeat(self.normals[:, np.newaxis].astype(np.float32), 3, axis=1)
        own = self.corner_normals
        return flat if own is None else np.where(own.any(axis=2, keepdims=True), own, flat)

    @cached_property
    def bounds(self) -> Floats:
        """(2, 3) lowest and highest corner of all triangles."""
        return bounds_of(used_by(self.faces, self.vertices))

    @property
    def caster_bounds(self) -> Floats:
        """(2, 3) lowest and highest corner of all casters, of which there is at least one."""
        return bounds_of(used_by(self.caster_faces, self.vertices))

    @cached_property
    def caster_faces(self) -> Faces:
        """(C, 3) int32 faces of the casters."""
        return self.faces if bool(self.casts.all()) else self.faces[self.casts]

    @cached_property
    def is_cut_out(self) -> NDArray[np.bool_]:
        """(F,) bool."""
        cut = np.zeros(len(self.faces), dtype=bool)
        if self.cutouts is not None:
            cut[self.cutouts.faces] = True
        return cut

    @cached_property
    def caster_cutouts(self) -> CutoutFaces | None:
        """The cut-out triangles among `caster_faces`; None without any."""
        return None if self.cutouts is None else self.cutouts.among(self.casts)

    def digest(self) -> str:
        """Hex digest of all properties of triangles that affect shadows; colours do not."""
        digest = hashlib.sha256()
        cut = () if self.cutouts is None else self.cutouts.arrays()
        smooth = () if self.corner_normals is None else (self.corner_normals,)
        arrays: tuple[NDArray[Any], ...] = (self.vertices, self.faces, self.casts, self.receives, *cut, *smooth)
        for array in arrays:
            digest.update(repr((array.shape, array.dtype.str)).encode())
            digest.update(np.ascontiguousarray(array).tobytes())
        return digest.hexdigest()


def facet_normals(corners: Floats) -> Floats:
    """(N, 3) float64 unit normals of triangles with (N, 3, 3) corners, as `Geometry.normals`."""
    return _units(_crosses(*(corners[:, k].T for k in range(3))))


def _crosses(a: Floats, b: Floats, c: Floats) -> Floats:
    """(3, N) normals of length twice the area of triangles with (3, N) corners."""
    a, b, c = (np.ascontiguousarray(corner) for corner in (a, b, c))
    b, c, crosses = b - a, c - a, np.empty_like(a)
    for k in range(3):  # faster than np.cross
        i, j = (k + 1) % 3, (k + 2) % 3
        crosses[k] = b[i] * c[j] - b[j] * c[i]
    return crosses


def _units(crosses: Floats) -> Floats:
    """(N, 3) of (3, N) at unit length; 0 for 0."""
    lengths = np.linalg.norm(crosses, axis=0)
    return np.ascontiguousarray((crosses / np.where(lengths == 0.0, 1.0, lengths)).T)


def in_slices(count: int, size: int = 1 << 15) -> Iterator[slice]:
    """Slices of `size` elements that cover `count`, small enough for temporary arrays to stay in the cache."""
    for start in range(0, count, size):
        yield slice(start, min(start + size, count))


def used_by(faces: Faces, vertices: Floats) -> Floats:
    """(N, 3) the vertices referenced by faces, each once, in the order of `vertices`."""
    used = np.zeros(len(vertices), dtype=bool)  # far faster than np.unique
    used[faces] = True
    return vertices[used]


def bounds_of(points: Floats) -> Floats:
    """(2, 3) lowest and highest corner of (N, 3) points."""
    axes = [points[:, axis] for axis in range(3)]  # eight times as fast as min and max with axis=0
    return np.array([[axis.min() for axis in axes], [axis.max() for axis in axes]])


Singles = NDArray[np.float32]


def unit_normals(vectors: Floats) -> Singles:
    """(…, 3) vectors at unit length; zero for those that are zero or not finite."""
    with np.errstate(all="ignore"):
        largest = np.abs(vectors).max(axis=-1, keepdims=True, initial=0.0)
        valid = np.isfinite(largest) & (largest > 0.0)
        scaled = np.where(valid, vectors / largest, 0.0)  # squares of tiny or huge ones would underflow or overflow
        lengths = np.sqrt(np.einsum("...i,...i->...", scaled, scaled))[..., np.newaxis]
    return (scaled / np.where(valid, lengths, 1.0)).astype(np.float32)


def normal_matrices(linear: Floats) -> Floats:
    """(…, 3, 3) matrices that turn normals as (…, 3, 3) ones move points: inverse transposes, but for a factor above 0.

    Matrices of cofactors, so that those of flattening ones exist too.
    """
    cofactors = np.stack(
        [np.cross(linear[..., (k + 1) % 3, :], linear[..., (k + 2) % 3, :]) for k in range(3)], axis=-2
    )
    mirrors = np.linalg.det(linear) < 0.0
    return np.asarray(np.where(mirrors[..., np.newaxis, np.newaxis], -cofactors, cofactors))


def turned(normals: Singles, matrix: Floats) -> Singles:
    """(…, 3) normals of a surface under affine matrices, (4, 4) or one for each, as of `moved`."""
    turn = np.zeros_like(matrix)
    turn[..., :3, :3] = normal_matrices(matrix[..., :3, :3])
    return unit_normals(moved(normals.astype(np.float64), turn))


def mean_normals(triangles: Triangles) -> Singles:
    """(F, 3, 3) normals at the corners of triangles: means of those around a vertex, weighted by their angles there.

    Thürmer and Wüthrich 1998, "Computing vertex normals from polygonal facets". Triangles have areas.
    """
    corners = triangles.vertices[triangles.faces]
    edges = np.roll(corners, -1, axis=1) - corners
    edges /= np.linalg.norm(edges, axis=2, keepdims=True)
    angles = np.arccos(np.clip(-np.einsum("fki,fki->fk", edges, np.roll(edges, 1, axis=1)), -1.0, 1.0))
    flat = unit_normals(np.cross(edges[:, 0], edges[:, 1])).astype(np.float64)
    weighted = (angles[:, :, np.newaxis] * flat[:, np.newaxis]).reshape(-1, 3)
    sums = [np.bincount(triangles.faces.ravel(), column, len(triangles.vertices)) for column in weighted.T]
    return unit_normals(np.stack(sums, axis=1))[triangles.faces]
