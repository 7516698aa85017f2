"""Planar receivers: sets of coplanar triangles of large total area, found from the geometry.

The triangles need not be connected: two table tops of the same height are one plane, as one projection serves both.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from shadowbench.scenes.triangles import Geometry, in_slices
from shadowbench.scenes.vectors import Floats

LEAST_SHARE = 0.0005  # of the searched area
MOST_PLANES = 32
TOLERANCE = 1e-5  # largest distance of a plane's corners from it, as a share of the scene's diagonal

# Width of the voting cells, in normals and in shares of the diagonal: above the scatter of small triangles with rounded
# corners. Fitting separates planes that share a cell.
_CELL = 2.0**-11
_LOOSE = 10.0  # tolerances within which triangles are gathered for the first fit to a seed triangle's plane
_FAILURES = 16  # seeds of one cell that may fail, as each costs a pass over all triangles
_EQUAL = 1e-9  # shares of the area that differ by less are equal, so that rounding cannot order them
_SPARE = 2  # factor on the number of planes that are searched for, as planes are not found strictly by size
_MIXING = np.random.default_rng(0).integers(-(2**62), 2**62, 9)  # hash multipliers


@dataclass(frozen=True, eq=False)
class Plane:
    """A planar receiver.

    equation: (4,) π with a unit normal, π·(x, y, z, 1) = 0 on the plane; triangles: (n,) sorted indices into the
    geometry's faces; share: of the searched area; thickness: largest distance of their corners from the plane.
    """

    equation: Floats
    triangles: NDArray[np.int64]
    share: float
    thickness: float


def find_planes(
    geometry: Geometry,
    least: float = LEAST_SHARE,
    most: int = MOST_PLANES,
    tolerance: float = TOLERANCE,
) -> tuple[Plane, ...]:
    """The planes with at least a share of `least` of the receivers' area, largest first, at most `most`.

    A triangle of either orientation is on a plane if its corners are within `tolerance` diagonals of the scene of it.
    """
    searched = geometry.receives
    faces = geometry.faces[searched]
    if not len(faces):
        return ()
    low, high = geometry.bounds
    center, diagonal = (low + high) / 2, float(np.linalg.norm(high - low))
    points = (geometry.vertices - center) / diagonal
    normals = geometry.normals[searched]
    areas = np.linalg.norm(geometry.crosses, axis=0)[searched]
    areas /= areas.sum()
    offsets = -np.einsum("ij,ij->i", normals, points.take(faces[:, 0], axis=0))
    search = _PlaneSearch(points, faces, areas, tolerance)
    random = np.random.default_rng(0)

    planes: list[Plane] = []
    for cell in _cells(search, normals, offsets, least):
        failures = 0
        while failures < _FAILURES and len(planes) < _SPARE * most:
            cell = cell[search.free[cell]]
            total = np.cumsum(areas[cell])
            large = sorted((plane.share for plane in planes), reverse=True)[most - 1 : most]
            if not len(cell) or total[-1] < max([least / 2, *large]) - _EQUAL:
                break
            # The largest triangle has the most exact normal. If it fails, the next seed is drawn in proportion to area.
            drawn = np.searchsorted(total, random.random() * total[-1]) if failures else 0
            first = cell[min(drawn, len(cell) - 1)]
            equation, distances = search.refined(np.append(normals[first], offsets[first]))
            own = distances <= tolerance
            share = float(areas[own].sum())
            if share == 0.0 or share < least:
                failures += 1
                own[first] = True
                cell = cell[~own[cell]]
                continue
            search.free &= ~own
            in_scene = np.append(equation[:3], equation[3] * diagonal - equation[:3] @ center)
            planes.append(Plane(in_scene, np.flatnonzero(searched)[own], share, float(distances[own].max()) * diagonal))
    return tuple(sorted(planes, key=lambda plane: (-round(plane.share / _EQUAL), plane.triangles[0]))[:most])


class _PlaneSearch:
    """The searched triangles; `free`: (F,) bool, those that are not yet part of a plane."""

    def __init__(self, points: Floats, faces: NDArray[np.int32], areas: Floats, tolerance: float) -> None:
        self.points, self.faces, self.areas, self.tolerance = points, faces, areas, tolerance
        self.free = np.ones(len(faces), dtype=bool)

    def refined(self, guess: Floats) -> tuple[Floats, Floats]:
        """The plane fitted iteratively from a guess, and the (F,) distances of the triangles, inf if not free.

        A step that shrinks the area on the plane is rejected, so that nearby small triangles cannot lose the plane.
        """
        plane = guess, self.distances(guess)
        for within in (_LOOSE * self.tolerance, self.tolerance):
            while (chosen := plane[1] <= within).any():
                equation = _least_squares_plane(self.points[self.faces[chosen]], self.areas[chosen])
                fitted = equation, self.distances(equation)
                on, before = (float(self.areas[distances <= self.tolerance].sum()) for _, distances in (fitted, plane))
                plane = fitted if on >= before else plane
                if on <= before:
                    break
        return plane

    def distances(self, equation: Floats) -> Floats:
        """(F,) distance of each triangle's farthest corner from the plane; inf for triangles that are not free."""
        off = np.abs(self.points @ equation[:3] + equation[3])
        furthest: Floats = np.maximum.reduce([off.take(corner) for corner in self.faces.T])
        furthest[~self.free] = np.inf
        return furthest


