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

from shadowbench.compiled import compiled
from shadowbench.truths.cutouts import CLEAR, OPAQUE, OPEN, REPEAT, ROUNDING, CutoutArrays, decide

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


@compiled()
def _at(data):  # type: ignore[no-untyped-def]
    """The arrays at the addresses of `addresses_of`."""
    return CutoutArrays(
        carray(_pointer(data[0], types.int32), 0),
        carray(_pointer(data[0], types.float32), (data[1], 3, 2)),
        carray(_pointer(data[2], types.float32), (data[3], 3)),
        carray(_pointer(data[4], types.int32), (data[5],)),
        carray(_pointer(data[6], types.float32), (data[7], 3)),
        carray(_pointer(data[8], types.uint8), (data[9],)),
        carray(_pointer(data[10], types.int32), (data[11], 6)),
        carray(_pointer(data[12], types.float64), (data[13],)),
        carray(_pointer(data[14], types.float32), (data[15], 6)),
    )


@numba.njit(inline="always")
def _glance(data, index, second, third, away):  # type: ignore[no-untyped-def]
    """As `decide`, in float32; OPEN also near the borders of texels, and wherever that is simpler."""
    number = np.int64(_pointer(data[4], types.int32)[index])
    place, stretch = _pointer(data[14], types.float32), _pointer(data[6], types.float32)
    x = place[6 * index] + second * place[6 * index + 1] + third * place[6 * index + 2]
    y = place[6 * index + 3] + second * place[6 * index + 4] + third * place[6 * index + 5]
    column, row = np.floor(x), np.floor(y)
    right, down, one = x - column, y - row, np.float32(1.0)
    dx = away * stretch[3 * index] + np.float32(4 * ROUNDING) * (one + abs(x))
    dy = away * stretch[3 * index + 1] + np.float32(4 * ROUNDING) * (one + abs(y))
    if not (right > dx and one - right > dx and down > dy and one - down > dy):
        return OPEN
    table, texels = _pointer(data[10], types.int32), _pointer(data[8], types.uint8)
    least = _pointer(data[12], types.float64)[number]
    first, width, height = np.int64(table[6 * number]), table[6 * number + 1], table[6 * number + 2]
    i, j, to_right, below = np.int64(column), np.int64(row), np.int64(1), np.int64(width)
    if i < 0 or i >= width - 1:
        if table[6 * number + 4] != REPEAT:
            return OPEN
        i %= width
        to_right -= width if i == width - 1 else 0
    if j < 0 or j >= height - 1:
        if table[6 * number + 5] != REPEAT:
            return OPEN
        j %= height
        below -= width * height if j == height - 1 else 0
    at = first + j * width + i
    if table[6 * number + 3] != 0:
        return OPAQUE if texels[at] >= least else CLEAR
    a, b = np.float32(texels[at]), np.float32(texels[at + to_right])
    c, d = np.float32(texels[at + below]), np.float32(texels[at + below + to_right])
    above, under = a + (b - a) * right, c + (d - c) * right
    over = above + (under - above) * down - least
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
    triangle = _pointer(arguments[4], types.int32)
    for k in range(count):
        if valid[k] != -1:
            continue
        across, along, normal, place = np.float32(0.0), np.float32(0.0), np.float32(0.0), np.float32(0.0)
        for axis in range(3):
            way, up = ray[(4 + axis) * count + k], meets[axis * count + k]
            across += way * up
            along += way * way
            normal += up * up
            place = max(place, abs(ray[axis * count + k]))
        away = np.float32(RAY_ERROR) * (place + np.sqrt(along) * ray[8 * count + k]) * np.sqrt(along * normal)
        away /= max(abs(across), np.float32(TINY))
        index, second, third = np.int64(triangle[5 * count + k]), meets[3 * count + k], meets[4 * count + k]
        found = _glance(data, index, second, third, away)
        if found == OPEN:
            found = decide(_at(data), index, np.float64(second), np.float64(third), np.float64(away))
        if found == OPEN:
            flags = _pointer(_pointer(arguments[2], types.intp)[FLAGS], types.uint8)
            flags[_pointer(arguments[3], types.uint32)[10 * count + k]] = 1
        if found != OPAQUE:
            valid[k] = 0


@cache
def filter_address() -> int:
    """Address of the filter function, compiled by the first call in a process."""
    pointer: Any = types.CPointer
    function: Any = numba.cfunc(types.void(pointer(types.intp)), cache=True, error_model="numpy")(_filter)
    return int(function.address)
