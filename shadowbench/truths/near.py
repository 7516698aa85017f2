"""Occluders so close to a receiver that its shadow ray, which starts above the surface, misses them.

A shadow ray that starts δ above the surface skips a segment of length δ/(N·L), which is long for grazing light; in
float32 Embree cannot start lower. The skipped segment is tested here in float64, against triangles found by a BVH.
"""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from shadowbench.scenes.geometry import Geometry, in_slices
from shadowbench.scenes.model import Floats
from shadowbench.truths.rays import Indices, Mask, Receivers, dot

CHILDREN = 8  # per node of the BVH
MORTON_BITS = 10  # per coordinate
GROUPS_AT_ONCE = 1 << 12  # groups of receivers that start at the root together
PAIRS_AT_ONCE = 1 << 15  # (group, box) or (segment, triangle) pairs processed together; bounds memory
CASTERS_A_RECEIVER = 1 << 10  # most candidate triangles per segment; a receiver with more is undecided
SIDES = (32, 8, 2)  # pixels: squares of the image whose receivers on one triangle form a group
ROUNDING = 1e-12  # local length by which extents are widened
AT_SURFACE = 1e-9  # local length along L below which a hit is rounding, on a triangle in the receiver's own plane
FLAT = 1e-14  # local height above the receiver's plane below which a triangle counts as lying in it
COVERING = 2.0**-22  # local distance within which float32 may confuse two surfaces on top of each other


class _Groups(NamedTuple):
    """(2, G) extents of groups of segments, projected along L; (G + 1,) index of each group's first part."""

    low: Floats
    high: Floats
    parts: Indices


class _Boxes(NamedTuple):
    """(3, G) bounding boxes of groups; (3, G) origins and (2, 3, G) axes of the projection along L."""

    low: Floats
    high: Floats
    base: Floats
    axes: Floats
    groups: _Groups