def _cells(search: _PlaneSearch, normals: Floats, offsets: Floats, least: float) -> Iterator[NDArray[np.int64]]:
    """Groups of triangles with similar planes: layers of cells, then whole cells; each largest first.

    A cell is a bin of normals and offsets, a layer a bin of heights within a cell: a stack of sheets has much area in a
    cell but little in a plane, and planes may scatter over layers. A group needs only half of `least`, as a plane may
    straddle the border of two cells.
    """
    # n nᵀ and the plane's point nearest to the centre are equal for n and −n, and continuous.
    cell = np.zeros(len(normals), dtype=np.int64)
    for part in in_slices(len(normals)):
        n = np.ascontiguousarray(normals[part].T)
        for column, factor in zip((*n**2, *(n * np.roll(n, 1, axis=0)), *(n * offsets[part])), _MIXING, strict=True):
            # The offset keeps cell borders off round numbers, where rounding would scatter modelled planes.
            cell[part] += np.floor(column / _CELL + 0.37).astype(np.int64) * factor
    # Most cells of curved surfaces have too little area, and so do their layers: removed before sorting, by the upper
    # hash bits, in which cells may collide.
    bits = (cell >> 48) + (1 << 15)
    enough = np.flatnonzero(np.bincount(bits, search.areas)[bits] >= least / 2)
    normals, middles, areas = normals[enough], search.points[search.faces[enough]].mean(axis=1), search.areas[enough]
    named, cell = np.unique(cell[enough], return_inverse=True)
    # Heights of a cell are along the normal of its largest triangle, as normals of small triangles scatter.
    order = np.lexsort([-areas, cell])
    largest = order[np.flatnonzero(np.diff(cell[order], prepend=-1))]
    heights = np.einsum("ij,ij->i", middles, normals[largest][cell])
    layers = np.column_stack([named[cell], np.floor(heights / (_LOOSE * search.tolerance) + 0.37).astype(np.int64)])
    _, within = np.unique(layers @ _MIXING[:2], return_inverse=True)
    for group in (within, cell):
        totals = np.bincount(group, areas)
        order = np.lexsort([-areas, group])
        ends = np.cumsum(np.bincount(group))
        for index in np.argsort(-np.round(totals / _EQUAL), kind="stable"):
            if totals[index] < least / 2:
                break
            yield enough[order[ends[index - 1] if index else 0 : ends[index]]]


def _least_squares_plane(corners: Floats, areas: Floats) -> Floats:
    """(4,) least-squares plane of the (N, 3, 3) corners of triangles, weighted by (N,) areas."""
    middles = corners.mean(axis=1)
    middle = np.average(middles, axis=0, weights=areas) if areas.sum() > 0 else middles.mean(axis=0)
    away = ((corners - middle) * np.sqrt(areas)[:, None, None]).reshape(-1, 3)
    normal = np.linalg.eigh(away.T @ away)[1][:, 0]
    return np.append(normal, -normal @ middle)
