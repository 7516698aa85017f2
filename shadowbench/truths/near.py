"""Casters so near to a surface that a shadow ray which starts above it passes them by.

A ray that starts δ above a surface begins δ/(N·L) along L: far from the point where light grazes, and Embree's float32
cannot begin lower. The stretch left out is tested here in float64, against the triangles that a tree of boxes finds.
"""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from shadowbench.scenes.geometry import Geometry, in_slices
from shadowbench.scenes.model import Floats
from shadowbench.truths.rays import Indices, Mask, Receivers, dot

CHILDREN = 8  # of a node of the tree
MORTON_BITS = 10  # a coordinate
GROUPS_AT_ONCE = 1 << 12  # of receivers, which begin at the root
PAIRS_AT_ONCE = 1 << 15  # of a group or stretch and a box or triangle: few, so that memory is bounded
CASTERS_A_RECEIVER = 1 << 10  # that may cross its stretch: where there are more, it is in doubt
SIDES = (32, 8, 2)  # pixels, of the squares whose receivers of one triangle are a group
ROUNDING = 1e-12  # local, by which extents are widened
AT_SURFACE = 1e-9  # local length along L up to which a crossing is rounding: of a triangle in the receiver's own plane
FLAT = 1e-14  # local height above the receiver's plane up to which a triangle lies in it
COVERING = 2.0**-22  # local distance at which float32 may take one surface for another that lies over it


class _Groups(NamedTuple):
    """(2, G) extents of groups of receivers and their ways, seen along L; where the parts of each begin."""

    low: Floats
    high: Floats
    parts: Indices


class _Boxes(NamedTuple):
    """(3, G) boxes about groups; (3, G) the points and (2, 3, G) the axes that extents along L are measured by."""

    low: Floats
    high: Floats
    base: Floats
    axes: Floats
    groups: _Groups


