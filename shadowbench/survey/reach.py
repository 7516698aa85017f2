"""Casters that can darken nothing that is seen: without them in the depth pass, the picture stays the same.

Conservative: what is seen is kept in a grid across the light, in each cell the farthest of it, and a triangle matters
if a cell that its bounds touch holds something behind its nearest corner.
"""

from dataclasses import dataclass, replace

import numpy as np

from shadowbench.geometry.lights import LightSpace
from shadowbench.scenes.geometry import in_slices
from shadowbench.scenes.model import Floats
from shadowbench.survey.footprint import Footprint
from shadowbench.survey.maps import FittedMap
from shadowbench.survey.rays import Indices, Mask

CELLS = 1024  # along a side of the grid; a power of two
ROUNDING = 1e-6  # of depths and bounds
LEVELS = CELLS.bit_length()  # of the grid, each of blocks of 2 × 2 of the last, down to one cell
_OFFSETS = np.cumsum([0, *((CELLS >> k) ** 2 for k in range(LEVELS - 1))])
IN_FRONT = 1e-6  # local length in front of a lamp, nearer than which a triangle is kept whatever it can reach


@dataclass(frozen=True, eq=False)
class Reach:
    """Which casters matter.

    triangles: how many cast; useless: how many of them can reach no visible receiver; matters: (C,) bool over
    `geometry.caster_faces`. sure: whether every pixel was looked at; else what hides between samples may be missed.
    """

    triangles: int
    useless: int
    matters: Mask
    sure: bool


def reach_of(fitted: FittedMap) -> Reach:
    """Which casters can stand between the light and a receiver that is seen."""
    samples = fitted.samples
    geometry = samples.view.scene.geometry
    faces = geometry.caster_faces
    matters = np.zeros(len(faces), dtype=bool)
    for _, space, footprint in fitted.light_spaces():
        if not footprint.coords.shape[1]:
            continue
        places, ahead = _projected(geometry.vertices, space)
        grid = _grid(footprint, samples.step)
        for part in in_slices(len(faces)):
            corners = faces[part].T
            beyond = np.zeros(corners.shape[1], dtype=bool)
            if space.perspective:
                behind = np.count_nonzero(ahead.take(corners) <= IN_FRONT, axis=0)
                beyond = behind > 0
                matters[part] |= beyond & (behind < 3)  # through the lamp's own plane: no bounds
            a, b, c = (places.take(corner, axis=1) for corner in corners)
            low, high = np.minimum(np.minimum(a, b), c), np.maximum(np.maximum(a, b), c)
            matters[part] |= ~beyond & _touches(grid, low, high)
    return Reach(len(faces), int((~matters).sum()), matters, samples.step == 1)


def _projected(vertices: Floats, space: LightSpace) -> tuple[Floats, Floats]:
    """(3, V) light-space places of vertices, and (V,) how far ahead of the light they are."""
    x, y, back = space.basis @ vertices.T - (space.basis @ space.origin)[:, None]
    ahead: Floats = -back
    if not space.perspective:
        return np.stack([x, y, ahead]), ahead
    in_front = np.maximum(ahead, IN_FRONT)
    return np.stack([x / in_front, y / in_front, ahead]), ahead


@dataclass(frozen=True, eq=False)
class _Grid:
    """What is seen, across the light.

    start, end: (2, 1) its corners; cell: (2, 1) a cell's size; farthest: (cells,) the farthest depth in each, of all
    levels in one row, so that a level is an offset.
    """

    start: Floats
    end: Floats
    cell: Floats
    farthest: Floats

    def cells(self, places: Floats) -> Indices:
        """(2, N) those in which places are, of the finest level."""
        found: Indices = np.clip((places - self.start) / self.cell + 1.0, 0.0, CELLS - 1.0).astype(np.intp)
        return found


def _grid(footprint: Footprint, step: int) -> _Grid:
    """What is seen, with all of a pixel and a half step of it."""
    half = np.abs(footprint.jacobian).sum(axis=1) * ((step + 1) / 2)
    depth = footprint.coords[2] + (np.abs(footprint.slope) * half).sum(axis=0)
    low, high = footprint.coords[:2] - half, footprint.coords[:2] + half
    start, end = low.min(axis=1)[:, None], high.max(axis=1)[:, None]
    grid = _Grid(start, end, np.maximum(end - start, ROUNDING) / (CELLS - 2), np.empty(0))
    levels = _pyramid(grid.cells(low), grid.cells(high), depth)
    return replace(grid, farthest=np.concatenate([level.ravel() for level in levels]))


def _touches(grid: _Grid, low: Floats, high: Floats) -> Mask:
    """(F,) whether triangles with these bounds may stand before what is seen."""
    first, last = grid.cells(low[:2] - ROUNDING * grid.cell), grid.cells(high[:2] + ROUNDING * grid.cell)
    outside = (high[:2] < grid.start).any(axis=0) | (low[:2] > grid.end).any(axis=0)
    within = np.flatnonzero(~outside)
    touches = np.zeros(low.shape[1], dtype=bool)
    found = _farthest(grid.farthest, first[:, within], last[:, within])
    touches[within] = found >= low[2, within] - ROUNDING * (1 + np.abs(low[2, within]))
    return touches


def _level(first: Indices, last: Indices) -> Indices:
    """(N,) the finest level at which ranges of cells touch no more than 2 × 2."""
    width = (last - first).max(axis=0)
    level: Indices = np.ceil(np.log2(np.maximum(width, 1))).astype(np.intp)
    return level


def _pyramid(first: Indices, last: Indices, depth: Floats) -> list[Floats]:
    """The farthest depth in each cell of ranges (2, N) of cells, and level by level in blocks of 2 × 2 of them."""
    level = _level(first, last)
    levels = [np.full((CELLS >> k, CELLS >> k), -np.inf) for k in range(LEVELS)]
    # Wide ranges go to coarse levels, and from there down to all that is below them.
    for k in reversed(range(len(levels))):
        mine, grid = level == k, levels[k]
        for x in (first[0, mine] >> k, last[0, mine] >> k):
            for y in (first[1, mine] >> k, last[1, mine] >> k):
                np.maximum.at(grid, (x, y), depth[mine])
        if k:
            levels[k - 1] = np.maximum(levels[k - 1], grid.repeat(2, axis=0).repeat(2, axis=1))
    for k in range(1, len(levels)):
        fine = levels[k - 1]
        levels[k] = np.maximum(
            np.maximum(fine[::2, ::2], fine[1::2, ::2]), np.maximum(fine[::2, 1::2], fine[1::2, 1::2])
        )
    return levels


def _farthest(row: Floats, first: Indices, last: Indices) -> Floats:
    """(F,) the farthest depth in ranges (2, F) of cells, or in somewhat more than them."""
    level = _level(first, last)
    side, offset = CELLS >> level, _OFFSETS[level]
    found = np.full(first.shape[1], -np.inf)
    for x in (first[0] >> level, last[0] >> level):
        for y in (first[1] >> level, last[1] >> level):
            found = np.maximum(found, row[offset + x * side + y])
    return found
