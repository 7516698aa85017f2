"""Compiled code around Embree: queries of packets of 16, 8 or 4 rays, and the filter of hits on cut-out triangles."""

import ctypes
from functools import cache
from typing import Any, NamedTuple

import numba
import numpy as np
from llvmlite import binding
from numba import carray, types  # type: ignore[attr-defined]
from numba.extending import intrinsic
from numpy.typing import NDArray

from shadowbench.compiled import cached_if_possible, compiled
from shadowbench.scenes.cutouts import CutoutFaces
from shadowbench.truths.embree import CUT_OUT, load_library

COHERENT = 1 << 16  # RTC_RAY_QUERY_FLAG_COHERENT
LANE = 22  # words of a lane, at least: 12 of an RTCRay, 9 of an RTCHit

Words = NDArray[np.uint32]

# Numba caches a kernel that names a symbol, but none that holds a ctypes pointer.
_query = types.void(*[types.intp] * 4)  # pointers: valid, scene, rays, arguments
_SYMBOLS = [f"rtc{query}{width}" for query in ("Occluded", "Intersect") for width in (16, 8, 4)]
_occluded16, _occluded8, _occluded4, _intersect16, _intersect8, _intersect4 = (
    types.ExternalFunction(name, _query) for name in _SYMBOLS
)
for _name in _SYMBOLS:
    binding.add_symbol(_name, ctypes.cast(getattr(load_library(), _name), ctypes.c_void_p).value)


def buffers(width: int) -> tuple[Words, Words, Words]:
    """Zeros for a packet: an RTCRayHit, since Embree writes it back where it emulates the width; lanes; arguments."""
    return _aligned(LANE * width), _aligned(width), _aligned(16)


def _aligned(words: int) -> Words:
    """(words,) zeros, uint32, aligned to 64 bytes."""
    raw = np.zeros(words + 16, dtype=np.uint32)
    start = -(raw.ctypes.data >> 2) & 15
    return raw[start : start + words]


@numba.njit(inline="always")
def _prepare(width, packet, arguments):  # type: ignore[no-untyped-def]
    """Write what all packets share, and return the rows of a packet as float32."""
    packet[9 * width : 10 * width] = 0xFFFFFFFF  # mask; tnear and time stay 0
    arguments[0], arguments[1] = COHERENT, 0xFFFFFFFF  # flags, feature mask
    return packet.view(np.float32)


@numba.njit(inline="always")
def _fill(width, ray, number, valid, first, origins, directions, reach):  # type: ignore[no-untyped-def]
    """Write the up to `width` rays from index `first` on into a packet; returns their number."""
    count = min(width, len(reach) - first)
    shared = directions.shape[1] == 1
    for k in range(width):
        valid[k] = 0xFFFFFFFF if k < count else 0
    for axis in range(3):
        for k in range(count):
            ray[axis * width + k] = origins[axis, first + k]
            ray[(4 + axis) * width + k] = directions[axis, 0 if shared else first + k]
    for k in range(count):
        ray[8 * width + k] = reach[first + k]  # tfar
        number[10 * width + k] = first + k  # id
    return count


@compiled()
def occluded(  # type: ignore[no-untyped-def]
    width, packet, valid, arguments, scene, origins, directions, reach, blocked
):
    """Fill in whether any triangle lies within reach of each ray."""
    ray = _prepare(width, packet, arguments)
    pointers = valid.ctypes.data, scene, packet.ctypes.data, arguments.ctypes.data
    for first in range(0, len(reach), width):
        count = _fill(width, ray, packet, valid, first, origins, directions, reach)
        if width == 16:
            _occluded16(*pointers)
        elif width == 8:
            _occluded8(*pointers)
        else:
            _occluded4(*pointers)
        for k in range(count):
            blocked[first + k] = ray[8 * width + k] < 0  # Embree sets tfar to −inf


@compiled()
def intersect(  # type: ignore[no-untyped-def]
    width, packet, valid, arguments, scene, origins, directions, reach, opaque, triangle, distance
):
    """Fill in the nearest triangle of each ray and its distance, −1 and `reach` if none."""
    ray, hits = _prepare(width, packet, arguments), packet.view(np.int32)[17 * width : 19 * width]
    pointers = valid.ctypes.data, scene, packet.ctypes.data, arguments.ctypes.data
    for first in range(0, len(reach), width):
        count = _fill(width, ray, packet, valid, first, origins, directions, reach)
        packet[17 * width : 19 * width] = 0xFFFFFFFF  # primID and geomID: none
        if width == 16:
            _intersect16(*pointers)
        elif width == 8:
            _intersect8(*pointers)
        else:
            _intersect4(*pointers)
        for k in range(count):
            triangle[first + k] = hits[k]  # −1 unless written
            if hits[width + k] == CUT_OUT:
                triangle[first + k] += opaque
            distance[first + k] = ray[8 * width + k]


