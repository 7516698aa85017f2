"""Packets of 16 rays, traced by the Embree library inside the embreex wheel, which itself traces single rays.

The same library gives the same answers at several times the rate (`benchmarks/test_truth.py` measures both). The calls
are made from code that Numba compiles and caches.
"""

import ctypes
import importlib.util
import weakref
from functools import cache
from pathlib import Path
from typing import Any

import numba
import numpy as np
from llvmlite import binding
from numba import types
from numpy.typing import NDArray

from shadowbench.compiled import compile_once, compiled

PACKET = 16
COHERENT = 1 << 16  # RTC_RAY_QUERY_FLAG_COHERENT
_TRIANGLES, _INDICES, _VERTICES = 0, 0, 1  # RTCGeometryType, RTCBufferType
_UINT3, _FLOAT3 = 0x5003, 0x9003  # RTCFormat
_ROBUST = 4  # RTC_SCENE_FLAG_ROBUST
_LOCATIONS = ("../embreex.libs", ".dylibs", ".")  # from the package: auditwheel and delvewheel, delocate, none

Single = NDArray[np.float32]

# Numba caches a kernel that names a symbol, but none that holds a ctypes pointer.
_query = types.void(*[types.intp] * 4)  # pointers: valid, scene, rays, arguments
_occluded16: Any = types.ExternalFunction("rtcOccluded16", _query)
_intersect16: Any = types.ExternalFunction("rtcIntersect16", _query)


@cache
def load_library() -> ctypes.CDLL | None:
    """The Embree library of the installed embreex, its packet functions known to Numba; None if it cannot be loaded."""
    found = importlib.util.find_spec("embreex")
    if found is None or found.origin is None:
        return None
    for folder in _LOCATIONS:
        for file in sorted((Path(found.origin).parent / folder).glob("*embree4*")):
            try:
                library = ctypes.CDLL(str(file))
                functions = {name: getattr(library, name) for name in ("rtcOccluded16", "rtcIntersect16")}
            except (OSError, AttributeError):  # for another processor, or built without packets
                continue
            for name, function in functions.items():
                binding.add_symbol(name, ctypes.cast(function, ctypes.c_void_p).value)
            compile_once(_compile)
            return library
    return None


class PacketScene:
    """An Embree scene of one indexed triangle list, in robust mode.

    vertices: (V, 3) float32; faces: (F, 3) int32. Rays, all float32 and C-contiguous: origins (3, N), directions (3, N)
    or (3, 1), reach (N,) in multiples of the direction's length. Raises MemoryError if Embree has not enough memory.
    """

    def __init__(self, library: ctypes.CDLL, vertices: Single, faces: NDArray[np.int32]) -> None:
        handle = ctypes.c_void_p
        for name in ("rtcNewDevice", "rtcNewScene", "rtcNewGeometry"):
            getattr(library, name).restype = handle
        device = handle(library.rtcNewDevice(None))
        scene = handle(library.rtcNewScene(device))
        library.rtcSetSceneFlags(scene, _ROBUST)
        # Embree reads 16 bytes a vertex, so the last one needs four more; it does not copy what it shares.
        self._vertices = np.zeros((len(vertices) + 2, 3), dtype=np.float32)
        self._vertices[: len(vertices)] = vertices
        self._faces = np.ascontiguousarray(faces, dtype=np.int32)
        if len(faces):
            geometry = handle(library.rtcNewGeometry(device, _TRIANGLES))
            _share(library, geometry, _VERTICES, _FLOAT3, self._vertices, len(vertices))
            _share(library, geometry, _INDICES, _UINT3, self._faces, len(faces))
            library.rtcCommitGeometry(geometry)
            library.rtcAttachGeometry(scene, geometry)
            library.rtcReleaseGeometry(geometry)
        library.rtcCommitScene(scene)
        weakref.finalize(self, _release, library, scene, device)
        if error := library.rtcGetDeviceError(device):
            raise MemoryError(f"Embree cannot hold {len(faces)} triangles (error {error})")
        self._handle = scene.value or 0

    def occluded(self, origins: Single, directions: Single, reach: Single) -> NDArray[np.bool_]:
        """(N,) whether any triangle lies within reach."""
        blocked = np.empty(len(reach), dtype=np.bool_)
        _occluded(self._handle, origins, directions, reach, blocked)
        return blocked

    def intersect(self, origins: Single, directions: Single, reach: Single) -> tuple[NDArray[np.int32], Single]:
        """(N,) index of the nearest triangle, −1 if none, and its distance, `reach` if none."""
        triangle, distance = np.empty(len(reach), dtype=np.int32), np.empty(len(reach), dtype=np.float32)
        _intersect(self._handle, origins, directions, reach, triangle, distance)
        return triangle, distance


