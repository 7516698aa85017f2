"""A bounding volume hierarchy of triangles, as arrays that a shader walks without a stack.

Nodes are in depth-first order, and each has the index of the node that follows its subtree: a walk goes to the next
node if a ray hits the box, else to that one. Nodes are split at the least surface area heuristic of 16 bins along the
longest axis of their triangles' centres (Wald 2007, "On fast construction of SAH-based bounding volume hierarchies").
"""

from dataclasses import dataclass

import numba
import numpy as np
from numpy.typing import NDArray

from shadowbench.compiled import compiled
from shadowbench.scenes.vectors import Floats

BINS = 16
LARGEST_LEAF = 4  # triangles; up to 7 if their centres coincide
LEAF = 1 << 31
_STEPS = 65533  # of the whole box: 16 bits less one step of margin on each side
_PENDING = 32  # subtrees on the builder's stack, from which on nodes are halved by count: so it stays below twice that
_WALK_COST = 2.0  # of a node, in tests of a triangle


@dataclass(frozen=True, eq=False)
class Tree:
    """Nodes of a hierarchy, and `order`, its triangles (F,) in the order of the leaves.

    words: (N, 4), a node's box along x, y and z as lowest | highest << 16, in steps (3,) from `low` (3,); then the
    index of the node after its subtree, or for a leaf LEAF | first triangle << 3 | their number.
    """

    words: NDArray[np.uint32]
    order: NDArray[np.int32]
    low: Floats
    step: Floats


def build_tree(vertices: Floats, faces: NDArray[np.int32]) -> Tree:
    """The tree of (F, 3) faces of (V, 3) vertices, in about linear time."""
    count = len(faces)
    order, boxes = np.arange(count, dtype=np.int32), np.empty((count, 6), dtype=np.float32)
    _bound(vertices, faces, boxes)
    whole = np.concatenate([boxes[:, :3].min(axis=0), boxes[:, 3:].max(axis=0)]) if count else np.zeros(6)
    nodes, links = np.empty((max(2 * count, 1), 6), dtype=np.float32), np.empty((max(2 * count, 1), 2), dtype=np.int64)
    size = _build(boxes, order, nodes, links)
    # Steps are no finer than float32 coordinates, so that the boxes of flat scenes are thicker than their rounding.
    finest = max(float(np.spacing(np.abs(whole).max())), float(np.finfo(np.float32).tiny))
    step = np.maximum((whole[3:] - whole[:3]).astype(np.float64) / _STEPS, finest)
    tree = Tree(np.empty((size, 4), dtype=np.uint32), order, whole[:3] - step, step)
    _pack(nodes, links, tree.low, tree.step, tree.words)
    return tree


@numba.njit(inline="always")
def _grow(box, other):  # type: ignore[no-untyped-def]
    """Extend a box, lowest then highest corner, to contain another."""
    for k in range(3):
        box[k], box[3 + k] = min(box[k], other[k]), max(box[3 + k], other[3 + k])


@numba.njit(inline="always")
def _clear(box):  # type: ignore[no-untyped-def]
    box[:3], box[3:] = np.inf, -np.inf


@numba.njit(inline="always")
def _half_area(box):  # type: ignore[no-untyped-def]
    x, y, z = box[3] - box[0], box[4] - box[1], box[5] - box[2]
    return x * y + y * z + z * x


@compiled()
def _bound(vertices, faces, boxes):  # type: ignore[no-untyped-def]
    for i in range(len(faces)):
        for k in range(3):
            a, b, c = vertices[faces[i, 0], k], vertices[faces[i, 1], k], vertices[faces[i, 2], k]
            boxes[i, k], boxes[i, 3 + k] = min(a, b, c), max(a, b, c)


