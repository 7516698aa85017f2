"""Segments against triangles and the boxes of a tree's nodes, in float64."""

import numpy as np

from shadowbench.compiled import compiled
from shadowbench.geometry.tree import LEAF

LEAST = 1e-30  # of a direction's part along an axis, which is divided by


@compiled()
def inverse_of(part):  # type: ignore[no-untyped-def]
    """The inverse of a direction's part along an axis, finite also for 0."""
    return 1.0 / part if abs(part) > LEAST else 1.0 / LEAST


@compiled(error_model="numpy")
def hit(vertices, face, point, way, corners, through, sides):  # type: ignore[no-untyped-def]
    """How far along a line from a point a triangle is met, −1 if it is not.

    Fills its corners as seen from the point, the planes through the point and its edges, and the line's side of them.
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
    """Walks a tree's nodes from one on to the next leaf whose box a segment meets.

    Returns the node after that leaf, the first of its triangles in the tree's order, and their number, 0 at the end.
    """
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