def _share(
    library: ctypes.CDLL, geometry: ctypes.c_void_p, kind: int, layout: int, array: NDArray[np.generic], count: int
) -> None:
    size = ctypes.c_size_t
    library.rtcSetSharedGeometryBuffer(
        geometry, kind, 0, layout, ctypes.c_void_p(array.ctypes.data), size(0), size(12), size(count)
    )


def _release(library: ctypes.CDLL, scene: ctypes.c_void_p, device: ctypes.c_void_p) -> None:
    library.rtcReleaseScene(scene)
    library.rtcReleaseDevice(device)


@numba.njit(inline="always")
def _aligned(words: int) -> NDArray[np.uint32]:
    """(words,) zeros, uint32, aligned to 64 bytes."""
    raw = np.zeros(words + 16, dtype=np.uint32)
    start = (-(raw.ctypes.data >> 2)) & 15
    return raw[start : start + words]


@numba.njit(inline="always")
def _fill(ray, valid, first, origins, directions, reach):  # type: ignore[no-untyped-def]
    """Write the up to 16 rays from index `first` on into an RTCRay16; returns their number."""
    count = min(PACKET, len(reach) - first)
    shared = directions.shape[1] == 1
    for k in range(PACKET):
        valid[k] = -1 if k < count else 0
    for axis in range(3):
        for k in range(count):
            ray[axis * PACKET + k] = origins[axis, first + k]
            ray[(4 + axis) * PACKET + k] = directions[axis, 0 if shared else first + k]
    for k in range(count):
        ray[8 * PACKET + k] = reach[first + k]  # tfar
    return count


@compiled()
def _occluded(scene, origins, directions, reach, blocked):  # type: ignore[no-untyped-def]
    ray, valid, arguments = _aligned(22 * PACKET).view(np.float32), _aligned(PACKET).view(np.int32), _aligned(16)
    ray.view(np.uint32)[9 * PACKET : 10 * PACKET] = 0xFFFFFFFF  # mask; tnear and time stay 0
    arguments[0], arguments[1] = COHERENT, 0xFFFFFFFF  # RTCOccludedArguments: flags, feature mask
    for first in range(0, len(reach), PACKET):
        count = _fill(ray, valid, first, origins, directions, reach)
        _occluded16(valid.ctypes.data, scene, ray.ctypes.data, arguments.ctypes.data)
        for k in range(count):
            blocked[first + k] = ray[8 * PACKET + k] < 0  # Embree sets tfar to −inf


@compiled()
def _intersect(scene, origins, directions, reach, triangle, distance):  # type: ignore[no-untyped-def]
    hit, valid, arguments = _aligned(22 * PACKET).view(np.float32), _aligned(PACKET).view(np.int32), _aligned(16)
    words, primitive = hit.view(np.uint32), hit.view(np.int32)[17 * PACKET : 18 * PACKET]
    words[9 * PACKET : 10 * PACKET] = 0xFFFFFFFF  # mask
    arguments[0], arguments[1] = COHERENT, 0xFFFFFFFF  # RTCIntersectArguments
    for first in range(0, len(reach), PACKET):
        count = _fill(hit, valid, first, origins, directions, reach)
        words[17 * PACKET : 19 * PACKET] = 0xFFFFFFFF  # primID and geomID: none
        _intersect16(valid.ctypes.data, scene, hit.ctypes.data, arguments.ctypes.data)
        for k in range(count):
            triangle[first + k] = primitive[k]  # −1 unless written
            distance[first + k] = hit[8 * PACKET + k]


def _compile() -> None:
    none, triangles = np.empty(0, dtype=np.float32), np.empty(0, dtype=np.int32)
    rays = np.empty((3, 0), dtype=np.float32)
    _occluded(0, rays, rays, none, np.empty(0, dtype=np.bool_))
    _intersect(0, rays, rays, none, triangles, none)
