"""Where a ray passes through cut-outs: decided within the error of float32, or in float64 along the whole ray.

Embree asks the filter (`cutout_filter`) about every hit of a cut-out triangle. A hit so close to the edge of what is
opaque that float32 may put it on either side is passed through, and its ray is flagged; `resolve` then follows that ray
in float64. Left open is what changes with the rounding of texture coordinates and of their mixing in float32, in which
techniques compute.
"""

from typing import Literal, NamedTuple

import numba
import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter, minimum_filter

from shadowbench.compiled import compiled
from shadowbench.geometry.tree import Tree
from shadowbench.scenes.cutouts import Cutout, CutoutFaces, Wrap
from shadowbench.scenes.vectors import Floats
from shadowbench.truths.segments import hit, inverse_of, next_leaf

CLEAR, OPAQUE, OPEN = range(3)
ROUNDING = 2.0**-22  # of a texture coordinate, as a share, and of what is mixed in float32
_REPEAT, _MIRROR, _CLAMP = range(3)  # in `scenes.cutouts.WRAPS`
_MODES: dict[Wrap, Literal["wrap", "reflect", "nearest"]] = {
    "repeat": "wrap",
    "mirror": "reflect",
    "clamp": "nearest",
}  # SciPy's names


class CutoutArrays(NamedTuple):
    """What decides where the triangles of a list of faces are opaque, for compiled code.

    of: (F,) int32 index of a face among the cut-out ones, −1 for others, or empty without cut-outs; coordinates, alpha,
    number, texels, table, least: see `CutoutFaces` and `PackedCutouts`; stretch: (K, 3) float32 change of u and v in
    texels and of vertex alpha per local length, at most.

    For a first look in float32: places: (K, 6) float32 column of a triangle's first corner in texels, and its change to
    the second and the third, then the row's; counted from the first texel's corner, or for bilinear ones from its
    centre; NaN where vertex alpha is not 1. around: (N,) uint8 of each texel: OPAQUE or CLEAR if points are that are at
    most a texel away from it, or for bilinear ones from the square between it and the texels right of and below it.
    """

    of: NDArray[np.int32]
    coordinates: NDArray[np.float32]
    alpha: NDArray[np.float32]
    number: NDArray[np.int32]
    stretch: NDArray[np.float32]
    texels: NDArray[np.uint8]
    around: NDArray[np.uint8]
    table: NDArray[np.int32]
    least: Floats
    places: NDArray[np.float32]


NO_CUTOUTS = CutoutArrays(
    np.empty(0, np.int32),
    np.empty((0, 3, 2), np.float32),
    np.empty((0, 3), np.float32),
    np.empty(0, np.int32),
    np.empty((0, 3), np.float32),
    np.empty(0, np.uint8),
    np.empty(0, np.uint8),
    np.empty((0, 6), np.int32),
    np.empty(0),
    np.empty((0, 6), np.float32),
)


def cutout_arrays(cutouts: CutoutFaces | None, vertices: Floats, faces: NDArray[np.int32]) -> CutoutArrays:
    """The arrays of the cut-out triangles among (F, 3) faces of (V, 3) local vertices."""
    if cutouts is None:
        return NO_CUTOUTS
    of = np.full(len(faces), -1, dtype=np.int32)
    of[cutouts.faces] = np.arange(len(cutouts.faces))
    texels, table, least = cutouts.packed
    scaled = cutouts.coordinates * table[cutouts.number, None, 1:3].astype(np.float64)
    values = np.concatenate([scaled, cutouts.alpha[:, :, None]], axis=2)
    stretch = _gradients(vertices[faces[cutouts.faces]], values).astype(np.float32)
    scaled -= np.where(table[cutouts.number, 3], 0.0, 0.5)[:, None, None]
    scaled[(cutouts.alpha != 1.0).any(axis=1)] = np.nan
    scaled[:, 1:] -= scaled[:, :1]
    places = scaled.transpose(0, 2, 1).reshape(-1, 6).astype(np.float32)
    coordinates, alpha = map(np.ascontiguousarray, (cutouts.coordinates, cutouts.alpha))
    around = np.concatenate([_around(cutout).ravel() for cutout in cutouts.cutouts])
    return CutoutArrays(of, coordinates, alpha, cutouts.number, stretch, texels, around, table, least, places)


