"""Triangles of strips and fans, as OpenGL and glTF order their corners."""

from typing import Any

import numpy as np
from numpy.typing import NDArray


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
