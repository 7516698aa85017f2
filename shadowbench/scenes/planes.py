"""Planar receivers: coplanar triangles that are large together, found by geometry alone.

Connected or not: two tables of one height are one plane, since what is flattened on one of them is flattened on both.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from shadowbench.scenes.model import Floats, Geometry

# Votes are counted in cells this wide, in normals and in shares of the diagonal: far above rounding, which turns
# small triangles of float32 meshes by 1e-5, and below the distance of planes that anyone would model.
_CELL = 2.0**-13
_LOOSE = 10.0  # tolerances within which a first guess, the plane of one triangle, gathers what is fitted
_MIXING = np.random.default_rng(0).integers(-(2**62), 2**62, 9)


@dataclass(frozen=True, eq=False)
class Plane:
    """A planar receiver.

    equation: (4,) float64 π with a unit normal, π·(x, y, z, 1) = 0 on it, of either orientation; triangles: (n,) sorted
    indices into the geometry's faces, of either winding; share: their part of the area that was searched.
    """

    equation: Floats
    triangles: NDArray[np.int64]
    share: float


def find_planes(
    geometry: Geometry, searched: NDArray[np.bool_], least: float, most: int, tolerance: float
) -> tuple[Plane, ...]:
    """The planes on which at least a share of `least` of the searched area lies, largest first, `most` at most.

    searched: (F,) bool, the faces in question. A triangle lies on a plane when its corners are within `tolerance` times
    the scene's diagonal of it, whichever way it faces: the unit does not depend on where the scene is or how large.
    """
    faces = geometry.faces[searched]
    if not len(faces):
        return ()
    low, high = geometry.bounds
    center, diagonal = (low + high) / 2, float(np.linalg.norm(high - low))
    points = (geometry.vertices - center) / diagonal
    corner, second, third = (points[faces[:, k]] for k in range(3))
    normals = geometry.normals[searched]
    areas = np.linalg.norm(np.cross(second - corner, third - corner), axis=1)
    areas /= areas.sum()
    origin_to_plane = np.einsum("ij,ij->i", normals, corner)
    free = np.ones(len(faces), dtype=bool)

    def on(equation: Floats, within: float) -> NDArray[np.bool_]:
        near: NDArray[np.bool_] = np.abs(points @ equation[:3] + equation[3]) <= within
        return near[faces].all(axis=1) & free

    found: list[Plane] = []
    for cell in _cells(normals, origin_to_plane, areas, least):
        while len(found) < most and areas[cell := cell[free[cell]]].sum() >= least / 2 and len(cell):
            guess = np.append(normals[cell[0]], -origin_to_plane[cell[0]])
            around = np.append(faces[on(guess, _LOOSE * tolerance)], faces[cell[0]])
            equation = _fitted(points[np.unique(around)])
            own = on(equation, tolerance)
            share = float(areas[own].sum())
            if share == 0.0 or share < least:
                break
            free &= ~own
            filed = np.append(equation[:3], equation[3] * diagonal - equation[:3] @ center)
            found.append(Plane(filed, np.flatnonzero(searched)[own], share))
        if len(found) == most:
            break
    return tuple(sorted(found, key=lambda plane: -plane.share))


def _cells(normals: Floats, offsets: Floats, areas: Floats, least: float) -> Iterator[NDArray[np.int64]]:
    """The triangles of each cell of alike planes, largest first; cells by the area in them, largest first.

    A plane that falls across the border of two cells still counts: half of `least` is enough to be looked at.
    """
    # n nᵀ and the plane's point nearest to the centre are the same for n and −n, and have no seam between them.
    squares = normals * np.roll(normals, 1, axis=1)
    parts = np.hstack([normals**2, squares, normals * offsets[:, None]])
    # Off the round numbers that modelled planes have, on which rounding would decide.
    cells = np.floor(parts / _CELL + 0.37).astype(np.int64)
    _, cell = np.unique(cells @ _MIXING, return_inverse=True)
    totals = np.bincount(cell, areas)
    order = np.lexsort([-areas, cell])
    ends = np.cumsum(np.bincount(cell))
    for index in np.argsort(-totals, kind="stable"):
        if totals[index] < least / 2:
            return
        yield order[ends[index - 1] if index else 0 : ends[index]]


def _fitted(points: Floats) -> Floats:
    """(4,) the plane of least squared distance from (N, 3) points."""
    middle = points.mean(axis=0)
    normal = np.linalg.svd(points - middle, full_matrices=False)[2][2]
    return np.append(normal, -normal @ middle)
