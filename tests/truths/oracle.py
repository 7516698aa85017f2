"""A brute-force truth in float64: every triangle against every ray, with exact fractions where float64 is in doubt.

No tree, no float32, no offset, nothing of the tracer: the receiver is the triangle that the pixel's ray meets first, P
the point where it does, and P is in shadow where another caster meets the segment from P to the light. P itself is no
part of the segment, so that a triangle in the receiver's own plane never blocks.
"""

from fractions import Fraction
from typing import NamedTuple

import numpy as np

from shadowbench.compiled import compiled
from shadowbench.scenes.model import View
from shadowbench.scenes.triangles import Geometry
from shadowbench.scenes.vectors import Floats

AT_ONCE = 256  # triangles, whose edges stay in the processor's cache
PAIRS_PER_RAY = 64  # at first; the search is repeated where there are more
DOUBT = 1e-12  # of the lengths that enter a sign; rounding is a thousandth of it


class Crossings(NamedTuple):
    """All pairs of a ray and a triangle that it goes through or may go through: (K,) each, sorted by ray, then t.

    t: in lengths of the ray. sure: whether it goes through the triangle, and not at its origin, whatever is rounded.
    """

    ray: np.ndarray
    triangle: np.ndarray
    t: Floats
    sure: np.ndarray


def crossings(origins: Floats, directions: Floats, geometry: Geometry, faces: np.ndarray, about: Floats) -> Crossings:
    """By Plücker coordinates: a line goes through a triangle when it passes all three edges on the same side.

    directions: (N, 3) unit; about: (3,) the point that coordinates are taken from; one that all rays pass through costs
    no digits. Rays that may run within a triangle's plane go through it at t = 0, unsurely.
    """
    extent = np.linalg.norm(geometry.bounds[1] - geometry.bounds[0])
    origins = origins - about
    lines = np.hstack([directions, np.cross(origins, directions)])
    corners = [geometry.vertices[faces[:, k]] - about for k in range(3)]
    ends = zip(corners, corners[1:] + corners[:1], strict=True)
    edges = np.stack([np.hstack([np.cross(a, b - a), b - a]).T for a, b in ends])
    edges /= np.maximum(np.linalg.norm(edges, axis=1, keepdims=True), 1e-300)
    ray, triangle, through = _pairs(lines, DOUBT * np.linalg.norm(lines, axis=1), edges)
    a, b, c = (corner[triangle] for corner in corners)
    normal = np.cross(b - a, c - a)
    normal /= np.maximum(np.linalg.norm(normal, axis=1), 1e-300)[:, None]
    toward = (normal * directions[ray]).sum(axis=1)
    height = (normal * (a - origins[ray])).sum(axis=1)
    t = np.divide(height, toward, out=np.zeros(len(ray)), where=np.abs(toward) > DOUBT)
    sure = through & (np.abs(height) > DOUBT * extent) & (np.abs(toward) > DOUBT)
    order = np.lexsort((t, ray))
    return Crossings(ray[order], triangle[order], t[order], sure[order])


def _pairs(lines: Floats, rounding: Floats, edges: Floats) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(K,) lines and the triangles that they go through or may go through, and whether they do, whatever is rounded.

    lines: (N, 6); rounding: (N,); edges: (3, 6, T), Plücker coordinates.
    """
    room = PAIRS_PER_RAY * len(lines)
    while True:
        ray, triangle, through = np.empty(room, np.intp), np.empty(room, np.intp), np.empty(room, np.bool_)
        found = _search(lines, rounding, edges, ray, triangle, through)
        if found <= room:
            return ray[:found], triangle[:found], through[:found]
        room = found


@compiled()
def _search(lines, rounding, edges, ray, triangle, through):
    """Fill in the pairs as far as there is room; their number."""
    found, count = 0, edges.shape[2]
    low, high = np.empty(AT_ONCE), np.empty(AT_ONCE)
    for start in range(0, count, AT_ONCE):
        several = min(AT_ONCE, count - start)
        for i in range(len(lines)):
            low[:], high[:] = np.inf, -np.inf
            x, y, z, mx, my, mz = lines[i]
            for e in range(3):
                for k in range(several):
                    at = start + k
                    side = x * edges[e, 0, at] + y * edges[e, 1, at] + z * edges[e, 2, at]
                    side += mx * edges[e, 3, at] + my * edges[e, 4, at] + mz * edges[e, 5, at]
                    low[k], high[k] = min(low[k], side), max(high[k], side)
            for k in range(several):
                if low[k] >= -rounding[i] or high[k] <= rounding[i]:
                    if found < len(ray):
                        ray[found], triangle[found] = i, start + k
                        through[found] = low[k] > rounding[i] or high[k] < -rounding[i]
                    found += 1
    return found


def answers(view: View, starts: Floats, directions: Floats) -> tuple[np.ndarray, np.ndarray]:
    """(N,) whether each of the camera's rays shows a receiver, and whether it is lit; (N, 3) starts and directions."""
    geometry, light = view.scene.geometry, view.light
    hit, triangle, t = first_hits(view, starts, directions)
    points = starts[hit] + directions[hit] * t[:, None]
    position, w = light.homogeneous
    to_light = position - w * points
    distance = np.linalg.norm(to_light, axis=1)
    to_light /= distance[:, None]
    normal = geometry.normals[triangle]
    normal = normal * -np.sign((normal * directions[hit]).sum(axis=1))[:, None]
    faces_light = (normal * to_light).sum(axis=1) > 0
    if light.kind == "spot":
        faces_light &= -(to_light @ light.direction) >= light.cos_half_angle * np.linalg.norm(light.direction)
    receiver = np.zeros(len(directions), dtype=bool)
    receiver[hit] = faces_light & geometry.receives[triangle]

    caster_of = np.flatnonzero(geometry.casts)
    about = np.array(position) if w else points.mean(axis=0)
    found = crossings(points, to_light, geometry, geometry.faces[caster_of], about)
    found = opaque_ones(found, geometry, caster_of, points, to_light)
    caster = caster_of[found.triangle]
    extent = np.linalg.norm(geometry.bounds[1] - geometry.bounds[0])
    left = (distance if w else np.full(len(hit), np.inf))[found.ray] - found.t
    blocks = found.sure & (found.t > 0) & (left > DOUBT * extent) & (caster != triangle[found.ray])
    may = ~found.sure | (np.abs(left) <= DOUBT * extent)
    blocked = np.zeros(len(hit), dtype=bool)
    blocked[found.ray[blocks]] = True
    may &= ~blocked[found.ray] & (caster != triangle[found.ray])
    for k in np.flatnonzero(may):
        ray = found.ray[k]
        blocked[ray] |= blocks_exactly(view, starts[hit[ray]], directions[hit[ray]], triangle[ray], caster[k])
    lit = np.ones(len(directions), dtype=bool)
    lit[hit[blocked]] = False
    return receiver, lit | ~receiver


