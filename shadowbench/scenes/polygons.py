"""Triangles of strips and fans, as OpenGL and glTF order their corners."""

from collections import Counter, defaultdict
from collections.abc import Mapping
from itertools import pairwise
from typing import Any, NamedTuple, TypeVar

import mapbox_earcut
import numpy as np
from numpy.typing import NDArray

from shadowbench.errors import InputError
from shadowbench.scenes.file_contents import Look
from shadowbench.scenes.triangles import FLATTEST, MOST_TRIANGLES, Singles, in_slices
from shadowbench.scenes.vectors import Floats


def strip_faces(indices: NDArray[np.integer[Any]], restart: int) -> NDArray[np.int64]:
    """(F, 3) triangles of strips of (N,) indices, of which `restart` ends one and begins the next.

    Every other triangle of a strip turns the other way. Those with two equal indices, which join strips, are left out.
    """
    corners, number = _triples(indices, restart)
    faces = corners[number[:, None] + np.array([0, 1, 2])]
    odd = (number - _first_of_run(corners, restart)[number]) % 2 == 1
    faces[odd] = faces[odd][:, [0, 2, 1]]
    joins = (faces == np.roll(faces, 1, axis=1)).any(axis=1)
    return np.delete(faces, np.flatnonzero(joins), axis=0)


def fan_faces(indices: NDArray[np.integer[Any]], restart: int) -> NDArray[np.int64]:
    """(F, 3) triangles of fans of (N,) indices about their first corner, `restart` as in strips."""
    corners, number = _triples(indices, restart)
    first = _first_of_run(corners, restart)[number]
    return np.stack([corners[number + 1], corners[number + 2], corners[first]], axis=1)


def _triples(indices: NDArray[np.integer[Any]], restart: int) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """The indices as int64, and each k for which k, k + 1 and k + 2 lie in one strip."""
    corners = indices.astype(np.int64)
    inside = corners != restart
    return corners, np.flatnonzero(inside[:-2] & inside[1:-1] & inside[2:])


def _first_of_run(corners: NDArray[np.int64], restart: int) -> NDArray[np.int64]:
    """(N,) position at which the strip of each corner begins."""
    begins = np.where(corners == restart, np.arange(1, len(corners) + 1), 0)
    return np.maximum.accumulate(begins)


Integers = NDArray[np.int64]
Number = TypeVar("Number", bound=np.generic)

OTHER_DIAGONAL = np.array([[1, 2, 3], [1, 3, 0]])
"""A quad's fan from its second corner."""
FLAT_ENOUGH = 1e-3
"""Distance from its plane, as a share of its extent, below which a polygon is planar but for rounded coordinates."""


class Polygons(NamedTuple):
    """The polygons of a file with shared vertices.

    vertices: (V, 3) float64; corners: (C,) int64 vertex indices, polygon after polygon; counts: (P,) int64 number of
    corners of each polygon; owners: (P,) int64 index into `names` of each polygon's object; names: of the objects, None
    for one without a name; normals: (C, 3) float32 unit normals at the corners, zero at those without one, None if the
    file has none; coordinates: (C, 2) float32 texture coordinates of the corners, v downwards, None without; looks: of
    the objects, empty if it has no materials.
    """

    vertices: Floats
    corners: Integers
    counts: Integers
    owners: Integers
    names: tuple[str | None, ...]
    notes: list[str]
    normals: Singles | None = None
    coordinates: Singles | None = None
    looks: tuple[Look, ...] = ()


def gather(values: NDArray[Number], starts: Integers, counts: Integers) -> NDArray[Number]:
    """The concatenated ranges of `values` that begin at `starts` and have `counts` elements."""
    ends = np.cumsum(counts)
    index = np.repeat(starts - (ends - counts), counts) + np.arange(int(counts.sum()))
    return values[index]


