"""Triangles that face a light, and the edges between them, in compiled code: what shadow volumes are extruded from."""

import numba
import numpy as np

from shadowbench.compiled import compiled

IN_PLANE = 1e-13  # of the terms of the determinant: rounding, of a light in the plane of a triangle


@numba.njit(inline="always")
def _facing(vertices, light, a, b, c, in_plane):  # type: ignore[no-untyped-def]
    """1 if the corners a, b, c are counter-clockwise as seen from the light, −1 if clockwise, `in_plane` for neither.

    The determinant is evaluated in the order of the corners' indices: if the edges of a triangle disagreed on its
    facing, or one with its cap, the volume would not be closed. 0 for a lamp at a corner, which leaves no volume.
    """
    parity = 1
    if b < a:
        a, b, parity = b, a, -parity
    if c < b:
        b, c, parity = c, b, -parity
    if b < a:
        a, b, parity = b, a, -parity
    ux, uy, uz = vertices[b, 0] - vertices[a, 0], vertices[b, 1] - vertices[a, 1], vertices[b, 2] - vertices[a, 2]
    vx, vy, vz = vertices[c, 0] - vertices[a, 0], vertices[c, 1] - vertices[a, 1], vertices[c, 2] - vertices[a, 2]
    nx, ny, nz = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
    x, y, z = light[3] * vertices[a, 0], light[3] * vertices[a, 1], light[3] * vertices[a, 2]
    volume = nx * (light[0] - x) + ny * (light[1] - y) + nz * (light[2] - z)
    terms = abs(nx) * (abs(light[0]) + abs(x)) + abs(ny) * (abs(light[1]) + abs(y)) + abs(nz) * (abs(light[2]) + abs(z))
    if abs(volume) > IN_PLANE * terms:
        return parity if volume > 0 else -parity
    if light[3] != 0:
        for corner in (a, b, c):
            apart, size = 0.0, 0.0
            for k in range(3):
                apart += abs(vertices[corner, k] - light[k])
                size += abs(light[k])
            if apart <= IN_PLANE * size:
                return 0
    return in_plane


@compiled()
def cap_weights(vertices, faces, light, both_from, closed):  # type: ignore[no-untyped-def]
    """(F,) int8 weight of each triangle's cap: 1 if it faces the light, else 0; from index `both_from` on ±1.

    A light in the plane of a triangle is behind it if it is of a closed part, before index `closed`: as in the truth, a
    lamp on a face is in shadow. Other such triangles are edge-on and have no cap. vertices: (V, 3); faces: (F, 3) int64
    corners; light: unit vector towards it and w = 0, or its position and w = 1.
    """
    weights = np.empty(len(faces), dtype=np.int8)
    for i in range(len(faces)):
        side = _facing(vertices, light, faces[i, 0], faces[i, 1], faces[i, 2], -1 if i < closed else 0)
        weights[i] = side if i >= both_from else max(side, 0)
    return weights


@compiled()
def wall_weights(vertices, edges, light, both_from, closed):  # type: ignore[no-untyped-def]
    """(E,) int8 weight of each edge's wall, the sum over its two triangles of ±1, the edge's direction in the triangle.

    That is when the triangle is wound counter-clockwise as seen from the light, whatever its own winding. Before index
    `both_from` only the facing one of two triangles counts, which halves the sum. edges: (E, 4), as in `Casters`; the
    rest as of `cap_weights`.
    """
    weights = np.empty(len(edges), dtype=np.int8)
    for i in range(len(edges)):
        c, a, b, d = edges[i, 0], edges[i, 1], edges[i, 2], edges[i, 3]
        behind = 1 if i < closed else 0  # in a closed part, c's triangle is wound b → a, and d's a → b
        one = _facing(vertices, light, a, b, c, behind)
        other = 0 if d == a else _facing(vertices, light, a, b, d, -behind)
        weights[i] = one + other if i >= both_from else max(other, 0) + min(one, 0)
    return weights
