"""The filter function that Embree calls for hits of cut-out triangles, compiled by Numba.

Arrays come as addresses. Most hits are decided at a glance, in float32.
"""

from functools import cache
from typing import Any

import numba
import numpy as np
from numba import carray, types  # type: ignore[attr-defined]
from numba.extending import intrinsic
from numpy.typing import NDArray

from shadowbench.compiled import cached_if_possible, compiled
from shadowbench.truths.cutouts import CLEAR, OPAQUE, OPEN, ROUNDING, CutoutArrays, decide, wrapped

RAY_ERROR = 2.0**-20  # of a hit's place across its ray, per local length of the ray and of coordinates, in float32
FLAGS = 8  # word of 8 bytes, after what Embree may use of a query's context, with the address of the rays' flags
TINY = 1e-30  # of a ray's direction times a triangle's normal, which is divided by


def _make_pointer(context, address, kind):  # type: ignore[no-untyped-def]
    """A pointer to values of a type at an address."""

    def generate(context, builder, signature, arguments):  # type: ignore[no-untyped-def]
        return builder.inttoptr(arguments[0], context.get_value_type(signature.return_type))

    pointer: Any = types.CPointer
    return pointer(kind.dtype)(address, kind), generate


_pointer: Any = intrinsic(_make_pointer)


def addresses_of(cut: CutoutArrays) -> NDArray[np.intp]:
    """Addresses and lengths of the arrays but `of`: the user data of a geometry, which does not own them."""
    return np.array([(array.ctypes.data, len(array)) for array in cut[1:]], dtype=np.intp).ravel()


@numba.njit(inline="always")
def _pointers(data):  # type: ignore[no-untyped-def]
    """The arrays at the addresses of `addresses_of` as pointers, whose indices are not checked."""
    return CutoutArrays(
        _pointer(data[0], types.int32),
        _pointer(data[0], types.float32),
        _pointer(data[2], types.float32),
        _pointer(data[4], types.int32),
        _pointer(data[6], types.float32),
        _pointer(data[8], types.uint8),
        _pointer(data[10], types.uint8),
        _pointer(data[12], types.int32),
        _pointer(data[14], types.float64),
        _pointer(data[16], types.float32),
    )


@compiled()
def _at(data):  # type: ignore[no-untyped-def]
    """The arrays at the addresses of `addresses_of`."""
    of, coordinates, alpha, number, stretch, texels, around, table, least, places = _pointers(data)
    return CutoutArrays(
        carray(of, 0),
        carray(coordinates, (data[1], 3, 2)),
        carray(alpha, (data[3], 3)),
        carray(number, (data[5],)),
        carray(stretch, (data[7], 3)),
        carray(texels, (data[9],)),
        carray(around, (data[11],)),
        carray(table, (data[13], 6)),
        carray(least, (data[15],)),
        carray(places, (data[17], 6)),
    )


@numba.njit(inline="always")
def _of_triangle(cut, index):  # type: ignore[no-untyped-def]
    """What `_glance` needs of a triangle: along u, along v, its cut-out's first texel, whether nearest, and least."""
    p, s, t = 6 * index, 3 * index, 6 * np.int64(cut.number[index])
    u = cut.places[p], cut.places[p + 1], cut.places[p + 2], cut.stretch[s], cut.table[t + 1], cut.table[t + 4]
    v = cut.places[p + 3], cut.places[p + 4], cut.places[p + 5], cut.stretch[s + 1], cut.table[t + 2], cut.table[t + 5]
    return u, v, np.int64(cut.table[t]), cut.table[t + 3] != 0, cut.least[cut.number[index]]


@numba.njit(inline="always")
def _place(axis, second, third, away):  # type: ignore[no-untyped-def]
    """A point's column, that of the texture or −1, its part in it, and by how much it may be off; or so of rows."""
    start, to_second, to_third, stretch, size, wrap = axis
    at = start + second * to_second + third * to_third
    error = away * stretch + np.float32(4 * ROUNDING) * (np.float32(1.0) + abs(at))
    if not error < np.float32(1.0):  # NaN too
        return np.int32(0), np.int32(-1), at, error
    lower = np.floor(at)
    column = np.int32(lower)
    return column, column if 0 <= column < size else wrapped(column, size, wrap), at - lower, error