def triangulated(polygons: Polygons, where: str) -> tuple[Integers, Integers, list[str]]:
    """(F, 3) int64 triangles as indices of corners, (F,) their polygons, and notes on malformed polygons.

    They are in the order of their polygons. Raises InputError for too many triangles.
    """
    vertices, corners, counts = polygons.vertices, polygons.corners, polygons.counts
    sizes = np.maximum(counts - 2, 0)
    total = int(sizes.sum())
    if total > MOST_TRIANGLES:
        raise InputError(f"{where}: {total} triangles; a scene may have {MOST_TRIANGLES}")
    starts, rows = np.cumsum(counts) - counts, np.cumsum(sizes) - sizes
    owner = np.repeat(np.arange(len(counts)), sizes)
    second = starts[owner] + 1 + np.arange(total) - rows[owner]
    faces = np.stack([starts[owner], second, second + 1], axis=1)
    many = np.flatnonzero(counts > 3)
    nonplanar = crossing = 0
    kept = np.ones(total, dtype=bool)
    for part in in_slices(len(many)):
        chosen = many[part]
        fans = _fans(vertices[corners[gather(faces, rows[chosen], sizes[chosen])]], sizes[chosen])
        nonplanar += int(fans.nonplanar.sum())
        valid = fans.valid
        quads = np.flatnonzero(~valid & (counts[chosen] == 4))
        others = starts[chosen[quads], None, None] + OTHER_DIAGONAL
        other_fan = quads[_fans(vertices[corners[others.reshape(-1, 3)]], sizes[chosen[quads]]).valid]
        valid[other_fan] = True
        faces[rows[chosen[other_fan], None] + np.arange(2)] = others[np.isin(quads, other_fan)]
        waiting = np.flatnonzero(~valid)
        for k in waiting:
            size, row, start = (int(of[chosen[k]]) for of in (counts, rows, starts))
            triangulation = _earcut(vertices[corners[start : start + size]], fans.normals[k])
            if triangulation is None:
                crossing += int(fans.has_area[k])
            else:
                faces[row : row + len(triangulation)] = start + triangulation
                kept[row + len(triangulation) : row + size - 2] = False
    lines = [
        (int((counts < 3).sum()), "face(s) of fewer than 3 corners left out"),
        (nonplanar, "polygon(s) not planar: cut as seen along their mean normal"),
        (crossing, "polygon(s) that cross themselves: cut as fans from their first corner"),
    ]
    return faces[kept], owner[kept], [f"{where}: {count} {line}" for count, line in lines if count]


class _Fans(NamedTuple):
    """By polygon: unit Newell normal; whether its fan is valid, whether it is non-planar, whether it has any area."""

    normals: Floats
    valid: NDArray[np.bool_]
    nonplanar: NDArray[np.bool_]
    has_area: NDArray[np.bool_]


def _fans(triangles: Floats, sizes: Integers) -> _Fans:
    """Properties of polygons' fans. triangles: (T, 3, 3) corners; sizes: (P,) number of triangles of each fan."""
    first = np.cumsum(sizes) - sizes
    left, right = triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]
    extent = np.maximum.reduceat(np.maximum(np.abs(left), np.abs(right)).max(axis=1), first)
    scale = np.repeat(np.where(extent > 0.0, extent, 1.0), sizes)[:, None]
    left, right = left / scale, right / scale
    crosses = np.cross(left, right)
    newell = np.add.reduceat(crosses, first)
    length = np.linalg.norm(newell, axis=1)
    normals = newell / np.where(length > 0.0, length, 1.0)[:, None]
    normal = np.repeat(normals, sizes, axis=0)
    doubled = np.einsum("ij,ij->i", crosses, normal)
    squares = np.stack([np.einsum("ij,ij->i", edge, edge) for edge in (left, right, right - left)])
    area = FLATTEST * squares.max(axis=0)
    # Triangles without area are removed later. That is harmless if two corners coincide; otherwise a corner is lost.
    positive = (doubled > area) | (squares.min(axis=0) == 0.0)
    total_angle = np.add.reduceat(np.arctan2(doubled, np.einsum("ij,ij->i", left, right)), first)
    heights = np.stack([np.einsum("ij,ij->i", edge, normal) for edge in (left, right)])
    lowest = np.minimum(np.minimum.reduceat(heights.min(axis=0), first), 0.0)
    highest = np.maximum(np.maximum.reduceat(heights.max(axis=0), first), 0.0)
    return _Fans(
        normals,
        valid=np.logical_and.reduceat(positive, first) & (total_angle < 2 * np.pi) & (length > FLATTEST),
        nonplanar=highest - lowest > FLAT_ENOUGH,
        has_area=np.logical_or.reduceat(np.linalg.norm(crosses, axis=1) > area, first),
    )


def _earcut(ring: Floats, normal: Floats) -> Integers | None:
    """(T, 3) earcut triangulation of a polygon's (N, 3) corners; None if its area differs from the polygon's."""
    axis = int(np.argmax(np.abs(normal)))
    axes = [(axis + 1) % 3, (axis + 2) % 3][:: 1 if normal[axis] > 0.0 else -1]
    ring = ring - ring[0]
    ring = ring / (np.abs(ring).max() or 1.0)
    # Projected along the normal onto a coordinate plane, which is exact for axis-aligned polygons.
    flat = np.ascontiguousarray(ring[:, axes] - ring[:, [axis]] * (normal[axes] / (normal[axis] or 1.0)))
    indices = mapbox_earcut.triangulate_float64(flat, np.array([len(flat)], dtype=np.uint32))
    faces: Integers = indices.reshape(-1, 3).astype(np.int64)
    edges = flat[faces] - flat[np.roll(faces, -1, axis=1)]
    faces = faces[_area(flat[faces]) > FLATTEST * np.einsum("ijk,ijk->ij", edges, edges).max(axis=1)]
    if len(faces) < len(ring) - 2:
        faces = _with_collinear_corners(faces, ring, flat)
    newell = np.cross(ring, np.roll(ring, -1, axis=0)).sum(axis=0)
    crosses = np.cross(ring[faces[:, 1]] - ring[faces[:, 0]], ring[faces[:, 2]] - ring[faces[:, 0]])
    size = float(np.linalg.norm(newell))
    missing = np.linalg.norm(crosses.sum(axis=0) - newell)
    # Nearly vertical edges of a non-planar polygon may cross slightly, and that area counts twice.
    doubled = abs(np.abs(crosses @ normal).sum() - size)
    return faces if len(faces) <= len(ring) - 2 and missing < 1e-6 * size and doubled < 1e-5 * size else None