def opaque_ones(
    found: Crossings, geometry: Geometry, triangles: np.ndarray, origins: Floats, directions: Floats
) -> Crossings:
    """The crossings without those of what is cut out; triangles: (T,) indices in the scene of those asked for."""
    if geometry.cutouts is None:
        return found
    index = np.full(len(geometry.faces), -1)
    index[geometry.cutouts.faces] = np.arange(len(geometry.cutouts.faces))
    cut = index[triangles[found.triangle]]
    asked = np.flatnonzero(cut >= 0)
    ray = found.ray[asked]
    point = origins[ray] + directions[ray] * found.t[asked, None]
    a, b, c = np.moveaxis(geometry.vertices[geometry.faces[triangles[found.triangle[asked]]]], 1, 0)
    whole = np.cross(b - a, c - a)
    areas = [(np.cross(q - p, point - p) * whole).sum(axis=1) for p, q in ((b, c), (c, a), (a, b))]
    weights = np.stack(areas, axis=1) / (whole**2).sum(axis=1)[:, None]
    kept = np.ones(len(found.ray), dtype=bool)
    kept[asked] = geometry.cutouts.opaque(cut[asked], weights)
    return Crossings(*(values[kept] for values in found))


def first_hits(view: View, starts: Floats, directions: Floats) -> tuple[np.ndarray, np.ndarray, Floats]:
    """(H,) the camera's rays that meet a triangle between the camera's planes, the first they meet, and t."""
    geometry = view.scene.geometry
    lengths = np.linalg.norm(directions, axis=1)
    near, far = view.near_far
    ways = directions / lengths[:, None]
    found = crossings(starts, ways, geometry, geometry.faces, starts[0])
    found = opaque_ones(found, geometry, np.arange(len(geometry.faces)), starts, ways)
    t = found.t / lengths[found.ray]
    seen = np.flatnonzero((t >= near) & (t <= far))
    hit, first = np.unique(found.ray[seen], return_index=True)
    chosen = seen[first]
    margin = DOUBT * np.linalg.norm(geometry.bounds[1] - geometry.bounds[0])
    for k, start in enumerate(first):
        rivals = seen[start : first[k + 1] if k + 1 < len(first) else None]
        if found.sure[rivals[0]] and (len(rivals) == 1 or t[rivals[1]] > t[rivals[0]] + margin):
            continue
        inside, origin, direction = [], exact(starts[hit[k]]), exact(directions[hit[k]])
        for rival in rivals:
            corners = corners_of(view, found.triangle[rival])
            s = to_plane(origin, direction, corners)
            if s and in_triangle(origin + direction * s, corners):
                inside.append((s, rival))
        chosen[k] = min(inside)[1] if inside else -1
    kept = chosen >= 0
    return hit[kept], found.triangle[chosen[kept]], t[chosen[kept]]


def exact(values: Floats) -> np.ndarray:
    """Vectors of fractions, exactly equal to vectors of floats."""
    return np.vectorize(lambda value: Fraction(float(value)), otypes=[object])(values)


def corners_of(view: View, triangle: int) -> np.ndarray:
    return exact(view.scene.geometry.vertices[view.scene.geometry.faces[triangle]])


def to_plane(origin: np.ndarray, direction: np.ndarray, corners: np.ndarray) -> Fraction | None:
    """How far along a ray lies a triangle's plane, None where the ray runs within or beside it."""
    a, b, c = corners
    normal = np.cross(b - a, c - a)
    toward = normal @ direction
    return normal @ (a - origin) / toward if toward else None


def in_triangle(point: np.ndarray, corners: np.ndarray) -> bool:
    """Whether a point of a triangle's plane lies within it or on its border."""
    a, b, c = corners
    normal = np.cross(b - a, c - a)
    return min(normal @ np.cross(q - p, point - p) for p, q in ((a, b), (b, c), (c, a))) >= 0


def blocks_exactly(view: View, start: Floats, direction: Floats, receiver: int, caster: int) -> bool:
    """Whether a caster meets the open segment from where a ray meets the receiver's plane to the light."""
    origin, ray = exact(start), exact(direction)
    point = origin + ray * to_plane(origin, ray, corners_of(view, receiver))
    light, corners = view.light, corners_of(view, caster)
    to_light = -exact(light.direction) if light.kind == "directional" else exact(light.position) - point
    s = to_plane(point, to_light, corners)
    if s is None or s <= 0 or (light.kind != "directional" and s >= 1):
        return False
    return in_triangle(point + to_light * s, corners)
