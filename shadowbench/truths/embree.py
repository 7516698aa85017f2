"""Ray queries by Embree: nearest triangle, distance, occlusion.

Embree works in float32, so callers pass local coordinates (a scene diagonal of about 1) and refine hits themselves.
Rays go in packets to the library inside the embreex wheel (`packets`), which checks no array bounds; this module alone
ensures the shapes and types that it expects.
"""

import hashlib
import os
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from functools import cache
from typing import NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from shadowbench.scenes.cutouts import CutoutFaces
from shadowbench.scenes.triangles import Geometry, in_slices
from shadowbench.scenes.vectors import Floats

Mask = NDArray[np.bool_]
Result = TypeVar("Result")
Singles = NDArray[np.float32]
Vectors = Floats | Singles

RAYS_A_SLICE = 1 << 15  # float64 temporaries of a slice fit in a core's cache
INFINITE = 1e30  # ray length, in effect infinite: beyond any local scene


class Hits(NamedTuple):
    """Nearest hits of N rays.

    triangle: (N,) int32, −1 if none; distance: (N,) float32, `reach` if none.
    """

    triangle: NDArray[np.int32]
    distance: Singles


class Tracer:
    """Embree scene of one indexed triangle list.

    vertices: (V, 3) float64, local; faces: (F, 3) int32; cutouts: those of the faces that are cut out. Rays: origins
    (N, 3) float, directions (N, 3) or (1, 3) of any length; reach: (N,) or a number. Reach and distances are in
    multiples of the direction's length. Arrays whose transpose is a contiguous float32 array are not copied.
    """

    def __init__(self, vertices: Floats, faces: NDArray[np.int32], cutouts: CutoutFaces | None = None) -> None:
        from shadowbench.truths.packets import PacketScene, default_device  # Numba takes 0.4 s to import

        self._scene = PacketScene(default_device(), vertices.astype(np.float32), faces, cutouts)

    def hits(self, origins: Vectors, directions: Vectors, reach: Vectors | float) -> Hits:
        """The nearest triangle within reach of each ray."""
        return Hits(*self._scene.intersect(*_rays(origins, directions, reach)))

    def occluded(self, origins: Vectors, directions: Vectors, reach: Vectors | float) -> Mask:
        """(N,) bool: whether any triangle lies within reach."""
        return self._scene.occluded(*_rays(origins, directions, reach))


def tracer_of(geometry: Geometry) -> Tracer:
    """A tracer of all triangles."""
    return Tracer(geometry.vertices, geometry.faces, geometry.cutouts)


def _rays(origins: Vectors, directions: Vectors, reach: Vectors | float) -> tuple[Singles, Singles, Singles]:
    """(3, N) origins, (3, N) or (3, 1) directions and (N,) reach, float32 and C-contiguous."""
    if origins.shape[1:] != (3,) or directions.shape not in (origins.shape, (1, 3)):
        raise ValueError(f"origins of shape {origins.shape}, directions of shape {directions.shape}")
    reaches = np.broadcast_to(np.asarray(reach, dtype=np.float32), len(origins))
    return _contiguous(origins.T), _contiguous(directions.T), _contiguous(reaches)


def _contiguous(values: Vectors) -> Singles:
    return np.ascontiguousarray(values, dtype=np.float32)


def packet_width() -> int:
    """Rays that are traced together here: those of the widest native packet."""
    from shadowbench.truths.packets import default_device

    return default_device().width


@cache
def answers_digest() -> str:
    """Hex digest of the distances of fixed rays, whose last bits depend on the processor.

    Embree rounds once where it multiplies and adds in one instruction, and begins divisions by the processor's own
    estimates. Few rays of a truth are decided by such a bit: some samples of soft shadows, and `blocker`.
    """
    point: Floats = np.outer(np.arange(1, 1 << 13), np.sqrt([2.0, 3.0, 5.0, 7.0, 11.0, 13.0])) % 1
    first, along, across = point[:1800, :3].reshape(3, -1, 3)
    corners = np.stack([first, first + along / 5, first + across / 5], axis=1).reshape(-1, 3)
    tracer = Tracer(corners, np.arange(len(corners), dtype=np.int32).reshape(-1, 3))
    return hashlib.sha256(tracer.hits(point[:, :3], point[:, 3:] - 0.5, INFINITE).distance.tobytes()).hexdigest()


def rows_a_slice(width: int) -> int:
    """Rows of an image that make a slice of about RAYS_A_SLICE rays."""
    return max(1, RAYS_A_SLICE // width)


def over_slices(work: Callable[[slice], Result], count: int, size: int = RAYS_A_SLICE) -> Iterator[Result]:
    """Results of `work` on slices of `count` items, in order, one thread per core; Embree and NumPy release the GIL."""
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        yield from pool.map(work, in_slices(count, size))