@compiled(error_model="numpy")
def _build(boxes, order, nodes, links):  # type: ignore[no-untyped-def]
    """Fill nodes and links, (node after the subtree, leaf or −1), sorting boxes and order; returns their number."""
    pending = np.zeros((2 * _PENDING, 2), np.int64)
    pending[0, 1], waiting, count = len(order), 1, 0
    bins, costs, sizes = np.empty((BINS, 6), np.float32), np.empty(BINS, np.float32), np.empty(BINS, np.int64)
    while waiting:
        waiting -= 1
        begin, end = pending[waiting]
        _clear(nodes[count])
        for i in range(begin, end):
            _grow(nodes[count], boxes[i])
        middle = _split(boxes, order, begin, end, waiting >= _PENDING, nodes[count], bins, costs, sizes)
        links[count, 1] = begin << 3 | (end - begin) if middle == begin else -1
        if middle != begin:
            pending[waiting, 0], pending[waiting, 1] = middle, end
            pending[waiting + 1, 0], pending[waiting + 1, 1] = begin, middle
            waiting += 2
        count += 1
    for i in range(count - 1, -1, -1):  # after a leaf the next node; else what follows the second child
        links[i, 0] = i + 1 if links[i, 1] >= 0 else links[links[i + 1, 0], 0]
    return count


@compiled(error_model="numpy")
def _split(boxes, order, begin, end, halve, node, bins, costs, sizes):  # type: ignore[no-untyped-def]
    """Sort a node's triangles into two parts; returns the first of the second part, or `begin` for a leaf."""
    number = end - begin
    axis, low, width = 0, np.float32(0.0), np.float32(0.0)
    for k in range(3):
        lowest, highest = np.float32(np.inf), np.float32(-np.inf)
        for i in range(begin, end):
            center = boxes[i, k] + boxes[i, 3 + k]  # twice
            lowest, highest = min(lowest, center), max(highest, center)
        if highest - lowest > width:
            axis, low, width = k, lowest, highest - lowest
    scale = np.float32(BINS * 0.9999) / width
    if width <= 0.0 or halve or scale == np.inf:
        return begin if number <= 7 else (begin + end) // 2
    sizes[:] = 0
    for b in range(BINS):
        _clear(bins[b])
    for i in range(begin, end):
        b = int((boxes[i, axis] + boxes[i, 3 + axis] - low) * scale)
        sizes[b] += 1
        _grow(bins[b], boxes[i])
    part, inside = np.empty(6, np.float32), 0
    _clear(part)
    for b in range(BINS - 1, 0, -1):
        inside += sizes[b]
        _grow(part, bins[b])
        costs[b] = inside * _half_area(part)
    _clear(part)
    inside, best, cut = 0, np.float32(np.inf), 0
    for b in range(BINS - 1):
        inside += sizes[b]
        _grow(part, bins[b])
        if 0 < inside < number:
            cost = inside * _half_area(part) + costs[b + 1]
            if cost < best:
                best, cut = cost, b
    if number <= LARGEST_LEAF and best >= (number - _WALK_COST) * _half_area(node):
        return begin
    first, last = begin, end - 1
    while first <= last:
        if int((boxes[first, axis] + boxes[first, 3 + axis] - low) * scale) <= cut:
            first += 1
            continue
        for k in range(6):
            boxes[first, k], boxes[last, k] = boxes[last, k], boxes[first, k]
        order[first], order[last] = order[last], order[first]
        last -= 1
    return first


@compiled()
def _pack(nodes, links, low, step, words):  # type: ignore[no-untyped-def]
    margin = 0.1  # of a step: exceeds the rounding of what a ray computes
    for i in range(len(words)):
        for k in range(3):
            lowest = np.floor((nodes[i, k] - low[k]) / step[k] - margin)
            highest = np.ceil((nodes[i, 3 + k] - low[k]) / step[k] + margin)
            words[i, k] = np.uint32(max(lowest, 0.0)) | np.uint32(min(highest, 65535.0)) << np.uint32(16)
        words[i, 3] = np.uint32(links[i, 0]) if links[i, 1] < 0 else np.uint32(LEAF | links[i, 1])
