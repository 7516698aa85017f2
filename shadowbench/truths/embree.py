"""Ray queries by Embree: nearest triangle, distance, occlusion.

Embree works in float32, so callers pass local coordinates (a scene diagonal of about 1) and refine hits themselves.
embreex checks no array bounds; this module alone ensures the shapes and types that it expects.
"""

import os
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from typing import TypeVar

import numpy as np
from embreex.mesh_construction import TriangleMesh
from embreex.rtcore_scene import EmbreeScene
from numpy.typing import NDArray

from shadowbench.scenes.geometry import in_slices
from shadowbench.scenes.model import Floats

Result = TypeVar("Result")
Vectors = Floats | NDArray[np.float32]

RAYS_A_SLICE = 1 << 15  # float64 temporaries of a slice fit in a core's cache
INFINITE = 1e30  # ray length, in effect infinite: beyond any local scene


class Tracer:
    """Embree scene of one indexed triangle list.

    vertices: (V, 3) float64, local; faces: (F, 3) int32. Rays: origins and directions (N, 3) float64, or float32 to
    avoid a copy; directions of any length, (1, 3) if shared by all rays; reach: (N,) or a number. Reach and distances
    are in multiples of the direction's length.
    """

    def __init__(self, vertices: Floats, faces: NDArray[np.int32]) -> None:
        self._scene = EmbreeScene(robust=True)
        if len(faces):
            TriangleMesh(self._scene, vertices.astype(np.float32), np.ascontiguousarray(faces, dtype=np.int32))
        # The first query builds the BVH, which must not happen in several threads at once.
        self.nearest(np.zeros((1, 3)), np.ones((1, 3)), 1.0)

    def nearest(self, origins: Vectors, directions: Vectors, reach: Floats | float) -> NDArray[np.int32]:
        """(N,) int32 index of the nearest triangle within reach, −1 if none."""
        return self._run(origins, directions, reach, "INTERSECT").astype(np.int32, copy=False)

    def distance(self, origins: Vectors, directions: Vectors, reach: Floats | float) -> NDArray[np.float32]:
        """(N,) float32 distance to the nearest triangle; `reach` or more if none."""
        return self._run(origins, directions, reach, "DISTANCE")

    def occluded(self, origins: Vectors, directions: Vectors, reach: Floats | float) -> NDArray[np.bool_]:
        """(N,) bool: whether any triangle lies within reach."""
        blocked: NDArray[np.bool_] = self._run(origins, directions, reach, "OCCLUDED") == 0
        return blocked

    def _run(self, origins: Vectors, directions: Vectors, reach: Floats | float, query: str) -> NDArray[np.float32]:
        if len(origins) == 0:
            return np.empty(0, dtype=np.float32)
        lengths = np.full(len(origins), reach, dtype=np.float32)  # a copy: Embree writes into it
        if origins.shape[1:] != (3,) or directions.shape not in (origins.shape, (1, 3)):
            raise ValueError(f"origins of shape {origins.shape}, directions of shape {directions.shape}")
        answer: NDArray[np.float32] = self._scene.run(
            np.ascontiguousarray(origins, dtype=np.float32),
            np.ascontiguousarray(directions, dtype=np.float32),
            dists=lengths,
            query=query,
        )
        return answer


def over_slices(work: Callable[[slice], Result], count: int, size: int = RAYS_A_SLICE) -> Iterator[Result]:
    """Results of `work` on slices of `count` items, in order, one thread per core; Embree and NumPy release the GIL."""
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        yield from pool.map(work, in_slices(count, size))
