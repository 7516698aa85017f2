"""Casters so near to a surface that a shadow ray which starts above it passes them by.

A ray that starts δ above a surface begins δ/(N·L) along L: far from the point where light grazes, and Embree's float32
cannot begin lower. The stretch left out is tested here in float64, against the triangles that a tree of boxes finds.
"""

from collections.abc import Iterator

import numpy as np

from shadowbench.scenes.model import Floats, Geometry, in_slices
from shadowbench.truth.rays import Indices, Mask, Receivers, dot

CHILDREN = 8  # of a node of the tree
MORTON_BITS = 10  # a coordinate
GROUPS_AT_ONCE = 1 << 10  # of receivers: each may have a thousand triangles about it
PAIRS_AT_ONCE = 1 << 16  # of a stretch and a triangle, so that a core's cache holds what is computed of them
AT_SURFACE = 1e-9  # local length along L up to which a crossing is rounding: of a triangle in the receiver's own plane
FLAT = 1e-14  # local height above the receiver's plane up to which a triangle lies in it
COVERING = 2.0**-22  # local distance at which float32 may take one surface for another that lies over it


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

    def blocked(self, receivers: Receivers, height: float, block: Indices, eye: Floats) -> tuple[Floats, Mask]:
        """(N,) distance along L to the nearest caster within `height` above each surface, inf for none; (N,) doubt.

        A receiver's own triangle does not block it, nor does any in its plane. Doubtful is a receiver that is blocked
        only by what, seen from `eye` (3, 1), covers it so closely that the eye may see that instead. `block` (N,), any
        numbers: casters near receivers of one triangle and block are searched for together.
        """
        length = np.minimum(height / receivers.cosine, receivers.distance)
        to_light = np.broadcast_to(receivers.to_light, receivers.point.shape)
        distance, covered = np.full(len(length), np.inf), np.zeros(len(length), dtype=bool)
        for stretch, caster in self._pairs(receivers, to_light * length, block, height):
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
        return distance, covered & np.isinf(distance)

    def _pairs(
        self, receivers: Receivers, ways: Floats, block: Indices, height: float
    ) -> Iterator[tuple[Indices, Indices]]:
        """Receivers and the casters that may cross their ways, (3, N) vectors, as (K,) indices each, some at a time."""
        order = np.lexsort((block, receivers.triangle))
        triangle, block = receivers.triangle[order], block[order]
        first = np.flatnonzero((np.diff(triangle, prepend=-1) != 0) | (np.diff(block, prepend=-1) != 0))
        count = np.diff(first, append=len(order))
        starts = receivers.point[:, order]
        ends = starts + ways[:, order]
        low = np.minimum.reduceat(np.minimum(starts, ends), first, axis=1)
        high = np.maximum.reduceat(np.maximum(starts, ends), first, axis=1)

        for some in in_slices(len(first), GROUPS_AT_ONCE):
            group, caster = self._overlapping(low[:, some], high[:, some])
            group += some.start
            own = triangle[first[group]]
            up = self._normals[:, own]
            up = up * np.sign(dot(up, ways[:, order[first[group]]]))
            base = self._vertices[:, self._faces[own, 0]]
            heights = [dot(up, corner - base) for corner in self._corners(caster)]
            may = (caster != own) & (np.maximum.reduce(heights) > FLAT) & (np.minimum.reduce(heights) < height)
            group, caster = group[may], caster[may]

            pairs = np.cumsum(count[group])
            full = np.searchsorted(pairs, np.arange(PAIRS_AT_ONCE, pairs.max(initial=0), PAIRS_AT_ONCE))
            for part in np.split(np.arange(len(group)), full):
                many = count[group[part]]
                within = np.arange(many.sum()) - np.repeat(np.cumsum(many) - many, many)
                yield order[np.repeat(first[group[part]], many) + within], np.repeat(caster[part], many)

    def _overlapping(self, low: Floats, high: Floats) -> tuple[Indices, Indices]:
        """Which boxes, (3, Q) their lowest and highest corners, overlap those of which triangles: (K,) each."""
        box = np.repeat(np.arange(low.shape[1]), self._levels[-1][0].shape[1])
        node = np.tile(np.arange(self._levels[-1][0].shape[1]), low.shape[1])
        for level, (lowest, highest) in zip(range(len(self._levels))[::-1], self._levels[::-1], strict=True):
            for axis in range(3):
                kept = (lowest[axis, node] <= high[axis, box]) & (highest[axis, node] >= low[axis, box])
                box, node = box[kept], node[kept]
            if level:
                box = np.repeat(box, CHILDREN)
                node = (node[:, None] * CHILDREN + np.arange(CHILDREN)).ravel()
                there = node < self._levels[level - 1][0].shape[1]
                box, node = box[there], node[there]
        return box, self._casters[node]

    def _corners(self, triangles: Indices) -> list[Floats]:
        """Three times (3, N)."""
        return [self._vertices[:, self._faces[triangles, k]] for k in range(3)]


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
