"""Triangles that face a light, and the edges between them, in compiled code: what shadow volumes are extruded from."""

from typing import Any

import numba
import numpy as np
from numpy.typing import NDArray

from shadowbench.compiled import compile_once, compiled
from shadowbench.geometry.topology import Indices, Singles

Weights = NDArray[np.int8]


def cap_weights(vertices: Singles, faces: Indices, light: Singles, both_from: int) -> Weights:
    """(F,) weight of each triangle's cap: 1 if it faces the light, else 0; from index `both_from` on ±1 by its facing.

    vertices: (V, 3); faces: (F, 3) corners; light: unit vector towards it and w = 0, or its position and w = 1.
    """
    compile_once(_compile)
    weights: Weights = _cap_weights(vertices, faces, light, both_from)
    return weights


def wall_weights(vertices: Singles, edges: Indices, light: Singles, both_from: int) -> Weights:
    """(E,) weight of each edge's wall, the sum over its two triangles of ±1, the edge's direction in the triangle.

    That is when the triangle is wound counter-clockwise as seen from the light, whatever its own winding. Before index
    `both_from` only the facing one of two triangles counts, which halves the sum. edges: (E, 4), as in `Surface`.
    """
    compile_once(_compile)
    weights: Weights = _wall_weights(vertices, edges, light, both_from)
    return weights


@numba.njit(inline="always")
def _facing(vertices, light, a, b, c):  # type: ignore[no-untyped-def]
    """1 if the corners a, b, c are counter-clockwise as seen from the light, else −1.

    The determinant is evaluated in float32 in the order of the corners' indices: if the edges of a triangle disagreed
    on its facing, or one with its cap, the volume would not be closed.
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
    x = (uy * vz - uz * vy) * (light[0] - light[3] * vertices[a, 0])
    y = (uz * vx - ux * vz) * (light[1] - light[3] * vertices[a, 1])
    z = (ux * vy - uy * vx) * (light[2] - light[3] * vertices[a, 2])
    return parity if x + y + z > 0 else -parity


@compiled()
def _cap_weights(vertices, faces, light, both_from):  # type: ignore[no-untyped-def]
    weights = np.empty(len(faces), dtype=np.int8)
    for i in range(len(faces)):
        side = _facing(vertices, light, faces[i, 0], faces[i, 1], faces[i, 2])
        weights[i] = side if i >= both_from else max(side, 0)
    return weights


@compiled()
def _wall_weights(vertices, edges, light, both_from):  # type: ignore[no-untyped-def]
    weights = np.empty(len(edges), dtype=np.int8)
    for i in range(len(edges)):
        c, a, b, d = edges[i, 0], edges[i, 1], edges[i, 2], edges[i, 3]
        both = _facing(vertices, light, a, b, c) + (0 if d == a else _facing(vertices, light, a, b, d))
        weights[i] = both if i >= both_from else both // 2
    return weights


def _compile() -> None:
    vertices, light = np.zeros((1, 3), dtype=np.float32), np.zeros(4, dtype=np.float32)
    nothing: Any = np.zeros((0, 4), dtype=np.int64)
    _cap_weights(vertices, nothing[:, :3].copy(), light, 0)
    _wall_weights(vertices, nothing, light, 0)