def _area(flat: Floats) -> Floats:
    """(…,) twice the signed area of (…, N, 2) polygons."""
    following = np.roll(flat, -1, axis=-2)
    return np.asarray((flat[..., 0] * following[..., 1] - flat[..., 1] * following[..., 0]).sum(axis=-1))


def _with_collinear_corners(triangulation: Integers, corners: Floats, flat: Floats) -> Integers:
    """The triangulation with the collinear corners that earcut drops, so that its outline is the polygon again.

    corners: (N, 3); flat: (N, 2), projected. Neighbouring polygons share these corners; without them there would be
    T-junctions, and cracks by rounding.
    """
    _, first, index_of = np.unique(corners, axis=0, return_index=True, return_inverse=True)
    ring = index_of.tolist()
    triangles = [[ring[k] for k in triangle] for triangle in triangulation.tolist()]
    # The difference of the triangulation's outline and the polygon's: edges of the first and reversed edges of the
    # second, closed paths without area.
    loose: Counter[tuple[int, int]] = Counter()
    near: defaultdict[int, set[int]] = defaultdict(set)

    def walk(a: int, b: int) -> None:
        if loose[b, a] > 0:
            loose[b, a] -= 1
        elif a != b:
            loose[a, b] += 1
            near[a].add(b)
            near[b].add(a)

    owner = {(t[k - 1], t[k]): number for number, t in enumerate(triangles) for k in range(3)}
    for t in triangles:
        for k in range(3):
            walk(t[k - 1], t[k])
    for a, b in pairwise([*ring, ring[0]]):
        walk(b, a)
    waiting = [edge for edge in owner if loose[edge] > 0]
    while waiting and len(triangles) < len(ring) - 2:
        a, b = edge = waiting.pop()
        if loose[edge] <= 0 or edge not in owner:
            continue
        number = owner[edge]
        others = np.array(sorted((near[a] | near[b]).difference(triangles[number])), dtype=np.int64)
        between = others[_on_segment(flat[first[others]] - flat[first[a]], flat[first[b]] - flat[first[a]])]
        if not len(between):
            continue
        middle = int(between[0])
        (far,) = set(triangles[number]) - {a, b}
        triangles[number] = [a, middle, far]
        owner |= {(a, middle): number, (middle, b): len(triangles), (b, far): len(triangles)}
        triangles.append([middle, b, far])
        del owner[edge]
        loose[edge] -= 1
        for half in ((a, middle), (middle, b)):
            walk(*half)
            waiting.append(half)
    triangles += _degenerate_triangles(loose, near)
    return first[np.array(triangles, dtype=np.int64).reshape(-1, 3)]


def _degenerate_triangles(loose: Counter[tuple[int, int]], near: Mapping[int, set[int]]) -> list[list[int]]:
    """Fans over paths that are degenerate in the projection: empty in a planar polygon, else vertical triangles.

    loose: how often each edge is on a path, which is used up; near: neighbours of each corner on paths.
    """
    triangles = []
    for a, b in list(loose):
        path = [a]
        while len(path) > 1 or loose[a, b] > 0:
            end = path[-1]
            following = next(v for v in near[end] if loose[end, v] > 0)
            loose[end, following] -= 1
            if following in path:  # each loop separately, as two loops with a common corner may overlap
                start = path.index(following)
                triangles += [[following, path[k + 1], path[k]] for k in range(start + 1, len(path) - 1)]
                del path[start + 1 :]
            else:
                path.append(following)
    return triangles


def _on_segment(points: Floats, edge: Floats) -> NDArray[np.bool_]:
    """(N,) bool: whether (N, 2) points are on the segment from the origin to `edge`, up to rounding."""
    along, across = points @ edge, points @ np.array([-edge[1], edge[0]])
    square = edge @ edge
    return np.asarray((np.abs(across) <= 10 * FLATTEST * square) & (along > 0.0) & (along < square))
