"""Embree from the embreex wheel: scenes of triangles, the nearest hit of a ray, and whether anything blocks it.

Embree works in float32, so callers pass local coordinates (a scene diagonal of about 1) and refine hits themselves. The
wheel's own Python code traces single rays; `packets` gives the library up to 16 at a time, at several times the rate.
"""

import ctypes
import hashlib
import os
import re
import weakref
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from functools import cache, lru_cache
from pathlib import Path
from typing import NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from shadowbench.errors import InputError, ShadowbenchError
from shadowbench.files import cache_folder, replace_file
from shadowbench.options import ViewSize
from shadowbench.scenes.cutouts import CutoutFaces
from shadowbench.scenes.triangles import Geometry, in_slices
from shadowbench.scenes.vectors import Floats

Mask = NDArray[np.bool_]
Result = TypeVar("Result")
Singles = NDArray[np.float32]
Vectors = Floats | Singles

RAYS_A_SLICE = 1 << 15  # float64 temporaries of a slice fit in a core's cache
INFINITE = 1e30  # ray length, in effect infinite: beyond any local scene
INSTRUCTION_SETS = ("sse2", "sse4.2", "avx", "avx2", "avx512")
CUT_OUT = 1  # number of the geometry of cut-out triangles; that of the others is 0

_NATIVE = {16: 34, 8: 33, 4: 32}  # RTC_DEVICE_PROPERTY_NATIVE_RAY…_SUPPORTED of each width of a packet
_TRIANGLES, _INDICES, _VERTICES = 0, 0, 1  # RTCGeometryType, RTCBufferType
_UINT3, _FLOAT3 = 0x5003, 0x9003  # RTCFormat
_ROBUST = 4  # RTC_SCENE_FLAG_ROBUST
_PROCESSOR = Path("/proc/cpuinfo")
_LOCATIONS = ("../embreex.libs", ".dylibs", ".")  # from the package: auditwheel and delvewheel, delocate, none


@cache
def load_library() -> ctypes.CDLL:
    """The Embree library of the installed embreex. Raises ModuleNotFoundError or ShadowbenchError without it."""
    import embreex

    package = Path(embreex.__file__).parent
    file = next((file for folder in _LOCATIONS for file in (package / folder).glob("*embree4*")), None)
    if file is None:
        raise ShadowbenchError("embreex: its wheel holds no Embree 4 library")
    library = ctypes.CDLL(str(file))
    for name in ("rtcNewDevice", "rtcNewScene", "rtcNewGeometry"):
        getattr(library, name).restype = ctypes.c_void_p
    library.rtcGetDeviceProperty.restype = ctypes.c_ssize_t
    return library


class Device(NamedTuple):
    """An Embree device, kept while the process lives; width: rays of the widest packet that it traces natively."""

    handle: ctypes.c_void_p
    width: int


def make_device(instructions: str = "") -> Device:
    """A device for one of INSTRUCTION_SETS, by default the best of this processor. Raises InputError without it."""
    library, handle = load_library(), ctypes.c_void_p(None)
    if instructions in ("", *INSTRUCTION_SETS):  # of an unknown one Embree would take the least
        handle.value = library.rtcNewDevice(f"isa={instructions}".encode() if instructions else None)
    if not handle:
        sets = ", ".join(INSTRUCTION_SETS)
        raise InputError(f"SHADOWBENCH_ISA: {instructions!r}; allowed: what this processor has of {sets}")
    # Of the other widths, each ray would be traced singly.
    native = (width for width, number in _NATIVE.items() if library.rtcGetDeviceProperty(handle, number))
    return Device(handle, next(native, min(_NATIVE)))


@cache
def default_device() -> Device:
    """The device of this process, for the instruction set $SHADOWBENCH_ISA."""
    return make_device(os.environ.get("SHADOWBENCH_ISA", ""))


class Hits(NamedTuple):
    """Nearest hits of N rays: (N,) int32 triangle, −1 if none; (N,) float32 distance, `reach` if none."""

    triangle: NDArray[np.int32]
    distance: Singles