def _around(cutout: Cutout) -> NDArray[np.uint8]:
    """(H, W) see `CutoutArrays.around`."""
    # Of a mirrored square, the other texels are left and above.
    size, first = (3, 0) if cutout.nearest else (5, 0) if "mirror" in cutout.wrap else (4, -1)
    modes = [_MODES[wrap] for wrap in cutout.wrap[::-1]]
    low, high = (each(cutout.alpha, size, mode=modes, origin=first) for each in (minimum_filter, maximum_filter))
    mixing = 0.0 if cutout.nearest else 255 * 4 * ROUNDING
    found = np.where(low - mixing >= cutout.least, OPAQUE, np.where(high + mixing < cutout.least, CLEAR, OPEN))
    return found.astype(np.uint8)


def _gradients(corners: Floats, values: Floats) -> Floats:
    """(K, n) lengths of the gradients of (K, 3, n) values at (K, 3, 3) corners, linear across each triangle."""
    one, two = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    by_one, by_two = values[:, 1] - values[:, 0], values[:, 2] - values[:, 0]
    a, b, c = (np.einsum("ij,ij->i", *pair)[:, None] for pair in ((one, one), (one, two), (two, two)))
    squared = (by_one**2 * c - 2 * by_one * by_two * b + by_two**2 * a) / np.maximum(
        a * c - b * b, np.finfo(float).tiny
    )
    lengths: Floats = np.sqrt(np.maximum(squared, 0.0))
    return lengths


@numba.njit(inline="always")
def wrapped(index, size, wrap):  # type: ignore[no-untyped-def]
    """See `scenes.cutouts.wrapped`."""
    if wrap == _CLAMP:
        return min(max(index, 0), size - 1)
    if wrap == _MIRROR:
        index %= 2 * size
        return min(index, 2 * size - 1 - index)
    return index % size


@compiled()
def _texel(cut, number, column, row):  # type: ignore[no-untyped-def]
    table = cut.table[number]
    x, y = wrapped(np.int64(column), table[1], table[4]), wrapped(np.int64(row), table[2], table[5])
    return np.float64(cut.texels[np.int64(table[0]) + np.int64(y) * table[1] + x])


@compiled()
def _bilinear(cut, number, x, y):  # type: ignore[no-untyped-def]
    """α₈ at a place in texels from the centre of the first."""
    column, row = np.floor(x), np.floor(y)
    right, down = x - column, y - row
    above = _texel(cut, number, column, row) * (1 - right) + _texel(cut, number, column + 1, row) * right
    below = _texel(cut, number, column, row + 1) * (1 - right) + _texel(cut, number, column + 1, row + 1) * right
    return above * (1 - down) + below * down


@compiled()
def _range_of(cut, number, x, y, dx, dy):  # type: ignore[no-untyped-def]
    """Lowest and highest α₈ within a box of half-widths below half a texel around a place in texels."""
    nearest = cut.table[number, 3] != 0
    if not nearest:
        x, y = x - 0.5, y - 0.5
    low, high = np.inf, -np.inf
    for i in range(3):  # bilinear alphas are extreme in corners of the box, or of its parts in each cell
        for j in range(3):
            px, py = _end(x, dx, i), _end(y, dy, j)
            value = _texel(cut, number, np.floor(px), np.floor(py)) if nearest else _bilinear(cut, number, px, py)
            low, high = min(low, value), max(high, value)
    return low, high


@numba.njit(inline="always")
def _end(place, width, which):  # type: ignore[no-untyped-def]
    """Lower and upper end of an interval, and the border of cells inside it if there is one."""
    if which == 0:
        return place - width
    border = np.floor(place + width)
    return place + width if which == 1 or border < place - width else border


