"""An order of triangles in which neighbours follow each other, so that few vertices are shaded more than once.

Tipsify (Sander, Nehab and Barczak 2007, "Fast Triangle Reordering for Vertex Locality and Reduced Overdraw"): emits all
triangles around a vertex, then goes on with that neighbour which is oldest in a simulated cache but still in it
afterwards; at a dead end with the last vertex seen that has triangles left, else with the first. Linear in time.
"""

import numpy as np

from shadowbench.compiled import compiled

CACHE = 16  # vertices: the fewest that devices keep; a larger cache still gains more from this order than from others


@compiled()
def _triangles_around(faces, vertices):  # type: ignore[no-untyped-def]
    """The triangles of each vertex, one vertex after the other, and where each vertex's begin."""
    first = np.zeros(vertices + 1, np.int32)
    for i in range(len(faces)):
        for k in range(3):
            first[faces[i, k] + 1] += 1
    for v in range(vertices):
        first[v + 1] += first[v]
    end, around = first[:-1].copy(), np.empty(3 * len(faces), np.int32)
    for i in range(len(faces)):
        for k in range(3):
            around[end[faces[i, k]]] = i
            end[faces[i, k]] += 1
    return first, around


@compiled()
def in_reuse_order(faces):  # type: ignore[no-untyped-def]
    """(F,) int32 order of (F, 3) faces. Parts of other vertices stay in the order of their lowest vertices."""
    vertices = faces.max() + 1 if len(faces) else 0
    first, around = _triangles_around(faces, vertices)
    left = first[1:] - first[:-1]  # triangles of each vertex that are not emitted
    entered, now = np.zeros(vertices, np.int32), CACHE + 1  # times of entry into the cache
    emitted, order, count = np.zeros(len(faces), np.bool_), np.empty(len(faces), np.int32), 0
    seen, top = np.empty(3 * len(faces), np.int32), 0
    lowest, fan = 0, -1
    while True:
        while fan < 0 and top > 0:
            top -= 1
            fan = seen[top] if left[seen[top]] > 0 else -1
        while fan < 0 and lowest < vertices:
            fan = lowest if left[lowest] > 0 else -1
            lowest += 1
        if fan < 0:
            return order
        ring = top
        for i in around[first[fan] : first[fan + 1]]:
            if emitted[i]:
                continue
            emitted[i], order[count] = True, i
            count += 1
            for k in range(3):
                v = faces[i, k]
                seen[top] = v
                top += 1
                left[v] -= 1
                if now - entered[v] > CACHE:
                    entered[v] = now
                    now += 1
        fan, oldest = -1, -1
        for v in seen[ring:top]:
            if left[v] > 0:
                age = now - entered[v]
                age = age if age + 2 * left[v] <= CACHE else 0
                if age > oldest:
                    fan, oldest = v, age


@compiled()
def by_first_use(faces):  # type: ignore[no-untyped-def]
    """(F, 3) faces whose vertices are numbered by their first use, and (N,) the former numbers of these vertices."""
    vertices = faces.max() + 1 if len(faces) else 0
    numbers, former, count = np.full(vertices, -1, np.int32), np.empty(vertices, np.int32), 0
    renumbered = np.empty_like(faces)
    for i in range(len(faces)):
        for k in range(3):
            v = faces[i, k]
            if numbers[v] < 0:
                numbers[v], former[count] = count, v
                count += 1
            renumbered[i, k] = numbers[v]
    return renumbered, former[:count]