class Tracer:
    """Embree scene of one indexed triangle list, in robust mode.

    vertices: (V, 3) float64, local; faces: (F, 3) int32; cutouts: those of the faces that are cut out. Rays: origins
    (N, 3) float, directions (N, 3) or (1, 3) of any length; reach: (N,) or a number. Reach and distances are in
    multiples of the direction's length. Arrays whose transpose is a contiguous float32 array are not copied. Raises
    MemoryError if Embree has not enough memory.
    """

    def __init__(self, vertices: Floats, faces: NDArray[np.int32], cutouts: CutoutFaces | None = None) -> None:
        from shadowbench.truths import packets  # Numba takes 0.4 s to import

        handle, library, device = ctypes.c_void_p, load_library(), default_device()
        scene = handle(library.rtcNewScene(device.handle))
        library.rtcSetSceneFlags(scene, _ROBUST)
        # Embree reads 16 bytes a vertex, so the last one needs four more; it does not copy what it shares.
        self._vertices = np.zeros((len(vertices) + 2, 3), dtype=np.float32)
        self._vertices[: len(vertices)] = vertices
        # Of the faces, which are those that are not cut out, then those that are.
        self._order, self._opaque = None, len(faces)
        if cutouts is not None:
            self._cut = packets.cutout_arrays(cutouts, len(faces))
            self._addresses = np.array([array.ctypes.data for array in self._cut[1:]], dtype=np.intp)
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
            if number == CUT_OUT:
                library.rtcSetGeometryUserData(geometry, handle(self._addresses.ctypes.data))
                for query in ("Occluded", "Intersect"):
                    getattr(library, f"rtcSetGeometry{query}FilterFunction")(geometry, handle(packets.filter_address()))
            library.rtcCommitGeometry(geometry)
            library.rtcAttachGeometryByID(scene, geometry, number)
            library.rtcReleaseGeometry(geometry)
        library.rtcCommitScene(scene)
        weakref.finalize(self, library.rtcReleaseScene, scene)
        if error := library.rtcGetDeviceError(device.handle):
            raise MemoryError(f"Embree cannot hold {len(faces)} triangles (error {error})")
        self.handle, self._width = scene.value or 0, device.width

    def hits(self, origins: Vectors, directions: Vectors, reach: Vectors | float) -> Hits:
        """The nearest triangle within reach of each ray."""
        from shadowbench.truths import packets

        triangle, distance = np.empty(len(origins), dtype=np.int32), np.empty(len(origins), dtype=np.float32)
        buffers, rays = packets.buffers(self._width), _contiguous(origins, directions, reach)
        packets.intersect(self._width, *buffers, self.handle, *rays, self._opaque, triangle, distance)
        if self._order is not None:
            triangle[triangle >= 0] = self._order[triangle[triangle >= 0]]
        return Hits(triangle, distance)

    def occluded(self, origins: Vectors, directions: Vectors, reach: Vectors | float) -> Mask:
        """(N,) bool: whether any triangle lies within reach."""
        from shadowbench.truths import packets

        blocked = np.empty(len(origins), dtype=np.bool_)
        buffers, rays = packets.buffers(self._width), _contiguous(origins, directions, reach)
        packets.occluded(self._width, *buffers, self.handle, *rays, blocked)
        return blocked


def tracer_of(geometry: Geometry) -> Tracer:
    """A tracer of all triangles; the last one is kept, for the next frame of a sequence."""
    return _kept_tracer(geometry, default_device().handle.value)


@lru_cache(1)
def _kept_tracer(geometry: Geometry, device: int | None) -> Tracer:
    return Tracer(geometry.vertices, geometry.faces, geometry.cutouts)


def _contiguous(origins: Vectors, directions: Vectors, reach: Vectors | float) -> tuple[Singles, ...]:
    """(3, N) origins, (3, N) or (3, 1) directions and (N,) reach, as compiled code takes them unchecked."""
    if origins.shape[1:] != (3,) or directions.shape not in (origins.shape, (1, 3)):
        raise ValueError(f"origins of shape {origins.shape}, directions of shape {directions.shape}")
    reaches = np.broadcast_to(np.asarray(reach, dtype=np.float32), len(origins))
    return tuple(np.require(values, np.float32, ["C", "W"]) for values in (origins.T, directions.T, reaches))


@cache
def answers_digest() -> str:
    """`computed_digest`, from the cache if this library was tried on such a processor before: Numba loads for 0.5 s."""
    text = _PROCESSOR.read_text() if _PROCESSOR.exists() else ""
    flags, library = re.search(r"^(flags|Features)\s*:.*", text, re.MULTILINE), Path(load_library()._name).stat()
    if flags is None:  # not Linux
        return computed_digest()
    parts = library.st_mtime_ns, library.st_size, default_device().width, os.environ.get("SHADOWBENCH_ISA"), flags[0]
    file = cache_folder("truth") / f"{hashlib.sha256(repr(parts).encode()).hexdigest()[:32]}.answers"
    with suppress(OSError, UnicodeDecodeError):
        if re.fullmatch(r"[0-9a-f]{64}", kept := file.read_text()):
            return kept
    digest = computed_digest()
    with suppress(OSError, InputError):  # a cache that cannot be written is reported with the truths
        file.parent.mkdir(parents=True, exist_ok=True)
        with replace_file(file) as temporary:
            temporary.write_text(digest)
    return digest


def computed_digest() -> str:
    """Hex digest of the distances of fixed rays: their last bits depend on the processor, as few rays of a truth do."""
    point: Floats = np.outer(np.arange(1, 1 << 13), np.sqrt([2.0, 3.0, 5.0, 7.0, 11.0, 13.0])) % 1
    first, along, across = point[:1800, :3].reshape(3, -1, 3)
    corners = np.stack([first, first + along / 5, first + across / 5], axis=1).reshape(-1, 3)
    tracer = Tracer(corners, np.arange(len(corners), dtype=np.int32).reshape(-1, 3))
    return hashlib.sha256(tracer.hits(point[:, :3], point[:, 3:] - 0.5, INFINITE).distance.tobytes()).hexdigest()


def over_slices(work: Callable[[slice], Result], count: int, size: int = RAYS_A_SLICE) -> Iterator[Result]:
    """Results of `work` on slices of `count` items, in order, one thread per core; Embree and NumPy release the GIL."""
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        yield from pool.map(work, in_slices(count, size))


def over_rows(work: Callable[[slice], Result], size: ViewSize) -> Iterator[Result]:
    """Results of `work` on slices of the rows of an image, each of about RAYS_A_SLICE rays."""
    return over_slices(work, size.height, max(1, RAYS_A_SLICE // size.width))
