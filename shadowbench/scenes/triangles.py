"""Triangle lists made fit for tracing: welded, without zero-area triangles, finite, placed in the world."""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from shadowbench.errors import InputError
from shadowbench.scenes.model import Floats

Faces = NDArray[np.int32]

LARGEST = 1e18
"""Coordinates beyond this are refused: their squares would leave float32, which `coordinates="absolute"` keeps."""

FLATTEST = 1e-10
"""A triangle whose height is below this share of its longest edge has no area that float64 could tell from zero."""

MOST_TRIANGLES = 10_000_000
"""Of a scene, each copy counted: half a minute to load, and within 4 GiB."""


class Triangles(NamedTuple):
    """vertices: (V, 3) float64; faces: (F, 3) int32 into them, counter-clockwise seen from outside."""

    vertices: Floats
    faces: Faces


def welded(vertices: Floats, faces: NDArray[np.integer]) -> Triangles:
    """The same triangles with one vertex per distinct position: what is not shared cracks in the ray tracer."""
    used, faces = np.unique(faces, return_inverse=True)
    rows = np.ascontiguousarray(vertices[used] + 0.0)  # + 0.0 makes −0 equal to 0 byte by byte
    _, first, inverse = np.unique(rows.view("V24").ravel(), return_index=True, return_inverse=True)
    return Triangles(rows[first], inverse[faces].reshape(-1, 3).astype(np.int32))


def check_indices(indices: NDArray[Any], count: int, where: str) -> NDArray[np.int64]:
    """The indices as int64; InputError if one of them is not that of one of `count` vertices."""
    wrong = ~((indices >= 0) & (indices < count) & (indices == np.floor(indices)))
    if wrong.any():
        found = indices[wrong][0]
        raise InputError(f"{where}: a triangle uses vertex {found:g}; the mesh has {count}, counted from 0")
    return indices.astype(np.int64)


def transformed(triangles: Triangles, matrix: Floats) -> Triangles:
    """The triangles under an affine (4, 4) matrix; a mirroring one turns the winding so that outside stays outside."""
    with np.errstate(over="ignore", invalid="ignore"):  # `checked` reports what overflows
        vertices = triangles.vertices @ matrix[:3, :3].T + matrix[:3, 3]
    mirrored = np.linalg.det(matrix[:3, :3]) < 0.0
    return Triangles(vertices, triangles.faces[:, ::-1] if mirrored else triangles.faces)


def without_zero_area(triangles: Triangles) -> tuple[Triangles, int]:
    """The triangles that have an area, and how many had none."""
    a, b, c = (triangles.vertices[triangles.faces[:, k]] for k in range(3))
    edges = np.stack([b - a, c - b, a - c])
    longest = np.linalg.norm(edges, axis=2).max(axis=0)
    # Against the longest edge, so that neither tiny nor huge triangles leave the range of float64 when squared.
    scale = np.where(longest > 0.0, longest, 1.0)[:, None]
    doubled = np.linalg.norm(np.cross(edges[0] / scale, edges[2] / scale), axis=1)
    kept = doubled > FLATTEST
    dropped = int(len(kept) - kept.sum())
    return (Triangles(triangles.vertices, triangles.faces[kept]) if dropped else triangles), dropped


def checked(triangles: Triangles, where: str) -> Triangles:
    """The triangles, or an InputError that begins with `where` if a coordinate is NaN, infinite or absurd."""
    if not np.isfinite(triangles.vertices).all():
        raise InputError(f"{where}: a vertex is NaN or infinite; coordinates must be finite")
    largest = float(np.abs(triangles.vertices).max(initial=0.0))
    if largest > LARGEST:
        raise InputError(f"{where}: a coordinate is {largest:.3g}; allowed are at most {LARGEST:.0e} either way")
    return triangles
