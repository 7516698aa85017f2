"""Occluders so close to a receiver that its shadow ray, which starts above the surface, misses them.

A shadow ray that starts δ above the surface skips a segment of length δ/(N·L), which is long for grazing light; in
float32 Embree cannot start lower. The skipped segment is tested here in float64, against triangles found in the tree.
"""

from threading import Lock
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from shadowbench.compiled import compiled
from shadowbench.geometry.tree import build_tree
from shadowbench.scenes.geometry import Geometry, facet_normals
from shadowbench.scenes.instanced import InstancedGeometry
from shadowbench.scenes.vectors import Floats
from shadowbench.truths.cutouts import CutoutArrays, cutout_arrays, is_opaque_at
from shadowbench.truths.instances import world_matrices
from shadowbench.truths.rays import Mask, Receivers
from shadowbench.truths.segments import cross, dot, hit, inverse_of, next_leaf, same_sign

AT_SURFACE = 1e-9  # local length along L below which a hit is rounding, on a triangle in the receiver's own plane
FLAT = 1e-14  # local height above the receiver's plane below which a triangle counts as lying in it
COVERING = 2.0**-22  # local distance within which float32 may confuse two surfaces on top of each other


class Casters(NamedTuple):
    """Casters for compiled code: instances in a tree, and the triangles of their sources in trees of their own.

    words, low, step, order: of the tree of the I instances. source_words, source_order: of all trees of sources in
    turn, order as indices of a source's faces; ends (S + 1, 2): where those of a source begin and end; source_low,
    source_step: (S, 3). source, first, offset: (I,) source of an instance, index of its first triangle, and of its
    first face; inward: (I, 3, 4) from the world to its points. points, faces, moves: see `InstancedGeometry`; a flat
    scene is one instance that is not moved.
    """

    words: NDArray[np.uint32]
    low: Floats
    step: Floats
    order: NDArray[np.int32]
    source_words: NDArray[np.uint32]
    source_order: NDArray[np.int32]
    ends: NDArray[np.int64]
    source_low: Floats
    source_step: Floats
    source: NDArray[np.int64]
    first: NDArray[np.int64]
    offset: NDArray[np.int64]
    inward: Floats
    points: Floats
    faces: NDArray[np.int32]
    moves: Floats


def _casters(geometry: Geometry) -> Casters:
    if isinstance(geometry, InstancedGeometry):
        own = np.flatnonzero(geometry.mesh_casts)
        trees = [build_tree(mesh.points, mesh.faces) for mesh in geometry.sources]
        orders = [tree.order for tree in trees]
        boxes, inward = geometry.mesh_bounds[own], np.linalg.inv(world_matrices(geometry)[own])[:, :3]
        of_instances = geometry.source[own], geometry.first[own], geometry.offset[own], np.ascontiguousarray(inward)
        lists = geometry.points, geometry.source_faces, np.ascontiguousarray(geometry.moves[:, own])
    else:
        trees = [build_tree(geometry.vertices, geometry.caster_faces)]
        orders = [np.flatnonzero(geometry.casts).astype(np.int32)[trees[0].order]]
        boxes, one = geometry.bounds[np.newaxis], np.zeros(1, dtype=np.int64)
        of_instances = one, one, one, np.eye(4)[np.newaxis, :3]
        lists = geometry.vertices, geometry.faces, np.empty((0, 1, 4, 4))
    # A box as a triangle between its lowest and its highest corner.
    top = build_tree(boxes.reshape(-1, 3), np.arange(2 * len(boxes), dtype=np.int32).reshape(-1, 2)[:, [0, 1, 1]])
    return Casters(
        top.words,
        top.low,
        top.step,
        top.order,
        np.concatenate([tree.words for tree in trees]),
        np.concatenate(orders),
        np.cumsum([(0, 0), *((len(tree.words), len(tree.order)) for tree in trees)], axis=0),
        np.array([tree.low for tree in trees]),
        np.array([tree.step for tree in trees]),
        *of_instances,
        *map(np.ascontiguousarray, lists),
    )


class NearCasters:
    """The casters of a scene in local coordinates, in trees."""

    def __init__(self, geometry: Geometry) -> None:
        self._geometry, self._building = geometry, Lock()
        self._search: tuple[Casters, CutoutArrays] | None = None

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
                self._search = _casters(geometry), cutout_arrays(geometry.cutouts, geometry.count)
        length = np.minimum(height / receivers.cosine, receivers.distance)
        vectors = (receivers.point, np.broadcast_to(receivers.to_light, (3, count)), eye[:, 0])
        points, to_light, start = map(np.ascontiguousarray, vectors)  # of one type, for which it is compiled
        corners = geometry.corners(receivers.triangle)
        own = receivers.triangle, facet_normals(corners), np.ascontiguousarray(corners[:, 0])
        _find_nearest(*self._search, points, to_light, length, *own, start, distance, covered)
        return distance, covered & np.isinf(distance)


