"""Visibility of a light without a size: one shadow ray per sample, and tests of what that ray cannot decide.

A pixel is undecided if its visibility changes within the rasteriser's subpixel grid or with the shadow ray's offset δ.
A shadow ray that starts δ above the surface skips a segment of length δ/(N·L), which is long for grazing light; in
float32 Embree cannot start lower. For N·L below LOW_LIGHT that segment is tested in float64, by a tree. Above it, a
receiver counts as lit even if a caster lower than δ/4 above its plane, at most 2.5 δ along L, blocks it.
"""

from functools import cached_property, partial
from itertools import product
from threading import Lock
from typing import Any

import numpy as np
from numpy.typing import NDArray

from shadowbench.compiled import compiled
from shadowbench.geometry.tree import LEAF, Tree, build_tree
from shadowbench.scenes.triangles import Geometry, facet_normals
from shadowbench.scenes.vectors import Floats
from shadowbench.truths.embree import over_rows
from shadowbench.truths.packets import CutoutArrays, cutout_arrays, is_opaque_at
from shadowbench.truths.rays import GRAZING, LOW_LIGHT, SUBPIXEL_OFFSETS, Indices, Mask, Receivers, ShadowRays, ViewRays

LAMP_MARGIN = 1e-3  # share of δ: a caster this close to a lamp may be before or behind it
NO_RECEIVER, SHADOWED, LIT = range(3)
AT_SURFACE = 1e-9  # local length along L below which a hit is rounding, on a triangle in the receiver's own plane
FLAT = 1e-14  # local height above the receiver's plane below which a triangle counts as lying in it
COVERING = 2.0**-22  # local distance within which float32 may confuse two surfaces on top of each other
LEAST = 1e-30  # of a direction's part along an axis, which is divided by


def hard_shadows(
    rays: ViewRays, geometry: Geometry, triangle: Indices, delta: float, pixel_samples: int
) -> dict[str, NDArray[Any]]:
    """Truth's per-pixel arrays except `triangle`, flattened, in local lengths; triangle: (pixels,), −1 for a miss."""
    work = partial(_decide, rays, NearCasters(geometry), triangle, delta, pixel_samples)
    parts = list(over_rows(work, rays.size))
    return {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}


def _decide(
    rays: ViewRays, near: "NearCasters", triangle: Indices, delta: float, pixel_samples: int, rows: slice
) -> dict[str, NDArray[Any]]:
    """Truth's per-pixel arrays except `triangle`, for some rows, flattened, in local lengths."""
    triangle = triangle[rows.start * rays.size.width : rows.stop * rays.size.width]
    centres = rays.receivers(rays.camera_rays(rows), triangle)
    shadow_rays = rays.shadow_rays(centres, delta)
    blocked = rays.occluded(shadow_rays)

    steps = (np.arange(pixel_samples) + 0.5) / pixel_samples
    samples = [
        _sample(rays, rows, across, down, delta) for across, down in (*SUBPIXEL_OFFSETS, *product(steps, repeat=2))
    ]
    codes = np.stack([_classify(centres, blocked, len(triangle)), *(code for code, _ in samples)])
    blocker = np.full(len(triangle), np.inf)
    _, blocker[centres.rays[blocked]] = rays.nearest_casters(centres.select(blocked), delta)
    undecided = np.zeros(len(triangle), dtype=bool)
    undecided[centres.rays] = _depends_on_offset(rays, centres, shadow_rays, blocked, delta)

    low = [centres.select(_in_low_light(centres)), *(receivers for _, receivers in samples)]
    sample = np.repeat(np.arange(len(low)), [len(receivers.rays) for receivers in low])
    together = Receivers.concatenate(low)
    distance, covered = near.nearest_blockers(together, 4 * delta, rays.eye)
    hidden = np.isfinite(distance)
    codes[sample[hidden], together.rays[hidden]] = SHADOWED
    centre = sample == 0
    ray = together.rays[centre]
    blocker[ray] = np.minimum(blocker[ray], distance[centre])
    undecided[ray] &= ~hidden[centre]  # the test from the surface itself depends on no offset
    undecided[ray] |= covered[centre] & (codes[0, ray] == LIT)

    undecided[centres.rays] |= (centres.cosine <= GRAZING) | (2 * delta > centres.distance * centres.cosine)
    undecided |= (codes[1:5] != codes[0]).any(axis=0)

    code, inside = codes[0], codes[5:]
    receivers, visible = code != NO_RECEIVER, code != SHADOWED
    counted, seen = (inside != NO_RECEIVER).sum(axis=0), (inside == LIT).sum(axis=0)
    area = np.where(receivers & (counted > 0), seen / np.maximum(counted, 1), visible)
    cosine = np.zeros(len(triangle), dtype=np.float32)
    cosine[centres.rays] = centres.cosine
    return {
        "visibility": visible.astype(np.float32),
        "irradiance": visible.astype(np.float32),
        "standard_error": np.zeros(len(triangle), dtype=np.float32),
        "receivers": receivers,
        "undecided": undecided,
        "area": area.astype(np.float32),
        "blocker": blocker,
        "cosine": cosine,
    }


