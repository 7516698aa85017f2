"""Casters that cannot shadow any visible receiver, so that the depth pass may skip them.

Conservative: a grid in light space has the depth of the farthest visible receiver in each cell. A triangle matters if
any cell that its bounds overlap has a receiver behind the triangle's nearest corner.
"""

from dataclasses import dataclass, field, replace

import numpy as np

from shadowbench.geometry.lights import LightSpace
from shadowbench.scenes.geometry import in_slices
from shadowbench.scenes.vectors import Floats
from shadowbench.survey.maps import FittedMap, Footprint
from shadowbench.survey.rays import Indices, Mask

CELLS = 1024  # along a side of the grid; a power of two
ROUNDING = 1e-6  # tolerance of depths and bounds
LEVELS = CELLS.bit_length()  # of the grid's pyramid, each with half the resolution of the previous, down to one cell
_OFFSETS = np.cumsum([0, *((CELLS >> k) ** 2 for k in range(LEVELS - 1))])
IN_FRONT = 1e-6  # distance from the plane of a spot or point light within which triangles always matter, local length


@dataclass(frozen=True, eq=False)
class RelevantCasters:
    """The casters that can shadow visible receivers.

    triangles: number of caster triangles; useless: number of those that cannot shadow any visible receiver; matters:
    (C,) bool over `geometry.caster_faces`, the others. sure: False if not every pixel was sampled, so that receivers
    between the samples may be missed, or if the light has a size, as only its centre is considered.
    """

    triangles: int
    useless: int
    matters: Mask = field(repr=False)
    sure: bool


def relevant_casters(fitted: FittedMap) -> RelevantCasters:
    """The casters that can be between the light and a visible receiver."""
    samples = fitted.samples
    geometry = samples.view.scene.geometry
    faces = geometry.caster_faces
    matters = np.zeros(len(faces), dtype=bool)
    for _, space, footprint in fitted.light_spaces():
        if not footprint.coords.shape[1]:
            continue
        coords, ahead = _projected(geometry.vertices, space)
        grid = _grid(footprint, samples.step)
        for part in in_slices(len(faces)):
            corners = faces[part].T
            beyond = np.zeros(corners.shape[1], dtype=bool)
            if space.perspective:
                behind = np.count_nonzero(ahead.take(corners) <= IN_FRONT, axis=0)
                beyond = behind > 0
                matters[part] |= beyond & (behind < 3)  # triangles through the light's plane have no bounds
            a, b, c = (coords.take(corner, axis=1) for corner in corners)
            low, high = np.minimum(np.minimum(a, b), c), np.maximum(np.maximum(a, b), c)
            matters[part] |= ~beyond & _touches(grid, low, high)
    sure = samples.step == 1 and not samples.view.light.soft
    return RelevantCasters(len(faces), int((~matters).sum()), matters, sure)


def _projected(vertices: Floats, space: LightSpace) -> tuple[Floats, Floats]:
    """(3, V) light-space coordinates of (V, 3) vertices, and their (V,) distances along the light's axis."""
    x, y, back = space.basis @ vertices.T - (space.basis @ space.origin)[:, None]
    ahead: Floats = -back
    if not space.perspective:
        return np.stack([x, y, ahead]), ahead
    in_front = np.maximum(ahead, IN_FRONT)
    return np.stack([x / in_front, y / in_front, ahead]), ahead


@dataclass(frozen=True, eq=False)
class _Grid:
    """The visible receivers on a grid in light space.

    start, end: (2, 1) corners of the grid; cell: (2, 1) size of a cell; farthest: (cells,) depth of the farthest
    receiver in each cell, for all pyramid levels one after another.
    """

    start: Floats
    end: Floats
    cell: Floats
    farthest: Floats

    def cells(self, coords: Floats) -> Indices:
        """(2, N) cells of the finest level that contain (2, N) light-space coordinates."""
        found: Indices = np.clip((coords - self.start) / self.cell + 1.0, 0.0, CELLS - 1.0).astype(np.intp)
        return found


def _grid(footprint: Footprint, step: int) -> _Grid:
    """The grid of the visible receivers, each sample enlarged to its whole pixel and half the sampling step."""
    half = np.abs(footprint.jacobian).sum(axis=1) * ((step + 1) / 2)
    depth = footprint.coords[2] + (np.abs(footprint.slope) * half).sum(axis=0)
    low, high = footprint.coords[:2] - half, footprint.coords[:2] + half
    start, end = low.min(axis=1)[:, None], high.max(axis=1)[:, None]
    grid = _Grid(start, end, np.maximum(end - start, ROUNDING) / (CELLS - 2), np.empty(0))
    levels = _pyramid(grid.cells(low), grid.cells(high), depth)
    return replace(grid, farthest=np.concatenate([level.ravel() for level in levels]))


def _touches(grid: _Grid, low: Floats, high: Floats) -> Mask:
    """(F,) bool: whether triangles with (3, F) lowest and highest corners may be in front of visible receivers."""
    first, last = grid.cells(low[:2] - ROUNDING * grid.cell), grid.cells(high[:2] + ROUNDING * grid.cell)
    outside = (high[:2] < grid.start).any(axis=0) | (low[:2] > grid.end).any(axis=0)
    within = np.flatnonzero(~outside)
    touches = np.zeros(low.shape[1], dtype=bool)
    found = _farthest(grid.farthest, first[:, within], last[:, within])
    touches[within] = found >= low[2, within] - ROUNDING * (1 + np.abs(low[2, within]))
    return touches


def _level(first: Indices, last: Indices) -> Indices:
    """(N,) the finest level at which (2, N) cell ranges cover at most 2 × 2 cells."""
    width = (last - first).max(axis=0)
    level: Indices = np.ceil(np.log2(np.maximum(width, 1))).astype(np.intp)
    return level


def _pyramid(first: Indices, last: Indices, depth: Floats) -> list[Floats]:
    """The pyramid of maximum depths: the farthest depth in each cell, by level.

    first, last: (2, N) cell ranges of the samples; depth: (N,).
    """
    level = _level(first, last)
    levels = [np.full((CELLS >> k, CELLS >> k), -np.inf) for k in range(LEVELS)]
    # Wide ranges are written to coarse levels, and propagate to the finer levels from there.
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
    """(F,) the farthest depth in (2, F) cell ranges, or in slightly larger ranges."""
    level = _level(first, last)
    side, offset = CELLS >> level, _OFFSETS[level]
    found = np.full(first.shape[1], -np.inf)
    for x in (first[0] >> level, last[0] >> level):
        for y in (first[1] >> level, last[1] >> level):
            found = np.maximum(found, row[offset + x * side + y])
    return found
