"""All meshes of a scene as one list of triangles."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from shadowbench.scenes.cutouts import cutout_faces
from shadowbench.scenes.geometry import Floats, Geometry
from shadowbench.scenes.textures import TexturedFaces

if TYPE_CHECKING:
    from shadowbench.scenes.model import Mesh
    from shadowbench.scenes.vectors import Vec3


def joined(meshes: "Sequence[Mesh]") -> Geometry:
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


def triangle_colors(meshes: "Sequence[Mesh]", colors: "Sequence[Vec3]") -> Floats:
    """(F, 3) linear RGB of the triangles of meshes, given a colour for each."""
    counts = [len(mesh.faces) for mesh in meshes]
    found = np.repeat(np.array(colors, dtype=np.float64), counts, axis=0)
    for mesh, own in zip(meshes, np.split(found, np.cumsum(counts[:-1], dtype=np.int64)), strict=True):
        if mesh.tints is not None:
            own *= mesh.tints
    return found


def _normals(meshes: "Sequence[Mesh]") -> NDArray[np.float32] | None:
    """(F, 3, 3) normals at the corners, zero for flat meshes; None if all are."""
    if all(mesh.normals is None for mesh in meshes):
        return None
    flat = [np.zeros((len(mesh.faces), 3, 3), np.float32) if mesh.normals is None else mesh.normals for mesh in meshes]
    return np.concatenate(flat)
