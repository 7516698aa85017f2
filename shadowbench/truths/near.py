"""Occluders so close to a receiver that its shadow ray, which starts above the surface, misses them.

A shadow ray that starts δ above the surface skips a segment of length δ/(N·L), which is long for grazing light; in
float32 Embree cannot start lower. The skipped segment is tested here in float64, against triangles found in the tree.
"""

from threading import Lock

import numpy as np

from shadowbench.compiled import compiled
from shadowbench.geometry.tree import Tree, build_tree
from shadowbench.scenes.triangles import Geometry, facet_normals
from shadowbench.scenes.vectors import Floats
from shadowbench.truths.cutouts import NO_CUTOUTS, OPAQUE, CutoutArrays, cutout_arrays, decide_at
from shadowbench.truths.rays import Mask, Receivers
from shadowbench.truths.segments import cross, dot, hit, inverse_of, next_leaf, same_sign

AT_SURFACE = 1e-9  # local length along L below which a hit is rounding, on a triangle in the receiver's own plane
FLAT = 1e-14  # local height above the receiver's plane below which a triangle counts as lying in it
COVERING = 2.0**-22  # local distance within which float32 may confuse two surfaces on top of each other


class NearCasters:
    """The casters of a scene in local coordinates, in a tree."""

    def __init__(self, geometry: Geometry) -> None:
        self._geometry, self._building = geometry, Lock()
        self._search: tuple[Tree, CutoutArrays] | None = None

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
            if self._search is None:
                cut = geometry.cutouts and cutout_arrays(geometry.cutouts, geometry.vertices, geometry.faces)
                self._search = build_tree(geometry.vertices, geometry.caster_faces), cut or NO_CUTOUTS
            tree, cut = self._search
        casters = geometry.vertices, geometry.faces, np.flatnonzero(geometry.casts)[tree.order]
        length = np.minimum(height / receivers.cosine, receivers.distance)
        vectors = (receivers.point, np.broadcast_to(receivers.to_light, (3, count)), eye[:, 0])
        points, to_light, start = map(np.ascontiguousarray, vectors)  # of one type, for which it is compiled
        corners = geometry.corners(receivers.triangle)
        own = receivers.triangle, facet_normals(corners), np.ascontiguousarray(corners[:, 0])
        segments = points, to_light, length, *own, start
        _find_nearest(tree.words, tree.low, tree.step, *casters, cut, *segments, distance, covered)
        return distance, covered & np.isinf(distance)


@compiled(error_model="numpy")
def _find_nearest(  # type: ignore[no-untyped-def]
    words, low, step, vertices, faces, casters, cut, points, to_light, length, own, own_normals, own_corners, eye,
    distance, covered,
):  # fmt: skip
    """Fill the distance of each segment's nearest hit, and whether one covers it, by a walk of the tree."""
    point, way, inverse, normal = np.empty(3), np.empty(3), np.empty(3), np.empty(3)
    corners, through, sides = np.empty((3, 3)), np.empty((3, 3)), np.empty(3)
    for i in range(len(length)):
        for k in range(3):
            point[k], way[k] = points[k, i], to_light[k, i]
            inverse[k] = inverse_of(way[k])
        node = np.int64(0)
        while True:
            node, first, count = next_leaf(words, node, low, step, point, inverse, length[i])
            if count == 0:
                break
            for caster in casters[first : first + count]:
                if caster == own[i]:
                    continue
                face = faces[caster]
                t = hit(vertices, face, point, way, corners, through, sides)
                if not AT_SURFACE < t < length[i]:
                    continue
                if decide_at(cut, caster, sides) != OPAQUE:
                    continue
                if _rises(vertices, face, own_normals[i], way, own_corners[i]):
                    cross(vertices[face[1]] - vertices[face[0]], vertices[face[2]] - vertices[face[0]], normal)
                    size = np.sqrt(dot(normal, normal))
                    if _covers(through, point - eye, normal / size if size > 0.0 else normal, corners[0]):
                        covered[i] = True
                    else:
                        distance[i] = min(distance[i], t)


@compiled()
def _covers(through, seen, normal, corner):  # type: ignore[no-untyped-def]
    """Whether a triangle also meets the camera's ray to the point, `seen` from the eye, and lies on the point."""
    sides = np.empty(3)
    for j in range(3):
        sides[j] = dot(through[j], seen)
    return same_sign(sides) and abs(dot(normal, corner)) < COVERING


@compiled()
def _rises(vertices, face, normal, way, base):  # type: ignore[no-untyped-def]
    """Whether a triangle rises above the plane through `base`, on the side that L points to."""
    up = np.sign(dot(normal, way))
    height = -np.inf
    for j in range(3):
        height = max(height, up * dot(normal, vertices[face[j]] - base))
    return height > FLAT