class CutoutArrays(NamedTuple):
    """The K cut-out triangles of a list of F faces, for compiled code.

    of: index of a face among them, −1 for others; places: (K, 2, 3) column and row of the first corner in its cut-out,
    and their changes to the second and the third; number: (K,) of the cut-out; table, words: see `PackedCutouts`.
    """

    of: NDArray[np.int32]
    places: NDArray[np.float32]
    number: NDArray[np.int32]
    table: NDArray[np.int32]
    words: NDArray[np.uint32]


def cutout_arrays(cutouts: CutoutFaces | None, faces: int) -> CutoutArrays:
    """The arrays of the cut-out triangles among some faces."""
    of = np.full(faces, -1, dtype=np.int32)
    if cutouts is None:
        nothing = np.zeros(0, np.int32), np.zeros((0, 4), np.int32), np.zeros(0, np.uint32)
        return CutoutArrays(of, np.zeros((0, 2, 3), np.float32), *nothing)
    of[cutouts.faces] = np.arange(len(cutouts.faces))
    places = cutouts.places.transpose(0, 2, 1).copy()
    places[:, :, 1:] -= places[:, :, :1]
    return CutoutArrays(of, places, np.ascontiguousarray(cutouts.number), cutouts.packed.table, cutouts.packed.words)


@numba.njit(inline="always")
def _wrapped(place, size, wrap):  # type: ignore[no-untyped-def]
    """The index of the sub-texel at a place along an axis; in floats, as places may be beyond whole numbers."""
    whole, limit = np.floor(place), np.float32(size)
    if wrap == 0:
        whole -= limit * np.floor(whole / limit)
    elif wrap == 1:
        whole -= 2 * limit * np.floor(whole / (2 * limit))
        whole = min(whole, 2 * limit - 1 - whole)
    return np.int64(min(whole, limit - 1)) if whole > 0 else np.int64(0)


@numba.njit(inline="always")
def _is_set(places, number, table, words, cut, second, third):  # type: ignore[no-untyped-def]
    """Whether a cut-out triangle is opaque at barycentric weights, float32, of its second and third corner."""
    row, at = table[number[cut]], places[cut]
    x = _wrapped(at[0, 0] + second * at[0, 1] + third * at[0, 2], row[1], row[3] // 3)
    y = _wrapped(at[1, 0] + second * at[1, 1] + third * at[1, 2], row[2], row[3] % 3)
    word = words[row[0] + y * ((row[1] + 31) >> 5) + (x >> 5)]
    return (np.int64(word) >> (x & 31)) & 1 != 0


@numba.njit(inline="always")
def is_opaque_at(arrays, face, sides):  # type: ignore[no-untyped-def]
    """Whether a face is opaque where a line meets it. sides: of `hard.hit`, weights of the corners."""
    cut = arrays.of[face]
    if cut < 0:
        return True
    whole = sides[0] + sides[1] + sides[2]
    second, third = np.float32(sides[1] / whole), np.float32(sides[2] / whole)
    return _is_set(arrays.places, arrays.number, arrays.table, arrays.words, cut, second, third)


def _make_pointer(context, address, kind):  # type: ignore[no-untyped-def]
    """A pointer to values of a type at an address."""

    def generate(context, builder, signature, arguments):  # type: ignore[no-untyped-def]
        return builder.inttoptr(arguments[0], context.get_value_type(signature.return_type))

    pointer: Any = types.CPointer
    return pointer(kind.dtype)(address, kind), generate


_pointer: Any = intrinsic(_make_pointer)


def _filter(arguments):  # type: ignore[no-untyped-def]
    """Clears `valid` of hits that are passed through; `arguments`: valid, user data, context, rays, hits, N.

    N is that of Embree's kernel, not of the query; lanes whose `valid` is not −1 belong to others.
    """
    count = arguments[5] & 0xFFFFFFFF
    valid, data = _pointer(arguments[0], types.int32), _pointer(arguments[1], types.intp)
    hits, weights = _pointer(arguments[4], types.int32), _pointer(arguments[4], types.float32)
    # Bounds are not checked, so that lengths do not matter.
    places, number = carray(_pointer(data[0], types.float32), (1, 2, 3)), carray(_pointer(data[1], types.int32), (1,))
    table, words = carray(_pointer(data[2], types.int32), (1, 4)), carray(_pointer(data[3], types.uint32), (1,))
    for k in range(count):
        if valid[k] != -1:
            continue
        triangle, second, third = hits[5 * count + k], weights[3 * count + k], weights[4 * count + k]
        if not _is_set(places, number, table, words, triangle, second, third):
            valid[k] = np.int32(0)


@cache
def filter_address() -> int:
    """Address of the filter function, compiled by the first call in a process."""
    pointer: Any = types.CPointer
    signature = types.void(pointer(types.intp))
    function = cached_if_possible(lambda cache: numba.cfunc(signature, cache=cache, error_model="numpy")(_filter))
    return int(function.address)
