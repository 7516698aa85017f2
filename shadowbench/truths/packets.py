"""Packets of 16, 8 or 4 rays, traced by the Embree library inside the embreex wheel, which itself traces single rays.

The same answers come at several times the rate (`benchmarks/test_truth.py` measures both).
"""

import ctypes
import os
import weakref
from functools import cache
from importlib import import_module
from pathlib import Path
from typing import Any, NamedTuple

import numba
import numpy as np
from llvmlite import binding
from numba import carray, types  # type: ignore[attr-defined]
from numba.extending import intrinsic
from numpy.typing import NDArray

from shadowbench.compiled import cached_if_possible, compiled
from shadowbench.errors import InputError, ShadowbenchError
from shadowbench.scenes.cutouts import CutoutFaces

COHERENT = 1 << 16  # RTC_RAY_QUERY_FLAG_COHERENT
INSTRUCTION_SETS = ("sse2", "sse4.2", "avx", "avx2", "avx512")
_NATIVE = {16: 34, 8: 33, 4: 32}  # RTC_DEVICE_PROPERTY_NATIVE_RAY…_SUPPORTED of each width of a packet
_TRIANGLES, _INDICES, _VERTICES = 0, 0, 1  # RTCGeometryType, RTCBufferType
_UINT3, _FLOAT3 = 0x5003, 0x9003  # RTCFormat
_ROBUST = 4  # RTC_SCENE_FLAG_ROBUST
_CUT_OUT = 1  # number of the geometry of cut-out triangles; that of the others is 0
_LOCATIONS = ("../embreex.libs", ".dylibs", ".")  # from the package: auditwheel and delvewheel, delocate, none
LANE = 22  # words of a lane, at least: 12 of an RTCRay, 9 of an RTCHit

Single = NDArray[np.float32]
Words = NDArray[np.uint32]
Flags = NDArray[np.bool_]

# Numba caches a kernel that names a symbol, but none that holds a ctypes pointer.
_query = types.void(*[types.intp] * 4)  # pointers: valid, scene, rays, arguments
_SYMBOLS = [f"rtc{query}{width}" for query in ("Occluded", "Intersect") for width in _NATIVE]
_occluded16, _occluded8, _occluded4, _intersect16, _intersect8, _intersect4 = (
    types.ExternalFunction(name, _query) for name in _SYMBOLS
)


@cache
def load_library() -> ctypes.CDLL:
    """The Embree library of the installed embreex, its packet functions known to Numba.

    Raises ModuleNotFoundError without embreex, ShadowbenchError for a wheel without packets.
    """
    origin = str(import_module("embreex").__file__)
    for folder in _LOCATIONS:
        for file in sorted((Path(origin).parent / folder).glob("*embree4*")):
            try:
                library = ctypes.CDLL(str(file))
                functions = {name: getattr(library, name) for name in _SYMBOLS}
            except (OSError, AttributeError):  # for another processor, or built without packets
                continue
            for name, function in functions.items():
                binding.add_symbol(name, ctypes.cast(function, ctypes.c_void_p).value)
            for name in ("rtcNewDevice", "rtcNewScene", "rtcNewGeometry"):
                getattr(library, name).restype = ctypes.c_void_p
            library.rtcGetDeviceProperty.restype = ctypes.c_ssize_t
            return library
    raise ShadowbenchError("embreex: its wheel holds no Embree 4 library that can be loaded here")


class Device(NamedTuple):
    """An Embree device, kept while the process lives; width: rays of the widest packet that it traces natively."""

    library: ctypes.CDLL
    handle: ctypes.c_void_p
    width: int


def make_device(library: ctypes.CDLL, instructions: str = "") -> Device:
    """A device for one of INSTRUCTION_SETS, by default the best of this processor.

    Raises InputError if Embree does not know the set, or if the processor lacks it.
    """
    if instructions not in ("", *INSTRUCTION_SETS):  # Embree would take the least one
        raise InputError(f"SHADOWBENCH_ISA: {instructions!r} is not one of {', '.join(INSTRUCTION_SETS)}")
    handle = ctypes.c_void_p(library.rtcNewDevice(f"isa={instructions}".encode() if instructions else None))
    if not handle:
        raise InputError(f"SHADOWBENCH_ISA: Embree finds no {instructions or 'SSE2'} on this processor")
    # Of the other widths, each ray would be traced singly.
    native = (width for width, number in _NATIVE.items() if library.rtcGetDeviceProperty(handle, number))
    return Device(library, handle, next(native, min(_NATIVE)))


@cache
def default_device() -> Device:
    """The device of this process, for the instruction set $SHADOWBENCH_ISA."""
    return make_device(load_library(), os.environ.get("SHADOWBENCH_ISA", ""))


