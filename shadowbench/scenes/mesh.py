"""A mesh of a scene, and the triangles of all of them in one list."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from shadowbench.scenes.cutouts import Cutout, cutout_faces
from shadowbench.scenes.geometry import Geometry, bounds_of, mirrors, used_by
from shadowbench.scenes.normals import turned
from shadowbench.scenes.textures import Texture, TexturedFaces
from shadowbench.scenes.vectors import Floats, Vec3

GREY: Vec3 = (0.8, 0.8, 0.8)
WHITE: Vec3 = (1.0, 1.0, 1.0)
CORNERS = ("coordinates", "places", "normals")
"""What a mesh has by corner of a triangle, as vertices at one place are one."""


@dataclass(frozen=True, eq=False)
class Mesh:
    """Triangles of one surface, in world space.

    vertices: (V, 3) float64; faces: (F, 3) int32 indices into them, counter-clockwise seen from outside; both are
    read-only, as results computed from them are cached. color: linear RGB in [0, 1]; casts, receives: whether it casts
    and receives shadows; planar: flagged as a planar receiver. cutout: where it is opaque, None for everywhere; places:
    (F, 3, 2) float32 of the triangles' corners in it, in sub-texels, None for 0. coordinates: (F, 3, 2) float32 texture
    coordinates of the corners, None for 0. normals: (F, 3, 3) float32 of a smooth surface, which it is shaded by; None
    if it is flat, and zero at corners without one. texture, and tints, (F, 3) float32 linear RGB that color is
    multiplied by, are of pictures only.
    """

    name: str
    vertices: Floats = field(repr=False)
    faces: NDArray[np.int32] = field(repr=False)
    color: Vec3 = GREY
    casts: bool = True
    receives: bool = True
    planar: bool = False
    cutout: Cutout | None = None
    coordinates: NDArray[np.float32] | None = field(default=None, repr=False)
    places: NDArray[np.float32] | None = field(default=None, repr=False)
    normals: NDArray[np.float32] | None = field(default=None, repr=False)
    texture: Texture | None = None
    tints: NDArray[np.float32] | None = field(default=None, repr=False)

    def __post_init__(self) -> None:
        for name in ("vertices", "faces", *CORNERS):
            values = getattr(self, name)
            if values is not None:
                view = values.view()
                view.flags.writeable = False
                object.__setattr__(self, name, view)

    @cached_property
    def bounds(self) -> Floats:
        """(2, 3) lowest and highest vertex in use."""
        return bounds_of(used_by(self.faces, self.vertices))

    def reshaped(
        self, vertices: Floats, faces: NDArray[np.int32], matrix: Floats, kept: NDArray[np.bool_] | None = None
    ) -> "Mesh":
        """The mesh with vertices moved by an affine (4, 4) matrix; one that mirrors has reversed the faces' corners.

        kept: (F,) bool, which of its faces these are, by default all.
        """
        corners, tints = {name: values for name in CORNERS if (values := getattr(self, name)) is not None}, self.tints
        if kept is not None:
            corners = {name: values[kept] for name, values in corners.items()}
            tints = None if tints is None else tints[kept]
        if mirrors(matrix):
            corners = {name: values[:, ::-1] for name, values in corners.items()}
        if self.normals is not None:
            corners["normals"] = turned(corners["normals"], matrix)
        return replace(self, vertices=vertices, faces=faces, tints=tints, **corners)

    @cached_property
    def closed(self) -> bool:
        """Whether every edge, after welding by position, is shared by exactly two triangles."""
        import trimesh  # the import takes 0.3 s, and most commands do not need it

        welded = trimesh.Trimesh(self.vertices, self.faces, process=False)
        welded.merge_vertices()
        return bool(welded.is_watertight)


def joined(meshes: Sequence[Mesh]) -> Geometry:
    """The triangles of meshes in turn."""
    offsets = np.cumsum([0, *(len(mesh.vertices) for mesh in meshes[:-1])])
    counts = [len(mesh.faces) for mesh in meshes]
    faces = [mesh.faces + offset for mesh, offset in zip(meshes, offsets, strict=True)]
    return Geometry(
        vertices=np.concatenate([mesh.vertices for mesh in meshes]),
        faces=np.concatenate(faces, dtype=np.int32),
        casts=np.repeat([mesh.casts for mesh in meshes], counts),
        receives=np.repeat([mesh.receives for mesh in meshes], counts),
        planar=np.repeat([mesh.planar for mesh in meshes], counts),
        colors=triangle_colors(meshes, [mesh.color for mesh in meshes]),
        cutouts=cutout_faces([(len(mesh.faces), mesh.cutout, mesh.places) for mesh in meshes]),
        corner_normals=_normals(meshes),
        textured=tuple(
            TexturedFaces(int(first), mesh.texture, mesh.coordinates)
            for first, mesh in zip(np.cumsum([0, *counts[:-1]]), meshes, strict=True)
            if mesh.texture is not None and mesh.coordinates is not None
        ),
    )


def triangle_colors(meshes: Sequence[Mesh], colors: Sequence[Vec3]) -> Floats:
    """(F, 3) linear RGB of the triangles of meshes, given a colour for each."""
    counts = [len(mesh.faces) for mesh in meshes]
    found = np.repeat(np.array(colors, dtype=np.float64), counts, axis=0)
    for mesh, own in zip(meshes, np.split(found, np.cumsum(counts[:-1], dtype=np.int64)), strict=True):
        if mesh.tints is not None:
            own *= mesh.tints
    return found


def _normals(meshes: Sequence[Mesh]) -> NDArray[np.float32] | None:
    """(F, 3, 3) normals at the corners, zero for flat meshes; None if all are."""
    if all(mesh.normals is None for mesh in meshes):
        return None
    flat = [np.zeros((len(mesh.faces), 3, 3), np.float32) if mesh.normals is None else mesh.normals for mesh in meshes]
    return np.concatenate(flat)
