"""Operations on triangle lists: welding, validation, transforms, and removal of zero-area triangles."""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from shadowbench.errors import InputError
from shadowbench.scenes.vectors import Floats

Faces = NDArray[np.int32]

LARGEST = 1e18
"""Largest allowed coordinate: squares of larger ones overflow float32, which `coordinates="absolute"` uses."""

FLATTEST = 1e-10
"""Height of a triangle, as a share of its longest edge, below which float64 cannot distinguish its area from zero."""

MOST_TRIANGLES = 10_000_000
"""Limit on the triangles of a scene, each copy counted: half a minute to load, and within 4 GiB."""


class Triangles(NamedTuple):
    """vertices: (V, 3) float64; faces: (F, 3) int32 indices into them, counter-clockwise seen from outside."""

    vertices: Floats
    faces: Faces


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


def transformed(triangles: Triangles, matrix: Floats) -> Triangles:
    """The triangles under an affine (4, 4) matrix; a mirroring one reverses the winding, which stays outwards."""
    with np.errstate(over="ignore", invalid="ignore"):  # `checked` reports what overflows
        vertices = triangles.vertices @ matrix[:3, :3].T + matrix[:3, 3]
    mirrored = np.linalg.det(matrix[:3, :3]) < 0.0
    return Triangles(vertices, triangles.faces[:, ::-1] if mirrored else triangles.faces)


def without_zero_area(triangles: Triangles) -> tuple[Triangles, int]:
    """The triangles without those of zero area, and the number removed."""
    a, b, c = (triangles.vertices[triangles.faces[:, k]] for k in range(3))
    edges = np.stack([b - a, c - b, a - c])
    longest = np.linalg.norm(edges, axis=2).max(axis=0)
    # Relative to the longest edge, as squares of tiny or huge edges would underflow or overflow.
    scale = np.where(longest > 0.0, longest, 1.0)[:, None]
    doubled = np.linalg.norm(np.cross(edges[0] / scale, edges[2] / scale), axis=1)
    kept = doubled > FLATTEST
    dropped = int(len(kept) - kept.sum())
    return (Triangles(triangles.vertices, triangles.faces[kept]) if dropped else triangles), dropped


def checked(triangles: Triangles, where: str) -> Triangles:
    """The same triangles. Raises InputError that begins with `where` if a coordinate is not finite or above LARGEST."""
    if not np.isfinite(triangles.vertices).all():
        raise InputError(f"{where}: a vertex is NaN or infinite; coordinates must be finite")
    largest = float(np.abs(triangles.vertices).max(initial=0.0))
    if largest > LARGEST:
        raise InputError(f"{where}: a coordinate is {largest:.3g}; allowed are at most {LARGEST:.0e} either way")
    return triangles