class PacketScene:
    """An Embree scene of one indexed triangle list, in robust mode.

    vertices: (V, 3) float32; faces: (F, 3) int32; cutouts: those that are cut out. Rays, all float32 and
    C-contiguous: origins (3, N), directions (3, N) or (3, 1), reach (N,) in multiples of the direction's length.
    Raises MemoryError if Embree has not enough memory.
    """

    def __init__(
        self, device: Device, vertices: Single, faces: NDArray[np.int32], cutouts: CutoutFaces | None = None
    ) -> None:
        handle, library = ctypes.c_void_p, device.library
        scene = handle(library.rtcNewScene(device.handle))
        library.rtcSetSceneFlags(scene, _ROBUST)
        # Embree reads 16 bytes a vertex, so the last one needs four more; it does not copy what it shares.
        self._vertices = np.zeros((len(vertices) + 2, 3), dtype=np.float32)
        self._vertices[: len(vertices)] = vertices
        # Of the faces, which are those that are not cut out, then those that are.
        self._order, self._opaque = None, len(faces)
        if cutouts is not None:
            self._cut = cutout_arrays(cutouts, len(faces))
            self._addresses = addresses_of(self._cut)
            self._order = np.argsort(self._cut.of >= 0, kind="stable").astype(np.int32)
            self._opaque, faces = len(faces) - len(cutouts.faces), faces[self._order]
        self._faces = np.ascontiguousarray(faces, dtype=np.int32)
        for number, part in enumerate((self._faces[: self._opaque], self._faces[self._opaque :])):
            if not len(part):
                continue
            geometry, size = handle(library.rtcNewGeometry(device.handle, _TRIANGLES)), ctypes.c_size_t
            for kind, layout, array, count in (
                (_VERTICES, _FLOAT3, self._vertices, len(vertices)),
                (_INDICES, _UINT3, part, len(part)),
            ):
                shared = handle(array.ctypes.data), size(0), size(12), size(count)
                library.rtcSetSharedGeometryBuffer(geometry, kind, 0, layout, *shared)
            if number == _CUT_OUT:
                library.rtcSetGeometryUserData(geometry, handle(self._addresses.ctypes.data))
                for query in ("Occluded", "Intersect"):
                    getattr(library, f"rtcSetGeometry{query}FilterFunction")(geometry, handle(filter_address()))
            library.rtcCommitGeometry(geometry)
            library.rtcAttachGeometryByID(scene, geometry, number)
            library.rtcReleaseGeometry(geometry)
        library.rtcCommitScene(scene)
        weakref.finalize(self, library.rtcReleaseScene, scene)
        if error := library.rtcGetDeviceError(device.handle):
            raise MemoryError(f"Embree cannot hold {len(faces)} triangles (error {error})")
        self.handle, self._width = scene.value or 0, device.width

    def occluded(self, origins: Single, directions: Single, reach: Single) -> Flags:
        """(N,) whether any triangle lies within reach."""
        blocked = np.empty(len(reach), dtype=np.bool_)
        _occluded(self._width, *_buffers(self._width), self.handle, origins, directions, reach, blocked)
        return blocked

    def intersect(self, origins: Single, directions: Single, reach: Single) -> tuple[NDArray[np.int32], Single]:
        """(N,) index of the nearest triangle, −1 if none; its distance, `reach` if none."""
        triangle, distance = np.empty(len(reach), dtype=np.int32), np.empty(len(reach), dtype=np.float32)
        rays = origins, directions, reach
        _intersect(self._width, *_buffers(self._width), self.handle, *rays, self._opaque, triangle, distance)
        if self._order is not None:
            triangle[triangle >= 0] = self._order[triangle[triangle >= 0]]
        return triangle, distance


def _buffers(width: int) -> tuple[Words, Words, Words]:
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
def _occluded(  # type: ignore[no-untyped-def]
    width, packet, valid, arguments, scene, origins, directions, reach, blocked
):
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
def _intersect(  # type: ignore[no-untyped-def]
    width, packet, valid, arguments, scene, origins, directions, reach, opaque, triangle, distance
):
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
            if hits[width + k] == _CUT_OUT:
                triangle[first + k] += opaque
            distance[first + k] = ray[8 * width + k]


class CutoutArrays(NamedTuple):
    """The cut-out triangles of a list of faces, for compiled code.

    of: (F,) int32 index of a face among the cut-out ones, −1 for others; places: (K, 2, 3) float32 column of a
    triangle's first corner in its cut-out, and its change to the second and the third, then the row's; number: (K,)
    int32 of the cut-out; table, words: see `PackedCutouts`.
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


def addresses_of(arrays: CutoutArrays) -> NDArray[np.intp]:
    """Addresses of the arrays but `of`: the user data of a geometry, which does not own them."""
    return np.array([array.ctypes.data for array in arrays[1:]], dtype=np.intp)


def _filter(arguments):  # type: ignore[no-untyped-def]
    """An RTCFilterFunctionN: clears `valid` of hits that are passed through.

    arguments: an RTCFilterFunctionNArguments: valid, user data, context, rays, hits, N. N is that of Embree's kernel,
    not of the query; lanes whose `valid` is not −1 belong to others.
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