def _depends_on_offset(
    rays: ViewRays, receivers: Receivers, shadow_rays: ShadowRays, blocked: Mask, delta: float
) -> Mask:
    """(R,) whether visibility changes with another offset of the shadow ray, or an end just before or past the lamp."""
    depends = np.zeros(len(blocked), dtype=bool)
    margin = LAMP_MARGIN * delta + rays.lamp_error(shadow_rays)
    for others in (
        rays.shadow_rays(receivers, 4 * delta),
        rays.shadow_rays(receivers, delta / 4),
        rays.normal_offset_rays(receivers, delta),
    ):
        depends |= rays.occluded(others) != blocked
    for longer in () if rays.directional else (-margin, margin):
        others = shadow_rays._replace(reach=np.maximum(shadow_rays.reach + longer, 0.0))
        depends |= rays.occluded(others) != blocked
    return depends


def _sample(
    rays: ViewRays, rows: slice, across: float, down: float, delta: float
) -> tuple[NDArray[np.uint8], Receivers]:
    """Class of one sample of each pixel of some rows, flattened, and the unblocked receivers in low light."""
    lines = rays.camera_rays(rows, across, down)
    hit = rays.nearest(lines)
    receivers = rays.receivers(lines, hit)
    blocked = rays.occluded(rays.shadow_rays(receivers, delta))
    return _classify(receivers, blocked, len(hit)), receivers.select(_in_low_light(receivers) & ~blocked)


def _in_low_light(receivers: Receivers) -> Mask:
    low: Mask = (receivers.cosine > GRAZING) & (receivers.cosine < LOW_LIGHT)
    return low


def _classify(receivers: Receivers, blocked: Mask, count: int) -> NDArray[np.uint8]:
    """(count,) class of each ray: NO_RECEIVER, SHADOWED or LIT."""
    code = np.full(count, NO_RECEIVER, dtype=np.uint8)
    code[receivers.rays] = np.where(blocked, np.uint8(SHADOWED), np.uint8(LIT))
    return code


class NearCasters:
    """The casters of a scene in local coordinates, in a tree."""

    def __init__(self, geometry: Geometry) -> None:
        self._geometry, self._building = geometry, Lock()

    @cached_property
    def _search(self) -> tuple[Tree, CutoutArrays]:
        tree = build_tree(self._geometry.vertices, self._geometry.caster_faces)
        return tree, cutout_arrays(self._geometry.cutouts, self._geometry.count)

    def nearest_blockers(self, receivers: Receivers, height: float, eye: Floats) -> tuple[Floats, Mask]:
        """(N,) distance along L to the nearest caster up to `height` above each receiver's plane, inf if none; covered.

        Covered are receivers on which a blocker lies so closely that from `eye`, (4,) as `Camera.eye`, float32
        may show it instead.
        """
        count, geometry = len(receivers.triangle), self._geometry
        distance, covered = np.full(count, np.inf), np.zeros(count, dtype=bool)
        if not count:
            return distance, covered
        with self._building:  # by the first thread that needs it: few views have grazing light
            tree, cut = self._search
        casters = geometry.vertices, geometry.faces, np.flatnonzero(geometry.casts)[tree.order]
        length = np.minimum(height / receivers.cosine, receivers.distance)
        vectors = (receivers.point, np.broadcast_to(receivers.to_light, (3, count)), eye)
        points, to_light, start = (
            np.require(each, requirements=["C", "W"]) for each in vectors
        )  # of one type, to compile once
        corners = geometry.corners(receivers.triangle)
        own = receivers.triangle, facet_normals(corners), np.ascontiguousarray(corners[:, 0])
        segments = points, to_light, length, *own, start
        find_nearest(tree.words, tree.low, tree.step, *casters, cut, *segments, distance, covered)
        return distance, covered & np.isinf(distance)


