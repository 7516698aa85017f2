"""Normals of smooth surfaces, by corner of a triangle: (…, 3) float32 unit vectors, zero where there is none."""

import numpy as np
from numpy.typing import NDArray

from shadowbench.scenes.geometry import Triangles, moved
from shadowbench.scenes.vectors import Floats

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
