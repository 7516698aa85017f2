"""Triangles of strips and fans, as OpenGL and glTF order their corners."""

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
        for k in np.flatnonzero(~fans.valid):
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
    if 0 < len(faces) < len(ring) - 2:
        faces = _with_collinear_corners(faces, flat)
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


def _with_collinear_corners(faces: Integers, flat: Floats) -> Integers:
    """(T, 3) triangles of (N, 2) corners, with the collinear corners that earcut drops: each splits the edge it is on.

    Neighbouring polygons share these corners; without them there would be T-junctions, and cracks by rounding. One on
    no edge is the tip of a spike, which is empty in a planar polygon, else a vertical triangle.
    """
    corners = np.arange(len(flat))
    dropped = ~np.isin(corners, faces)
    for corner in corners[np.argsort(~dropped, kind="stable")]:  # dropped ones first
        if len(faces) == len(flat) - 2:
            break
        edge, offset = flat[np.roll(faces, -1, axis=1)] - flat[faces], flat[corner] - flat[faces]
        square, along = (edge**2).sum(axis=-1), (edge * offset).sum(axis=-1)
        across = edge[..., 0] * offset[..., 1] - edge[..., 1] * offset[..., 0]
        on = np.argwhere((np.abs(across) <= 10 * FLATTEST * square) & (along > 0.0) & (along < square))
        if len(on):
            number, k = on[0]
            a, b, c = np.roll(faces[number], -k)
            faces = np.vstack([faces, [corner, b, c]])
            faces[number] = a, corner, c
        elif dropped[corner]:
            used = np.unique(faces)
            following = int(np.searchsorted(used, corner))
            faces = np.vstack([faces, [used[following - 1], corner, used[following % len(used)]]])
    return faces