@numba.njit(inline="always")
def _glance(cut, triangle, second, third, away):  # type: ignore[no-untyped-def]
    """As `decide`, in float32; OPEN also near the borders of texels, and wherever that is simpler. cut: `_pointers`."""
    u, v, first, nearest, least = triangle
    column, i, right, dx = _place(u, second, third, away)
    row, j, down, dy = _place(v, second, third, away)
    if (i | j) < 0:
        return OPEN
    width, height, one, texels = u[4], v[4], np.float32(1.0), cut.texels
    line = first + np.int64(j) * width
    found = np.int64(cut.around[line + i])
    if found != OPEN:
        return found
    if not (right > dx and one - right > dx and down > dy and one - down > dy):
        return OPEN
    if nearest:
        return OPAQUE if texels[line + i] >= least else CLEAR
    to_right, below = wrapped(column + np.int32(1), width, u[5]), wrapped(row + np.int32(1), height, v[5])
    under = first + np.int64(below) * width
    a, b = np.float32(texels[line + i]), np.float32(texels[line + to_right])
    c, d = np.float32(texels[under + i]), np.float32(texels[under + to_right])
    above, beneath = a + (b - a) * right, c + (d - c) * right
    over = above + (beneath - above) * down - least
    error = (max(a, b, c, d) - min(a, b, c, d)) * (dx + dy) + np.float32(255 * 4 * ROUNDING)
    if abs(over) <= error:
        return OPEN
    return OPAQUE if over > 0 else CLEAR


def _filter(arguments):  # type: ignore[no-untyped-def]
    """An RTCFilterFunctionN: clears `valid` of hits that are passed through, and flags rays of open ones.

    arguments: an RTCFilterFunctionNArguments: valid, user data, context, rays, hits, N. N is that of Embree's kernel,
    not of the query; lanes whose `valid` is not −1 belong to others.
    """
    count = arguments[5] & 0xFFFFFFFF
    valid, data = _pointer(arguments[0], types.int32), _pointer(arguments[1], types.intp)
    ray, meets = _pointer(arguments[3], types.float32), _pointer(arguments[4], types.float32)
    hits, cut = _pointer(arguments[4], types.int32), _pointers(data)
    index, normal, triangle = np.int64(-1), np.float32(0.0), _of_triangle(cut, np.int64(0))
    for k in range(count):
        if valid[k] != -1:
            continue
        if hits[5 * count + k] != index:  # mostly one triangle for all lanes
            index, normal = np.int64(hits[5 * count + k]), np.float32(0.0)
            triangle = _of_triangle(cut, index)
            for axis in range(3):
                normal += meets[axis * count + k] ** 2
            normal = np.sqrt(normal)
        across, length, place = np.float32(0.0), np.float32(0.0), np.float32(0.0)
        for axis in range(3):
            way = ray[(4 + axis) * count + k]
            across += way * meets[axis * count + k]
            length += way * way
            place = max(place, abs(ray[axis * count + k]))
        length = np.sqrt(length)
        away = np.float32(RAY_ERROR) * (place + length * ray[8 * count + k]) * length * normal
        away /= max(abs(across), np.float32(TINY))
        second, third = meets[3 * count + k], meets[4 * count + k]
        found = _glance(cut, triangle, second, third, away)
        if found == OPEN:
            found = decide(_at(data), index, np.float64(second), np.float64(third), np.float64(away))
        if found == OPEN:
            flags = _pointer(_pointer(arguments[2], types.intp)[FLAGS], types.uint8)
            flags[_pointer(arguments[3], types.uint32)[10 * count + k]] = 1
        valid[k] = np.int32(-1) if found == OPAQUE else np.int32(0)


@cache
def filter_address() -> int:
    """Address of the filter function, compiled by the first call in a process."""
    pointer: Any = types.CPointer
    signature = types.void(pointer(types.intp))
    function = cached_if_possible(lambda cache: numba.cfunc(signature, cache=cache, error_model="numpy")(_filter))
    return int(function.address)
