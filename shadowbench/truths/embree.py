"""Ray queries by Embree: nearest triangle, distance, occlusion.

Embree works in float32, so callers pass local coordinates (a scene diagonal of about 1) and refine hits themselves.
Rays go in packets to the library inside the embreex wheel (`packets`), and where that cannot be loaded, singly
through embreex. Neither checks array bounds; this module alone ensures the shapes and types that they expect.
"""

import hashlib
import os
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from functools import cache
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from shadowbench.scenes.geometry import in_slices
from shadowbench.scenes.vectors import Floats

Result = TypeVar("Result")
Singles = NDArray[np.float32]
Vectors = Floats | Singles

RAYS_A_SLICE = 1 << 15  # float64 temporaries of a slice fit in a core's cache
INFINITE = 1e30  # ray length, in effect infinite: beyond any local scene


class Tracer:
    """Embree scene of one indexed triangle list.

    vertices: (V, 3) float64, local; faces: (F, 3) int32. Rays: origins (N, 3) float, directions (N, 3) or (1, 3) of any
    length; reach: (N,) or a number. Reach and distances are in multiples of the direction's length. Arrays whose
    transpose is a contiguous float32 array are not copied.
    """

    def __init__(self, vertices: Floats, faces: NDArray[np.int32]) -> None:
        from shadowbench.truths.packets import PacketScene, default_device  # Numba takes 0.4 s to import

        device, corners = default_device(), vertices.astype(np.float32)
        self._scene = EmbreexScene(corners, faces) if device is None else PacketScene(device, corners, faces)

    def nearest(self, origins: Vectors, directions: Vectors, reach: Vectors | float) -> NDArray[np.int32]:
        """(N,) int32 index of the nearest triangle within reach, −1 if none."""
        return self._scene.intersect(*_rays(origins, directions, reach))[0]

    def distance(self, origins: Vectors, directions: Vectors, reach: Vectors | float) -> Singles:
        """(N,) float32 distance to the nearest triangle; `reach` or more if none."""
        return self._scene.intersect(*_rays(origins, directions, reach))[1]

    def occluded(self, origins: Vectors, directions: Vectors, reach: Vectors | float) -> NDArray[np.bool_]:
        """(N,) bool: whether any triangle lies within reach."""
        return self._scene.occluded(*_rays(origins, directions, reach))


def _rays(origins: Vectors, directions: Vectors, reach: Vectors | float) -> tuple[Singles, Singles, Singles]:
    """(3, N) origins, (3, N) or (3, 1) directions and (N,) reach, float32 and C-contiguous."""
    if origins.shape[1:] != (3,) or directions.shape not in (origins.shape, (1, 3)):
        raise ValueError(f"origins of shape {origins.shape}, directions of shape {directions.shape}")
    reaches = np.broadcast_to(np.asarray(reach, dtype=np.float32), len(origins))
    return _contiguous(origins.T), _contiguous(directions.T), _contiguous(reaches)


def _contiguous(values: Vectors) -> Singles:
    return np.ascontiguousarray(values, dtype=np.float32)


class EmbreexScene:
    """Single-ray queries through embreex, with the arguments and results of a `PacketScene`."""

    def __init__(self, vertices: Singles, faces: NDArray[np.int32]) -> None:
        # Imported here: a stored truth is scored without Embree.
        from embreex.mesh_construction import TriangleMesh
        from embreex.rtcore_scene import EmbreeScene

        self._scene = EmbreeScene(robust=True)
        if len(faces):
            TriangleMesh(self._scene, vertices, np.ascontiguousarray(faces, dtype=np.int32))
        # The first query builds the BVH, which must not happen in several threads at once.
        self.occluded(np.zeros((3, 1), np.float32), np.ones((3, 1), np.float32), np.ones(1, np.float32))

    def intersect(self, origins: Singles, directions: Singles, reach: Singles) -> tuple[NDArray[np.int32], Singles]:
        """(N,) index of the nearest triangle, −1 if none, and its distance, `reach` if none."""
        triangle = self._run(origins, directions, reach, "INTERSECT").astype(np.int32)
        return triangle, self._run(origins, directions, reach, "DISTANCE")

    def occluded(self, origins: Singles, directions: Singles, reach: Singles) -> NDArray[np.bool_]:
        """(N,) whether any triangle lies within reach."""
        blocked: NDArray[np.bool_] = self._run(origins, directions, reach, "OCCLUDED") == 0
        return blocked

    def _run(self, origins: Singles, directions: Singles, reach: Singles, query: str) -> Singles:
        if not len(reach):
            return np.empty(0, dtype=np.float32)
        rays = _contiguous(origins.T), _contiguous(directions.T)
        answer: Singles = self._scene.run(*rays, dists=reach.copy(), query=query)  # Embree writes into `dists`
        return answer


def packet_width() -> int:
    """Rays that are traced together here: those of the widest native packet; 1 through embreex."""
    from shadowbench.truths.packets import default_device

    device = default_device()
    return 1 if device is None else device.width


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
    return hashlib.sha256(tracer.distance(point[:, :3], point[:, 3:] - 0.5, INFINITE).tobytes()).hexdigest()


def rows_a_slice(width: int) -> int:
    """Rows of an image that make a slice of about RAYS_A_SLICE rays."""
    return max(1, RAYS_A_SLICE // width)


def over_slices(work: Callable[[slice], Result], count: int, size: int = RAYS_A_SLICE) -> Iterator[Result]:
    """Results of `work` on slices of `count` items, in order, one thread per core; Embree and NumPy release the GIL."""
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        yield from pool.map(work, in_slices(count, size))