@compiled()
def decide(cut, index, second, third, away):  # type: ignore[no-untyped-def]
    """CLEAR, OPAQUE or OPEN at a point of a cut-out triangle.

    cut: CutoutArrays; index: among the cut-out triangles; second, third: barycentric weights of these corners; away:
    local length in the triangle's plane by which the point may be off.
    """
    corners, vertex, number, first = cut.coordinates[index], cut.alpha[index], cut.number[index], 1.0 - second - third
    x = (first * corners[0, 0] + second * corners[1, 0] + third * corners[2, 0]) * cut.table[number, 1]
    y = (first * corners[0, 1] + second * corners[1, 1] + third * corners[2, 1]) * cut.table[number, 2]
    alpha = vertex[0] + second * (vertex[1] - vertex[0]) + third * (vertex[2] - vertex[0])  # if equal, exactly they
    dx = away * cut.stretch[index, 0] + ROUNDING * (1.0 + abs(x))
    dy = away * cut.stretch[index, 1] + ROUNDING * (1.0 + abs(y))
    if max(dx, dy) > 0.5:
        return OPEN
    spread = away * cut.stretch[index, 2]
    if vertex[0] != vertex[1] or vertex[0] != vertex[2]:
        spread += ROUNDING
    low, high = _range_of(cut, number, x, y, dx, dy)
    mixing = 0.0 if low == high and cut.table[number, 3] != 0 else 255.0 * ROUNDING
    if max(low - mixing, 0.0) * max(alpha - spread, 0.0) >= cut.least[number]:
        return OPAQUE
    return CLEAR if (high + mixing) * (alpha + spread) < cut.least[number] else OPEN


@compiled(error_model="numpy")
def decide_at(cut, face, sides):  # type: ignore[no-untyped-def]
    """As `decide`, exactly, where a line meets a face; OPAQUE if that is not cut out. sides: of `segments.hit`."""
    if len(cut.of) == 0 or cut.of[face] < 0:
        return OPAQUE
    whole = sides[0] + sides[1] + sides[2]
    return decide(cut, cut.of[face], sides[1] / whole, sides[2] / whole, 0.0)


def resolve(
    tree: Tree, vertices: Floats, faces: NDArray[np.int32], cut: CutoutArrays, origins: Floats, directions: Floats,
    reach: Floats, any_hit: bool,
) -> tuple[NDArray[np.int32], Floats, NDArray[np.bool_]]:  # fmt: skip
    """(N,) nearest opaque triangle along each ray, −1 if none; its distance, else reach; whether an open hit is nearer.

    tree: of the faces; origins, directions: (3, N); reach: (N,); any_hit: any opaque triangle will do.
    """
    count = len(reach)
    triangle, distance, left_open = np.empty(count, np.int32), np.array(reach, np.float64), np.empty(count, np.bool_)
    rays = np.ascontiguousarray(origins, np.float64), np.ascontiguousarray(directions, np.float64)
    scene = tree.words, tree.low, tree.step, np.ascontiguousarray(vertices), np.ascontiguousarray(faces), tree.order
    _resolve(*scene, cut, *rays, any_hit, triangle, distance, left_open)
    return triangle, distance, left_open


@compiled(error_model="numpy")
def _resolve(  # type: ignore[no-untyped-def]
    words, low, step, vertices, faces, order, cut, origins, directions, any_hit, triangle, distance, left_open
):
    point, way, inverse = np.empty(3), np.empty(3), np.empty(3)
    corners, through, sides = np.empty((3, 3)), np.empty((3, 3)), np.empty(3)
    for i in range(len(distance)):
        for k in range(3):
            point[k], way[k] = origins[k, i], directions[k, i]
            inverse[k] = inverse_of(way[k])
        node, found, doubtful = np.int64(0), np.int32(-1), np.inf
        while not (any_hit and found >= 0):
            node, first, count = next_leaf(words, node, low, step, point, inverse, distance[i])
            if count == 0:
                break
            for place in range(first, first + count):
                face = order[place]
                t = hit(vertices, faces[face], point, way, corners, through, sides)
                if not 0.0 < t < distance[i]:
                    continue
                answer = decide_at(cut, face, sides)
                if answer == OPAQUE:
                    found, distance[i] = face, t
                elif answer == OPEN:
                    doubtful = min(doubtful, t)
        triangle[i], left_open[i] = found, doubtful < distance[i]