@compiled(error_model="numpy")
def _find_nearest(  # type: ignore[no-untyped-def]
    casters, cut, points, to_light, length, own, own_normals, own_corners, eye, distance, covered
):
    """Fill the distance of each segment's nearest hit, and whether one covers it, by a walk of the trees."""
    point, way, inverse = np.empty(3), np.empty(3), np.empty(3)
    inner, inner_way, inner_inverse = np.empty(3), np.empty(3), np.empty(3)
    world, all_three, normal = np.empty((3, 3)), np.arange(3), np.empty(3)
    corners, through, sides = np.empty((3, 3)), np.empty((3, 3)), np.empty(3)
    for i in range(len(length)):
        for k in range(3):
            point[k], way[k] = points[k, i], to_light[k, i]
            inverse[k] = inverse_of(way[k])
        node = np.int64(0)
        while True:
            node, begin, count = next_leaf(casters.words, node, casters.low, casters.step, point, inverse, length[i])
            if count == 0:
                break
            for instance in casters.order[begin : begin + count]:
                for k in range(3):
                    row = casters.inward[instance, k]
                    inner_way[k] = row[0] * way[0] + row[1] * way[1] + row[2] * way[2]
                    inner[k] = row[0] * point[0] + row[1] * point[1] + row[2] * point[2] + row[3]
                    inner_inverse[k] = inverse_of(inner_way[k])
                source = casters.source[instance]
                words = casters.source_words[casters.ends[source, 0] : casters.ends[source + 1, 0]]
                order = casters.source_order[casters.ends[source, 1] : casters.ends[source + 1, 1]]
                low, step, below = casters.source_low[source], casters.source_step[source], np.int64(0)
                while True:
                    below, first, many = next_leaf(words, below, low, step, inner, inner_inverse, length[i])
                    if many == 0:
                        break
                    for face in order[first : first + many]:
                        caster = casters.first[instance] + face
                        if caster == own[i]:
                            continue
                        _move(casters, instance, face, world)
                        t = hit(world, all_three, point, way, corners, through, sides)
                        if not AT_SURFACE < t < length[i]:
                            continue
                        if not is_opaque_at(cut, caster, sides):
                            continue
                        if _rises(world, own_normals[i], way, own_corners[i]):
                            cross(world[1] - world[0], world[2] - world[0], normal)
                            size = np.sqrt(dot(normal, normal))
                            if _covers(through, point - eye, normal / size if size > 0.0 else normal, corners[0]):
                                covered[i] = True
                            else:
                                distance[i] = min(distance[i], t)


@compiled()
def _move(casters, instance, face, world):  # type: ignore[no-untyped-def]
    """Fill the corners of an instance's face, in the same order of arithmetic as `moved`."""
    for j in range(3):
        place = casters.points[casters.faces[casters.offset[instance] + face, j]]
        x, y, z = place[0], place[1], place[2]
        for matrix in casters.moves[:, instance]:
            x, y, z = (
                x * matrix[0, 0] + y * matrix[0, 1] + z * matrix[0, 2] + matrix[0, 3],
                x * matrix[1, 0] + y * matrix[1, 1] + z * matrix[1, 2] + matrix[1, 3],
                x * matrix[2, 0] + y * matrix[2, 1] + z * matrix[2, 2] + matrix[2, 3],
            )
        world[j, 0], world[j, 1], world[j, 2] = x, y, z


@compiled()
def _covers(through, seen, normal, corner):  # type: ignore[no-untyped-def]
    """Whether a triangle also meets the camera's ray to the point, `seen` from the eye, and lies on the point."""
    sides = np.empty(3)
    for j in range(3):
        sides[j] = dot(through[j], seen)
    return same_sign(sides) and abs(dot(normal, corner)) < COVERING


@compiled()
def _rises(corners, normal, way, base):  # type: ignore[no-untyped-def]
    """Whether a triangle rises above the plane through `base`, on the side that L points to."""
    up = np.sign(dot(normal, way))
    height = -np.inf
    for j in range(3):
        height = max(height, up * dot(normal, corners[j] - base))
    return height > FLAT
