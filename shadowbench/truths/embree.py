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
from threading import Lock
from typing import TYPE_CHECKING, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from shadowbench.scenes.cutouts import CutoutFaces
from shadowbench.scenes.triangles import Geometry, in_slices
from shadowbench.scenes.vectors import Floats

if TYPE_CHECKING:
    from shadowbench.geometry.tree import Tree

Mask = NDArray[np.bool_]
Result = TypeVar("Result")
Singles = NDArray[np.float32]
Vectors = Floats | Singles

RAYS_A_SLICE = 1 << 15  # float64 temporaries of a slice fit in a core's cache
INFINITE = 1e30  # ray length, in effect infinite: beyond any local scene


class Hits(NamedTuple):
    """Nearest hits of N rays.

    triangle: (N,) int32, −1 if none; distance: (N,) float32, `reach` if none; left_open: (N,) bool, whether a nearer
    cut-out may or may not be opaque there, by the rounding of its texture coordinates.
    """

    triangle: NDArray[np.int32]
    distance: Singles
    left_open: NDArray[np.bool_]


class Tracer:
    """Embree scene of one indexed triangle list.

    vertices: (V, 3) float64, local; faces: (F, 3) int32; cutouts: those of the faces that are cut out. Rays: origins
    (N, 3) float, directions (N, 3) or (1, 3) of any length; reach: (N,) or a number. Reach and distances are in
    multiples of the direction's length. Arrays whose transpose is a contiguous float32 array are not copied. Rays that
    float32 cannot decide, at cut-outs, are traced again in float64.
    """

    def __init__(self, vertices: Floats, faces: NDArray[np.int32], cutouts: CutoutFaces | None = None) -> None:
        from shadowbench.truths.cutouts import cutout_arrays  # Numba takes 0.4 s to import
        from shadowbench.truths.packets import PacketScene, default_device

        device, corners = default_device(), vertices.astype(np.float32)
        self._vertices, self._faces, self._building = vertices, faces, Lock()
        self._built: Tree | None = None
        self._cut = cutout_arrays(cutouts, vertices, faces)
        self._scene = (
            EmbreexScene(corners, faces, cutouts is not None)
            if device is None
            else PacketScene(device, corners, faces, self._cut)
        )

    def hits(self, origins: Vectors, directions: Vectors, reach: Vectors | float) -> Hits:
        """The nearest triangle within reach of each ray."""
        triangle, distance, flagged = self._scene.intersect(*_rays(origins, directions, reach))
        left_open = np.zeros(len(triangle), dtype=np.bool_)
        if len(again := np.flatnonzero(flagged)):
            triangle[again], distance[again], left_open[again] = self._resolved(
                origins, directions, reach, again, any_hit=False
            )
        return Hits(triangle, distance, left_open)

    def occlusion(self, origins: Vectors, directions: Vectors, reach: Vectors | float) -> tuple[Mask, Mask]:
        """(N,) bool: whether any triangle lies within reach; if none, whether one does that is `left_open`."""
        blocked, flagged = self._scene.occluded(*_rays(origins, directions, reach))
        left_open = np.zeros(len(blocked), dtype=np.bool_)
        if len(flagged) and len(again := np.flatnonzero(flagged & ~blocked)):
            triangle, _, left_open[again] = self._resolved(origins, directions, reach, again, any_hit=True)
            blocked[again] = triangle >= 0
        return blocked, left_open & ~blocked

    def occluded(self, origins: Vectors, directions: Vectors, reach: Vectors | float) -> Mask:
        """(N,) bool: whether any triangle lies within reach."""
        return self.occlusion(origins, directions, reach)[0]

    def _resolved(
        self, origins: Vectors, directions: Vectors, reach: Vectors | float, rays: NDArray[np.intp], any_hit: bool
    ) -> tuple[NDArray[np.int32], Floats, Mask]:
        """See `cutouts.resolve`, for some rays."""
        from shadowbench.truths.cutouts import resolve

        starts, ways = (
            np.broadcast_to(each, origins.shape)[rays].T.astype(np.float64) for each in (origins, directions)
        )
        reaches = np.broadcast_to(np.asarray(reach, dtype=np.float64), len(origins))[rays]
        return resolve(self._tree, self._vertices, self._faces, self._cut, starts, ways, reaches, any_hit)

    @property
    def _tree(self) -> "Tree":
        from shadowbench.geometry.tree import build_tree

        with self._building:  # by the first thread that needs it
            self._built = self._built or build_tree(self._vertices, self._faces)
            return self._built


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


class EmbreexScene:
    """Single-ray queries through embreex, with the arguments and results of a `PacketScene`."""

    def __init__(self, vertices: Singles, faces: NDArray[np.int32], cut_out: bool = False) -> None:
        # Imported here: a stored truth is scored without Embree.
        from embreex.mesh_construction import TriangleMesh
        from embreex.rtcore_scene import EmbreeScene

        self._flag = cut_out  # all rays, as embreex has no filters
        self._scene = EmbreeScene(robust=True)
        if len(faces):
            TriangleMesh(self._scene, vertices, np.ascontiguousarray(faces, dtype=np.int32))
        # The first query builds the BVH, which must not happen in several threads at once.
        self.occluded(np.zeros((3, 1), np.float32), np.ones((3, 1), np.float32), np.ones(1, np.float32))

    def intersect(
        self, origins: Singles, directions: Singles, reach: Singles
    ) -> tuple[NDArray[np.int32], Singles, Mask]:
        """See `PacketScene.intersect`."""
        triangle = self._run(origins, directions, reach, "INTERSECT").astype(np.int32)
        return triangle, self._run(origins, directions, reach, "DISTANCE"), np.full(len(reach), self._flag)

    def occluded(self, origins: Singles, directions: Singles, reach: Singles) -> tuple[Mask, Mask]:
        """See `PacketScene.occluded`."""
        blocked: Mask = self._run(origins, directions, reach, "OCCLUDED") == 0
        return blocked & (not self._flag), np.full(len(reach), self._flag)

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
    return hashlib.sha256(tracer.hits(point[:, :3], point[:, 3:] - 0.5, INFINITE).distance.tobytes()).hexdigest()


def rows_a_slice(width: int) -> int:
    """Rows of an image that make a slice of about RAYS_A_SLICE rays."""
    return max(1, RAYS_A_SLICE // width)


def over_slices(work: Callable[[slice], Result], count: int, size: int = RAYS_A_SLICE) -> Iterator[Result]:
    """Results of `work` on slices of `count` items, in order, one thread per core; Embree and NumPy release the GIL."""
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        yield from pool.map(work, in_slices(count, size))