class NearCasters:
    """BVH over the casters of a scene in local coordinates."""

    def __init__(self, geometry: Geometry) -> None:
        self._vertices, self._faces = np.ascontiguousarray(geometry.vertices.T), geometry.faces
        self._normals = np.ascontiguousarray(geometry.normals.T)
        casters = np.flatnonzero(geometry.casts)
        corners = self._corners(casters)
        low, high = np.minimum.reduce(corners), np.maximum.reduce(corners)
        order = _morton_order(low + high)
        self._casters = casters[order]
        self._levels = [(low[:, order], high[:, order])]  # leaves first, a triangle each
        while self._levels[-1][0].shape[1] > CHILDREN:
            low, high = self._levels[-1]
            first = np.arange(0, low.shape[1], CHILDREN)
            self._levels.append((np.minimum.reduceat(low, first, axis=1), np.maximum.reduceat(high, first, axis=1)))

    def nearest_blockers(
        self, receivers: Receivers, height: float, pixels: Indices, eye: Floats
    ) -> tuple[Floats, Mask]:
        """(N,) distance along L to the nearest caster within `height` above each receiver, inf if none; (N,) undecided.

        Neither a receiver's own triangle nor any in its plane blocks it. Undecided are receivers whose only blocker
        covers them so closely that, from `eye` (3, 1), float32 may show the blocker instead, and receivers with more
        than CASTERS_A_RECEIVER candidates. pixels: (2, N) column and row of each.
        """
        length = np.minimum(height / receivers.cosine, receivers.distance)
        to_light = np.broadcast_to(receivers.to_light, receivers.point.shape)
        distance, covered = np.full(len(length), np.inf), np.zeros(len(length), dtype=bool)
        tested = np.zeros(len(length), dtype=np.intp)
        for segment, caster in self.candidates(receivers, to_light * length, pixels, height):
            np.add.at(tested, segment, 1)
            few = tested[segment] <= CASTERS_A_RECEIVER
            segment, caster = segment[few], caster[few]
            point = receivers.point.take(segment, axis=1)
            a, b, c = (corner - point for corner in self._corners(caster))
            through = cross(b, c), cross(c, a), cross(a, b)  # normals of the planes through the point and each edge
            sides = [dot(normal, to_light.take(segment, axis=1)) for normal in through]
            with np.errstate(divide="ignore", invalid="ignore"):
                t = dot(a, through[0]) / (sides[0] + sides[1] + sides[2])
            hit = np.flatnonzero(_same_sign(sides) & (t > AT_SURFACE) & (t < length[segment]))
            segment, t = segment[hit], t[hit]
            view = point[:, hit] - eye
            over = _same_sign([dot(normal[:, hit], view) for normal in through])
            over &= np.abs(dot(self._normals[:, caster[hit]], a[:, hit])) < COVERING
            np.minimum.at(distance, segment[~over], t[~over])
            covered[segment[over]] = True
        too_many = tested > CASTERS_A_RECEIVER
        distance[too_many] = np.inf
        return distance, (covered & np.isinf(distance)) | too_many

    def candidates(
        self, receivers: Receivers, segments: Floats, pixels: Indices, height: float
    ) -> Iterator[tuple[Indices, Indices]]:
        """Batches of (K,) receiver and (K,) caster indices whose segment and triangle may intersect.

        segments: (3, N) vectors from the receivers. Projected along L, a group of receivers is small, and only the part
        of a caster within `height` above their plane counts; if the two overlap, the group's parts are tested, down to
        single receivers.
        """
        codes = [_square(pixels, side) for side in SIDES]
        order = np.lexsort((*codes[::-1], receivers.triangle))
        own = receivers.triangle[order]
        starts, segments = receivers.point[:, order], segments[:, order]
        ends = starts + segments

        changes = np.diff(own, prepend=-1) != 0
        firsts = []  # index of the first member of each group, largest groups first
        for code in codes:
            changes = changes | (np.diff(code[order], prepend=-1) != 0)
            firsts.append(np.flatnonzero(changes))
        largest = firsts[0]
        own = own[largest]
        up = self._normals[:, own]
        along = segments[:, largest]
        along = along / np.sqrt(np.maximum(dot(along, along), np.finfo(float).tiny))
        up = up * np.sign(dot(up, along))
        across = cross(up, along)
        frame = np.stack([across, cross(along, across), up])  # (3, 3, G): two axes across L, and the height
        base = self._vertices[:, self._faces[own, 0]]

        member_of = np.repeat(np.arange(len(largest)), np.diff(largest, append=len(order)))
        seen = [np.einsum("kin,in->kn", frame[:2, :, member_of], p - base[:, member_of]) for p in (starts, ends)]
        lows, highs = np.minimum(*seen) - ROUNDING, np.maximum(*seen) + ROUNDING
        every = np.arange(len(order))
        levels = [
            _Groups(
                np.minimum.reduceat(lows, first, axis=1),
                np.maximum.reduceat(highs, first, axis=1),
                np.searchsorted(next_first, np.append(first, len(order))),
            )
            for first, next_first in zip(firsts, [*firsts[1:], every], strict=True)
        ] + [_Groups(lows, highs, every)]
        box_low = np.minimum.reduceat(np.minimum(starts, ends), largest, axis=1)
        box_high = np.maximum.reduceat(np.maximum(starts, ends), largest, axis=1)
        boxes = _Boxes(box_low, box_high, base, frame[:2], levels[0])

        for batch in in_slices(len(largest), GROUPS_AT_ONCE):
            roots = self._levels[-1][0].shape[1]
            begin = np.repeat(np.arange(batch.start, batch.stop), roots)
            node = np.tile(np.arange(roots), batch.stop - batch.start)
            for group, caster in self._overlapping(boxes, len(self._levels) - 1, begin, node):
                other = caster != own[group]
                group, caster = group[other], caster[other]
                corners = [corner - base[:, group] for corner in self._corners(caster)]
                low, high = _extents([np.einsum("kin,in->kn", frame[:, :, group], c) for c in corners], height)
                for receiver, found in _descend(levels, group, caster, low, high):
                    yield order[receiver], found

    def _overlapping(
        self, boxes: "_Boxes", level: int, box: Indices, node: Indices
    ) -> Iterator[tuple[Indices, Indices]]:
        """Batches of (K,) box and (K,) triangle indices that overlap, below the given nodes of a level of the BVH."""
        lowest, highest = self._levels[level]
        for axis in range(3):
            kept = (lowest[axis, node] <= boxes.high[axis, box]) & (highest[axis, node] >= boxes.low[axis, box])
            box, node = box[kept], node[kept]
        for axis in range(2):
            toward = boxes.axes[axis][:, box]
            half = (highest[:, node] - lowest[:, node]) / 2
            middle = dot(toward, lowest[:, node] + half - boxes.base[:, box])
            radius = dot(np.abs(toward), half) + ROUNDING
            kept = middle + radius >= boxes.groups.low[axis, box]
            kept &= middle - radius <= boxes.groups.high[axis, box]
            box, node = box[kept], node[kept]
        if not level:
            yield box, self._casters[node]
            return
        for batch in in_slices(len(box), PAIRS_AT_ONCE // CHILDREN):
            parent = np.repeat(box[batch], CHILDREN)
            child = (node[batch, None] * CHILDREN + np.arange(CHILDREN)).ravel()
            valid = child < self._levels[level - 1][0].shape[1]
            yield from self._overlapping(boxes, level - 1, parent[valid], child[valid])

    def _corners(self, triangles: Indices) -> list[Floats]:
        """The three corners of triangles, (3, N) each."""
        return [self._vertices[:, self._faces[triangles, k]] for k in range(3)]


def _descend(
    levels: list[_Groups], group: Indices, caster: Indices, low: Floats, high: Floats
) -> Iterator[tuple[Indices, Indices]]:
    """Batches of (K,) receivers and (K,) casters that overlap, below the given groups of the first level.

    low, high: (2, K) extents of the casters.
    """
    groups, *below = levels
    kept = ((low <= groups.high[:, group]) & (high >= groups.low[:, group])).all(axis=0)
    group, caster, low, high = group[kept], caster[kept], low[:, kept], high[:, kept]
    if not below:
        yield group, caster
        return
    count = groups.parts[group + 1] - groups.parts[group]
    total = np.cumsum(count)
    full = np.searchsorted(total, np.arange(PAIRS_AT_ONCE, total.max(initial=0), PAIRS_AT_ONCE))
    for pairs in np.split(np.arange(len(group)), full):
        counts = count[pairs]
        pair = np.repeat(pairs, counts)
        part = groups.parts[group[pair]] + np.arange(len(pair)) - np.repeat(np.cumsum(counts) - counts, counts)
        yield from _descend(below, part, caster[pair], low[:, pair], high[:, pair])


def _extents(corners: list[Floats], height: float) -> tuple[Floats, Floats]:
    """(2, K) lower and upper extents along two axes of the part of each triangle between 0 and `height` on the third.

    corners: three times (3, K). The extents are inf and −inf for triangles outside, or that do not rise above FLAT.
    """
    low, high = np.full((2, 2, corners[0].shape[1]), np.inf)
    high = -high
    bottom, top = -ROUNDING, height + ROUNDING
    for k in range(3):
        a, b = corners[k - 1], corners[k]
        rise = b[2] - a[2]
        with np.errstate(divide="ignore", invalid="ignore"):
            ends = np.sort([(bottom - a[2]) / rise, (top - a[2]) / rise], axis=0)
        level = rise == 0
        inside = level & (a[2] >= bottom) & (a[2] <= top)
        first = np.where(level, np.where(inside, 0.0, 2.0), np.maximum(ends[0], 0.0))
        last = np.where(level, np.where(inside, 1.0, -1.0), np.minimum(ends[1], 1.0))
        valid = first <= last
        for share in (first, last):
            at = a[:2] + (b[:2] - a[:2]) * share
            np.minimum(low, at, out=low, where=valid)
            np.maximum(high, at, out=high, where=valid)
    flat = np.maximum.reduce([corner[2] for corner in corners]) <= FLAT
    low[:, flat], high[:, flat] = np.inf, -np.inf
    return low, high


def _square(pixels: Indices, side: int) -> Indices:
    """(N,) id of the image square that contains each pixel (2, N)."""
    number: Indices = (pixels[1] // side << 32) + pixels[0] // side
    return number


def cross(a: Floats, b: Floats) -> Floats:
    """(3, N) cross products of two (3, N); faster than np.cross."""
    return np.stack([a[k - 2] * b[k - 1] - a[k - 1] * b[k - 2] for k in range(3)])


def _same_sign(sides: list[Floats]) -> Mask:
    """(N,) whether the three signed volumes of a line and a triangle's edges agree in sign: the line hits it."""
    through: Mask = (np.minimum.reduce(sides) >= 0) | (np.maximum.reduce(sides) <= 0)
    return through


def _morton_order(points: Floats) -> Indices:
    """(N,) order of (3, N) points along a Morton curve."""
    low, high = points.min(axis=1, initial=0.0), points.max(axis=1, initial=0.0)
    cells = ((points.T - low) / np.maximum(high - low, 1e-300) * (2**MORTON_BITS - 1)).T.astype(np.int64)
    code = np.zeros(points.shape[1], dtype=np.int64)
    for bit in range(MORTON_BITS):
        for axis in range(3):
            code |= (cells[axis] >> bit & 1) << (3 * bit + axis)
    return np.argsort(code)
