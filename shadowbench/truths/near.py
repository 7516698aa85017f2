"""Occluders so close to a receiver that its shadow ray, which starts above the surface, misses them.

A shadow ray that starts δ above the surface skips a segment of length δ/(N·L), which is long for grazing light; in
float32 Embree cannot start lower. The skipped segment is tested here in float64, against triangles found in the tree.
"""

from threading import Lock

import numpy as np

from shadowbench.compiled import compiled
from shadowbench.geometry.tree import LEAF, Tree, build_tree
from shadowbench.scenes.geometry import Geometry
from shadowbench.scenes.vectors import Floats
from shadowbench.truths.rays import Mask, Receivers

AT_SURFACE = 1e-9  # local length along L below which a hit is rounding, on a triangle in the receiver's own plane
FLAT = 1e-14  # local height above the receiver's plane below which a triangle counts as lying in it
COVERING = 2.0**-22  # local distance within which float32 may confuse two surfaces on top of each other
LEAST = 1e-30  # of a direction's part along an axis, which is divided by


class NearCasters:
    """The casters of a scene in local coordinates, in a tree."""

    def __init__(self, geometry: Geometry) -> None:
        self._geometry, self._building = geometry, Lock()
        self._tree: Tree | None = None

    def nearest_blockers(self, receivers: Receivers, height: float, eye: Floats) -> tuple[Floats, Mask]:
        """(N,) distance along L to the nearest caster within `height` above each receiver, inf if none; (N,) covered.

        Nothing in a receiver's own plane blocks it. Covered are those whose only blocker lies on them so closely that,
        from `eye` (3, 1), float32 may show the blocker instead.
        """
        count, geometry = len(receivers.triangle), self._geometry
        distance, covered = np.full(count, np.inf), np.zeros(count, dtype=bool)
        if not count:
            return distance, covered
        with self._building:  # by the first thread that needs it: few views have grazing light
            tree = self._tree = self._tree or build_tree(geometry.vertices, geometry.caster_faces)
        casters = geometry.vertices, geometry.faces, geometry.normals, np.flatnonzero(geometry.casts)[tree.order]
        length = np.minimum(height / receivers.cosine, receivers.distance)
        vectors = (receivers.point, np.broadcast_to(receivers.to_light, (3, count)), eye[:, 0])
        points, to_light, start = map(np.ascontiguousarray, vectors)  # of one type, for which it is compiled
        segments = points, to_light, length, receivers.triangle, start
        _find_nearest(tree.words, tree.low, tree.step, *casters, *segments, distance, covered)
        return distance, covered & np.isinf(distance)


@compiled(error_model="numpy")
def _find_nearest(  # type: ignore[no-untyped-def]
    words, low, step, vertices, faces, normals, casters, points, to_light, length, own, eye, distance, covered
):
    """Fill the distance of each segment's nearest hit, and whether one covers it, by a walk of the tree."""
    point, way, inverse = np.empty(3), np.empty(3), np.empty(3)
    corners, through, sides = np.empty((3, 3)), np.empty((3, 3)), np.empty(3)
    for i in range(len(length)):
        for k in range(3):
            point[k], way[k] = points[k, i], to_light[k, i]
            inverse[k] = 1.0 / way[k] if abs(way[k]) > LEAST else 1.0 / LEAST
        node = np.int64(0)
        while node < len(words):
            link = np.int64(words[node, 3])
            reached = _reaches(words[node], low, step, point, inverse, length[i])
            node = node + 1 if reached or link >= LEAF else link
            if not reached or link < LEAF:
                continue
            first = (link - LEAF) >> 3
            for place in range(first, first + (link & 7)):
                caster = casters[place]
                if caster == own[i]:
                    continue
                t = _hit(vertices, faces[caster], point, way, corners, through, sides)
                if not AT_SURFACE < t < length[i]:
                    continue
                if _rises(vertices, faces[caster], normals[own[i]], way, vertices[faces[own[i], 0]]):
                    if _covers(through, point - eye, normals[caster], corners[0]):
                        covered[i] = True
                    else:
                        distance[i] = min(distance[i], t)


@compiled()
def _covers(through, seen, normal, corner):  # type: ignore[no-untyped-def]
    """Whether a triangle also meets the camera's ray to the point, `seen` from the eye, and lies on the point."""
    sides = np.empty(3)
    for j in range(3):
        sides[j] = _dot(through[j], seen)
    return _same_sign(sides) and abs(_dot(normal, corner)) < COVERING


@compiled(error_model="numpy")
def _hit(vertices, face, point, way, corners, through, sides):  # type: ignore[no-untyped-def]
    """How far along a line from a point a triangle is met, −1 if it is not.

    Fills its corners as seen from the point, the planes through the point and its edges, and the line's side of them.
    """
    for j in range(3):
        for k in range(3):
            corners[j, k] = vertices[face[j], k] - point[k]
    for j in range(3):
        _cross(corners[j - 2], corners[j - 1], through[j])
        sides[j] = _dot(through[j], way)
    t = _dot(corners[0], through[0]) / (sides[0] + sides[1] + sides[2])
    return t if _same_sign(sides) else -1.0


@compiled()
def _reaches(word, low, step, point, inverse, length):  # type: ignore[no-untyped-def]
    """Whether a segment meets a node's box, widened by a step, since boxes are of rounded vertices."""
    enter, leave = 0.0, length
    for k in range(3):
        lowest = low[k] + (np.float64(word[k] & 0xFFFF) - 1.0) * step[k] - point[k]
        highest = low[k] + (np.float64(word[k] >> 16) + 1.0) * step[k] - point[k]
        enter = max(enter, min(lowest * inverse[k], highest * inverse[k]))
        leave = min(leave, max(lowest * inverse[k], highest * inverse[k]))
    return enter <= leave


@compiled()
def _rises(vertices, face, normal, way, base):  # type: ignore[no-untyped-def]
    """Whether a triangle rises above the plane through `base`, on the side that L points to."""
    up = np.sign(_dot(normal, way))
    height = -np.inf
    for j in range(3):
        height = max(height, up * _dot(normal, vertices[face[j]] - base))
    return height > FLAT


@compiled()
def _cross(a, b, result):  # type: ignore[no-untyped-def]
    for k in range(3):
        result[k] = a[k - 2] * b[k - 1] - a[k - 1] * b[k - 2]


@compiled()
def _dot(a, b):  # type: ignore[no-untyped-def]
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@compiled()
def _same_sign(sides):  # type: ignore[no-untyped-def]
    """Whether the three signed volumes of a line and a triangle's edges agree in sign: the line hits it."""
    return min(sides[0], sides[1], sides[2]) >= 0 or max(sides[0], sides[1], sides[2]) <= 0