@compiled(error_model="numpy")
def find_nearest(  # type: ignore[no-untyped-def]
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
                if not AT_SURFACE < t < length[i] or not is_opaque_at(cut, caster, sides):
                    continue
                up, height = np.sign(dot(own_normals[i], way)), -np.inf
                for j in range(3):
                    height = max(height, up * dot(own_normals[i], vertices[face[j]] - own_corners[i]))
                if height <= FLAT:
                    continue
                cross(vertices[face[1]] - vertices[face[0]], vertices[face[2]] - vertices[face[0]], normal)
                size, seen = np.sqrt(dot(normal, normal)), eye[3] * point - eye[:3]
                for j in range(3):
                    sides[j] = dot(through[j], seen)
                # It covers the point if it also meets the camera's ray to the point, and lies on the point.
                if same_sign(sides) and abs(dot(normal / size if size > 0.0 else normal, corners[0])) < COVERING:
                    covered[i] = True
                else:
                    distance[i] = min(distance[i], t)


@compiled()
def inverse_of(part):  # type: ignore[no-untyped-def]
    """The inverse of a direction's part along an axis, finite also for 0."""
    return 1.0 / part if abs(part) > LEAST else 1.0 / LEAST


@compiled(error_model="numpy")
def hit(vertices, face, point, way, corners, through, sides):  # type: ignore[no-untyped-def]
    """How far along a line from a point a triangle is met, −1 if it is not.

    Fills in, seen from the point, its corners, the planes through its edges, and the line's side of these.
    """
    for j in range(3):
        for k in range(3):
            corners[j, k] = vertices[face[j], k] - point[k]
    for j in range(3):
        cross(corners[j - 2], corners[j - 1], through[j])
        sides[j] = dot(through[j], way)
    t = dot(corners[0], through[0]) / (sides[0] + sides[1] + sides[2])
    return t if same_sign(sides) else -1.0


@compiled()
def reaches(word, low, step, point, inverse, length):  # type: ignore[no-untyped-def]
    """Whether a segment meets a node's box, widened by a step, since boxes are of rounded vertices."""
    enter, leave = 0.0, length
    for k in range(3):
        lowest = low[k] + (np.float64(word[k] & 0xFFFF) - 1.0) * step[k] - point[k]
        highest = low[k] + (np.float64(word[k] >> 16) + 1.0) * step[k] - point[k]
        enter = max(enter, min(lowest * inverse[k], highest * inverse[k]))
        leave = min(leave, max(lowest * inverse[k], highest * inverse[k]))
    return enter <= leave


@compiled()
def next_leaf(words, node, low, step, point, inverse, length):  # type: ignore[no-untyped-def]
    """The node after the next leaf whose box a segment meets, and that leaf's first triangle and their number, or 0."""
    while node < len(words):
        link = np.int64(words[node, 3])
        reached = reaches(words[node], low, step, point, inverse, length)
        node = node + 1 if reached or link >= LEAF else link
        if reached and link >= LEAF:
            return node, (link - LEAF) >> 3, link & 7
    return node, np.int64(0), np.int64(0)


@compiled()
def cross(a, b, result):  # type: ignore[no-untyped-def]
    """Fill the cross product of two vectors."""
    for k in range(3):
        result[k] = a[k - 2] * b[k - 1] - a[k - 1] * b[k - 2]


@compiled()
def dot(a, b):  # type: ignore[no-untyped-def]
    """The dot product of two vectors."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@compiled()
def same_sign(sides):  # type: ignore[no-untyped-def]
    """Whether the three signed volumes of a line and a triangle's edges agree in sign: the line hits it."""
    return min(sides[0], sides[1], sides[2]) >= 0 or max(sides[0], sides[1], sides[2]) <= 0