class NearCasters:
    """The casters of a scene, which is in local coordinates, in a tree of boxes."""

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

    def blocked(self, receivers: Receivers, height: float, pixels: Indices, eye: Floats) -> tuple[Floats, Mask]:
        """(N,) distance along L to the nearest caster within `height` above each surface, inf for none; (N,) doubt.

        A receiver's own triangle does not block it, nor does any in its plane. Doubtful is a receiver that is blocked
        only by what, seen from `eye` (3, 1), covers it so closely that the eye may see that instead; and one that more
        than CASTERS_A_RECEIVER may block. `pixels` (2, N): column and row of each.
        """
        length = np.minimum(height / receivers.cosine, receivers.distance)
        to_light = np.broadcast_to(receivers.to_light, receivers.point.shape)
        distance, covered = np.full(len(length), np.inf), np.zeros(len(length), dtype=bool)
        tested = np.zeros(len(length), dtype=np.intp)
        for stretch, caster in self.candidates(receivers, to_light * length, pixels, height):
            np.add.at(tested, stretch, 1)
            few = tested[stretch] <= CASTERS_A_RECEIVER
            stretch, caster = stretch[few], caster[few]
            point = receivers.point.take(stretch, axis=1)
            a, b, c = (corner - point for corner in self._corners(caster))
            through = cross(b, c), cross(c, a), cross(a, b)  # normals of the planes through the point and each side
            sides = [dot(normal, to_light.take(stretch, axis=1)) for normal in through]
            with np.errstate(divide="ignore", invalid="ignore"):
                t = dot(a, through[0]) / (sides[0] + sides[1] + sides[2])
            met = np.flatnonzero(_alike(sides) & (t > AT_SURFACE) & (t < length[stretch]))
            stretch, t = stretch[met], t[met]
            view = point[:, met] - eye
            over = _alike([dot(normal[:, met], view) for normal in through])
            over &= np.abs(dot(self._normals[:, caster[met]], a[:, met])) < COVERING
            np.minimum.at(distance, stretch[~over], t[~over])
            covered[stretch[over]] = True
        too_many = tested > CASTERS_A_RECEIVER
        distance[too_many] = np.inf
        return distance, (covered & np.isinf(distance)) | too_many

    def candidates(
        self, receivers: Receivers, ways: Floats, pixels: Indices, height: float
    ) -> Iterator[tuple[Indices, Indices]]:
        """Receivers and the casters that may cross their ways, (3, N) vectors, as (K,) indices each, some at a time.

        Seen along L a group of receivers is small, and of a caster only what is within `height` above their plane
        counts: where the two overlap, the group's parts are asked, down to single receivers.
        """
        codes = [_square(pixels, side) for side in SIDES]
        order = np.lexsort((*codes[::-1], receivers.triangle))
        own = receivers.triangle[order]
        starts, ways = receivers.point[:, order], ways[:, order]
        ends = starts + ways

        changes = np.diff(own, prepend=-1) != 0
        firsts = []  # of the members of each group, largest groups first
        for code in codes:
            changes = changes | (np.diff(code[order], prepend=-1) != 0)
            firsts.append(np.flatnonzero(changes))
        largest = firsts[0]
        own = own[largest]
        up = self._normals[:, own]
        along = ways[:, largest] / np.sqrt(np.maximum(dot(ways[:, largest], ways[:, largest]), np.finfo(float).tiny))
        up = up * np.sign(dot(up, along))
        across = cross(up, along)
        frame = np.stack([across, cross(along, across), up])  # (3, 3, G) rows seen along L, and the height
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

        for some in in_slices(len(largest), GROUPS_AT_ONCE):
            roots = self._levels[-1][0].shape[1]
            begin = np.repeat(np.arange(some.start, some.stop), roots)
            node = np.tile(np.arange(roots), some.stop - some.start)
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
        """Which boxes overlap which triangles below the nodes of a level of the tree: (K,) each, some at a time."""
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
        for some in in_slices(len(box), PAIRS_AT_ONCE // CHILDREN):
            parent = np.repeat(box[some], CHILDREN)
            child = (node[some, None] * CHILDREN + np.arange(CHILDREN)).ravel()
            there = child < self._levels[level - 1][0].shape[1]
            yield from self._overlapping(boxes, level - 1, parent[there], child[there])

    def _corners(self, triangles: Indices) -> list[Floats]:
        """Three times (3, N)."""
        return [self._vertices[:, self._faces[triangles, k]] for k in range(3)]


def _descend(
    levels: list[_Groups], group: Indices, caster: Indices, low: Floats, high: Floats
) -> Iterator[tuple[Indices, Indices]]:
    """Receivers and casters, (K,) each, that overlap, of the groups of the first of some levels.

    low, high: (2, K) the casters' extents.
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
        many = count[pairs]
        pair = np.repeat(pairs, many)
        part = groups.parts[group[pair]] + np.arange(len(pair)) - np.repeat(np.cumsum(many) - many, many)
        yield from _descend(below, part, caster[pair], low[:, pair], high[:, pair])


def _extents(corners: list[Floats], height: float) -> tuple[Floats, Floats]:
    """(2, K) from and to where triangles reach along two axes, up to `height` on the third; inf, −inf for nowhere.

    `corners` three times (3, K). A triangle that does not rise above FLAT reaches nowhere.
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
        there = first <= last
        for share in (first, last):
            at = a[:2] + (b[:2] - a[:2]) * share
            np.minimum(low, at, out=low, where=there)
            np.maximum(high, at, out=high, where=there)
    flat = np.maximum.reduce([corner[2] for corner in corners]) <= FLAT
    low[:, flat], high[:, flat] = np.inf, -np.inf
    return low, high


def _square(pixels: Indices, side: int) -> Indices:
    """(N,) a number for the square of the image that each pixel (2, N) lies in."""
    number: Indices = (pixels[1] // side << 32) + pixels[0] // side
    return number


def cross(a: Floats, b: Floats) -> Floats:
    """(3, N) of two (3, N); np.cross takes longer."""
    return np.stack([a[k - 2] * b[k - 1] - a[k - 1] * b[k - 2] for k in range(3)])


def _alike(sides: list[Floats]) -> Mask:
    """Whether a line passes all sides of a triangle on the same side: it goes through."""
    through: Mask = (np.minimum.reduce(sides) >= 0) | (np.maximum.reduce(sides) <= 0)
    return through


def _morton_order(points: Floats) -> Indices:
    """(N,) an order of (3, N) points in which neighbours lie near each other."""
    low, high = points.min(axis=1, initial=0.0), points.max(axis=1, initial=0.0)
    cells = ((points.T - low) / np.maximum(high - low, 1e-300) * (2**MORTON_BITS - 1)).T.astype(np.int64)
    code = np.zeros(points.shape[1], dtype=np.int64)
    for bit in range(MORTON_BITS):
        for axis in range(3):
            code |= (cells[axis] >> bit & 1) << (3 * bit + axis)
    return np.argsort(code)
