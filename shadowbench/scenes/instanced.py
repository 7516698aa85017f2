"""Triangles of meshes that share theirs: far more than memory holds, and so computed where they are asked for.

All arithmetic is that of expanded meshes, in float64 and in the same order, so that every number is the same to the
bit.
"""

import hashlib
from collections.abc import Iterator, Sequence
from functools import cached_property
from typing import TYPE_CHECKING, NoReturn

import numpy as np
from numpy.typing import NDArray

from shadowbench.errors import TooLarge
from shadowbench.scenes.geometry import Faces, Floats, Geometry, Triangles, bounds_of, moved
from shadowbench.scenes.mesh import distinct, shared_key
from shadowbench.scenes.normals import turned
from shadowbench.scenes.textures import TexturedFaces

if TYPE_CHECKING:
    from shadowbench.scenes.mesh import Mesh

Indices = NDArray[np.intp]


class InstancedGeometry(Geometry):
    """All triangles of a scene with instances, meshes in turn; an index identifies a triangle.

    sources: the first mesh of each list of triangles; source: (M,) of each mesh, its index among those; first: (M + 1,)
    index of each mesh's first triangle, and at the end their number. points (P, 3) float64 and source_faces (S, 3)
    int32: those of all sources; offset: (M,) index of the first face of each mesh; moves: (L, M, 4, 4) matrices that
    move the points of each mesh in turn. The arrays of all triangles, which a `Geometry` has, raise TooLarge.
    """

    meshes: "tuple[Mesh, ...]"
    sources: "list[Mesh]"
    source: Indices
    first: Indices
    points: Floats
    source_faces: Faces
    offset: Indices
    moves: Floats
    mesh_casts: NDArray[np.bool_]
    mesh_receives: NDArray[np.bool_]
    cutouts = corner_normals = None

    def __init__(self, meshes: "Sequence[Mesh]") -> None:
        sources = distinct(meshes)
        number = {shared_key(mesh): index for index, mesh in enumerate(sources)}
        source = np.array([number[shared_key(mesh)] for mesh in meshes])
        points = np.cumsum([0, *(len(mesh.points) for mesh in sources[:-1])])
        faces = np.cumsum([0, *(len(mesh.faces) for mesh in sources[:-1])])
        chains = [[*mesh.moves, *(() if mesh.placement is None else (mesh.placement.matrix,))] for mesh in meshes]
        longest = max(map(len, chains))
        padded = [[*chain, *[np.eye(4)] * (longest - len(chain))] for chain in chains]  # which changes no bit
        self.__dict__.update(
            meshes=tuple(meshes),
            sources=sources,
            source=source,
            first=np.cumsum([0, *(len(mesh.faces) for mesh in meshes)]),
            points=np.concatenate([mesh.points for mesh in sources]),
            source_faces=np.concatenate(
                [mesh.faces + first for mesh, first in zip(sources, points, strict=True)], dtype=np.int32
            ),
            offset=faces[source],
            moves=np.array(padded).swapaxes(0, 1),
            mesh_casts=np.array([mesh.casts for mesh in meshes]),
            mesh_receives=np.array([mesh.receives for mesh in meshes]),
        )

    @property
    def count(self) -> int:
        """Number of triangles."""
        return int(self.first[-1])

    @cached_property
    def caster_count(self) -> int:
        """Number of casters."""
        return int(np.diff(self.first)[self.mesh_casts].sum())

    @property
    def smooth(self) -> bool:
        """Whether any surface is."""
        return any(mesh.normals is not None for mesh in self.sources)

    @property
    def textured(self) -> tuple[TexturedFaces, ...]:
        """Those of the sources."""
        return tuple(
            TexturedFaces(0, mesh.texture, mesh.coordinates)
            for mesh in self.sources
            if mesh.texture is not None and mesh.coordinates is not None
        )

    @cached_property
    def mesh_bounds(self) -> Floats:
        """(M, 2, 3) lowest and highest corner of each mesh."""
        return np.array([mesh.bounds for mesh in self.meshes])

    @cached_property
    def bounds(self) -> Floats:
        """See `Geometry`."""
        return bounds_of(self.mesh_bounds.reshape(-1, 3))

    @cached_property
    def caster_bounds(self) -> Floats:
        """See `Geometry`."""
        return bounds_of(self.mesh_bounds[self.mesh_casts].reshape(-1, 3))

    def mesh_of(self, triangles: Indices) -> Indices:
        """(N,) index of the mesh of triangles."""
        mesh: Indices = np.searchsorted(self.first, triangles, side="right") - 1
        return mesh

    def triangle_of_caster(self, casters: NDArray[np.integer]) -> Indices:
        """See `Geometry`."""
        return casters.astype(np.intp)

    def casters_near(self, point: Floats, reach: float) -> Iterator[Triangles]:
        """See `Geometry`; nearest first."""
        low, high = self.mesh_bounds.swapaxes(0, 1)
        away = np.maximum(np.maximum(low - point, point - high), 0.0).max(axis=1)
        for number in np.argsort(away, kind="stable"):
            if self.mesh_casts[number] and away[number] <= reach:
                yield Triangles(self.meshes[number].vertices, self.meshes[number].faces)

    def corners(self, triangles: Indices) -> Floats:
        """See `Geometry`."""
        mesh = self.mesh_of(triangles)
        corners: Floats = self.points[self.source_faces[self.offset[mesh] + triangles - self.first[mesh]]]
        for matrices in self.moves:
            corners = moved(corners, matrices[mesh][:, np.newaxis])
        return corners

    def receives_at(self, triangles: Indices) -> NDArray[np.bool_]:
        """See `Geometry`."""
        receives: NDArray[np.bool_] = self.mesh_receives[self.mesh_of(triangles)]
        return receives & (triangles >= 0)

    def select(self, triangles: Indices) -> Geometry:
        """See `Geometry`; with their textures."""
        mesh, count = self.mesh_of(triangles), len(triangles)
        colors, normals = np.empty((count, 3)), np.zeros((count, 3, 3), dtype=np.float32)
        textured = []
        first = np.searchsorted(mesh, np.arange(len(self.meshes) + 1))
        for number in np.unique(mesh):
            one, rows = self.meshes[number], slice(first[number], first[number + 1])
            own = triangles[rows] - self.first[number]
            colors[rows] = one.color if one.tints is None else np.array(one.color) * one.tints[own]
            if one.normals is not None:
                normals[rows] = one.normals[own]
                for matrix in one.moves:
                    normals[rows] = turned(normals[rows], matrix)
            if one.texture is not None and one.coordinates is not None:
                textured.append(TexturedFaces(rows.start, one.texture, one.coordinates[own]))
        return Geometry(
            self.corners(triangles).reshape(-1, 3),
            np.arange(3 * count, dtype=np.int32).reshape(-1, 3),
            casts=self.mesh_casts[mesh],
            receives=self.mesh_receives[mesh],
            planar=np.array([each.planar for each in self.meshes])[mesh],
            colors=colors,
            corner_normals=normals if self.smooth else None,
            textured=tuple(textured),
        )

    def digest(self) -> str:
        """Hex digest of all that affects shadows, without moving a point."""
        digest = hashlib.sha256(repr([(mesh.casts, mesh.receives, mesh.planar) for mesh in self.meshes]).encode())
        arrays = [array for mesh in self.sources for array in (mesh.points, mesh.faces, mesh.normals)]
        for array in (self.source, self.moves, *(array for array in arrays if array is not None)):
            digest.update(repr((array.shape, array.dtype.str)).encode())
            digest.update(np.ascontiguousarray(array).tobytes())
        return digest.hexdigest()


def _refuse(geometry: InstancedGeometry) -> NoReturn:
    triangles = f"{geometry.count} triangles as instances of {len(geometry.source_faces)}"
    raise TooLarge(f"the scene has {triangles}: more than can be in one list, which this needs")


for _name in (
    "vertices", "faces", "casts", "receives", "planar", "colors", "crosses", "normals", "shading_normals",
    "caster_faces", "is_cut_out", "caster_cutouts",
):  # fmt: skip
    setattr(InstancedGeometry, _name, property(_refuse))
