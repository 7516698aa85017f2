"""Planar receivers: coplanar triangles that are large together, found by geometry alone.

Connected or not: two tables of one height are one plane, since what is flattened on one of them is flattened on both.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from shadowbench.scenes.geometry import Geometry, in_slices
from shadowbench.scenes.model import Floats

LEAST_SHARE = 0.0005
"""Smallest part of the searched area that makes a plane, where nothing is said."""
MOST_PLANES = 32
"""Most planes that are looked for, where nothing is said."""
TOLERANCE = 1e-5
"""Share of the scene's diagonal that a plane's corners may be off it, where nothing is said."""

# Votes are counted in cells this wide, in normals and in shares of the diagonal: above the scatter of small triangles
# whose corners were rounded. Planes that share a cell are told apart by looking.
_CELL = 2.0**-11
_LOOSE = 10.0  # tolerances within which a first guess, the plane of one triangle, gathers what it is a part of
_FAILURES = 16  # guesses of one cell that may come to nothing, since each looks at all triangles
_EQUAL = 1e-9  # shares of the area that differ by less are the same: rounding must not order them
_SPARE = 2  # times as many planes as asked for are looked at, since the next may be larger than the last
_MIXING = np.random.default_rng(0).integers(-(2**62), 2**62, 9)


@dataclass(frozen=True, eq=False)
class Plane:
    """A planar receiver.

    equation: (4,) float64 π with a unit normal, π·(x, y, z, 1) = 0 on it, of either orientation; triangles: (n,) sorted
    indices into the geometry's faces, of either winding; share: their part of the area that was searched; thickness:
    how far their furthest corner is off the plane.
    """

    equation: Floats
    triangles: NDArray[np.int64]
    share: float
    thickness: float


def find_planes(
    geometry: Geometry,
    searched: NDArray[np.bool_],
    least: float = LEAST_SHARE,
    most: int = MOST_PLANES,
    tolerance: float = TOLERANCE,
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
    normals = geometry.normals[searched]
    areas = np.linalg.norm(geometry.crosses, axis=0)[searched]
    areas /= areas.sum()
    offsets = -np.einsum("ij,ij->i", normals, points.take(faces[:, 0], axis=0))
    search = _PlaneSearch(points, faces, areas, tolerance)
    chance = np.random.default_rng(0)

    found: list[Plane] = []
    for cell in _cells(search, normals, offsets, least):
        failures = 0
        while failures < _FAILURES and len(found) < _SPARE * most:
            cell = cell[search.free[cell]]
            total = np.cumsum(areas[cell])
            large = sorted((plane.share for plane in found), reverse=True)[most - 1 : most]
            if not len(cell) or total[-1] < max([least / 2, *large]) - _EQUAL:
                break
            # The largest is the most exact; if it is alone, one by lot, where much area has many chances.
            lot = np.searchsorted(total, chance.random() * total[-1]) if failures else 0
            first = cell[min(lot, len(cell) - 1)]
            equation, distances = search.refined(np.append(normals[first], offsets[first]))
            own = distances <= tolerance
            share = float(areas[own].sum())
            if share == 0.0 or share < least:
                failures += 1
                own[first] = True
                cell = cell[~own[cell]]
                continue
            search.free &= ~own
            filed = np.append(equation[:3], equation[3] * diagonal - equation[:3] @ center)
            found.append(Plane(filed, np.flatnonzero(searched)[own], share, float(distances[own].max()) * diagonal))
    return tuple(sorted(found, key=lambda plane: (-round(plane.share / _EQUAL), plane.triangles[0]))[:most])


@dataclass(eq=False)
class _PlaneSearch:
    """Triangles to look for planes among, of which some are still free."""

    points: Floats
    faces: NDArray[np.int32]
    areas: Floats
    tolerance: float

    def __post_init__(self) -> None:
        self.free = np.ones(len(self.faces), dtype=bool)

    def refined(self, guess: Floats) -> tuple[Floats, Floats]:
        """The equation that a guess leads to, and how far (F,) triangles are off it: infinitely if not free.

        The area on it only grows, so that a little beside a plane, which moves the fit, cannot lose the plane.
        """
        plane = guess, self.distances(guess)
        for within in (_LOOSE * self.tolerance, self.tolerance):
            while (chosen := plane[1] <= within).any():
                equation = _fitted(self.points[self.faces[chosen]], self.areas[chosen])
                fitted = equation, self.distances(equation)
                grown = self.area(fitted[1]) - self.area(plane[1])
                plane = fitted if grown >= 0.0 else plane
                if grown <= 0.0:
                    break
        return plane

    def area(self, distances: Floats) -> float:
        return float(self.areas[distances <= self.tolerance].sum())

    def distances(self, equation: Floats) -> Floats:
        """(F,) of the furthest corner of each triangle that is free."""
        off = np.abs(self.points @ equation[:3] + equation[3])
        furthest = np.empty(len(self.faces))
        for part in in_slices(len(self.faces)):
            first, second, third = (off.take(self.faces[part, k]) for k in range(3))
            furthest[part] = np.maximum(np.maximum(first, second), third)
        furthest[~self.free] = np.inf
        return furthest


def _cells(search: _PlaneSearch, normals: Floats, offsets: Floats, least: float) -> Iterator[NDArray[np.int64]]:
    """Triangles of alike planes, largest first: of layers, largest area first, then once more of whole cells.

    A stack of sheets has much area in a cell and little in a plane: by layers the largest planes come first. What
    scatters over several layers is left to the cells. A plane that falls across the border of two cells still counts:
    half of `least` is enough to be looked at.
    """
    # n nᵀ and the plane's point nearest to the centre are the same for n and −n, and have no seam between them.
    cell = np.zeros(len(normals), dtype=np.int64)
    for part in in_slices(len(normals)):
        n = np.ascontiguousarray(normals[part].T)
        for column, factor in zip((*n**2, *(n * np.roll(n, 1, axis=0)), *(n * offsets[part])), _MIXING, strict=True):
            # Off the round numbers that modelled planes have, on which rounding would decide.
            cell[part] += np.floor(column / _CELL + 0.37).astype(np.int64) * factor
    # Most triangles of curved bodies share a cell with too little area, and so a layer with less: out before sorting,
    # by the upper bits alone, which some cells share.
    bits = (cell >> 48) + (1 << 15)
    enough = np.flatnonzero(np.bincount(bits, search.areas)[bits] >= least / 2)
    normals, middles, areas = normals[enough], search.points[search.faces[enough]].mean(axis=1), search.areas[enough]
    named, cell = np.unique(cell[enough], return_inverse=True)
    # Heights are along one normal a cell, its largest triangle's: those of small ones scatter.
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


def _fitted(corners: Floats, areas: Floats) -> Floats:
    """(4,) the plane of least squared distance from the (N, 3, 3) corners of triangles, weighted by (N,) areas."""
    middles = corners.mean(axis=1)
    middle = np.average(middles, axis=0, weights=areas) if areas.sum() > 0 else middles.mean(axis=0)
    away = (corners - middle) * np.sqrt(areas)[:, None, None]
    away = away.reshape(-1, 3)
    normal = np.linalg.eigh(away.T @ away)[1][:, 0]
    return np.append(normal, -normal @ middle)
