"""Meshes placed in the world, without triangles of zero area."""

from collections.abc import Iterable, Iterator

import numpy as np
from numpy.typing import NDArray

from shadowbench.errors import InputError
from shadowbench.scenes.geometry import MOST_TRIANGLES, Triangles, checked, transformed, with_area
from shadowbench.scenes.mesh import Mesh
from shadowbench.scenes.vectors import Floats

_BATCH = 1 << 12
"""Triangles that are looked at together, at least."""


def check_count(meshes: Iterable[Mesh], where: str) -> None:
    """Raise InputError that begins with `where` if meshes, each copy counted, have more than MOST_TRIANGLES."""
    count = sum(len(mesh.faces) for mesh in meshes)
    if count > MOST_TRIANGLES:
        raise InputError(f"{where}: {count} triangles, each copy of a mesh counted; a scene may have {MOST_TRIANGLES}")


def placed(instances: Iterable[tuple[Mesh, Floats]], where: str) -> tuple[list[Mesh], int]:
    """The meshes under affine (4, 4) matrices without triangles of zero area, and the number of those.

    Raises InputError that begins with `where` for coordinates that become infinite or too large.
    """
    meshes, dropped = [], 0
    for mesh, matrix, (vertices, faces), kept in _moved(instances, where):
        lost = int(len(kept) - kept.sum())
        dropped += lost
        if lost:  # and without the vertices that only those used
            used, corners = np.unique(faces[kept], return_inverse=True)
            vertices, faces = vertices[used], corners.reshape(-1, 3).astype(np.int32)
        if len(faces):
            meshes.append(mesh.reshaped(vertices, faces, matrix, kept if lost else None))
    return meshes, dropped


def _moved(
    instances: Iterable[tuple[Mesh, Floats]], where: str
) -> Iterator[tuple[Mesh, Floats, Triangles, NDArray[np.bool_]]]:
    """Meshes, their matrices, their triangles under these, and which have an area; many tiny meshes are one batch."""
    batch = list[tuple[Mesh, Floats, Triangles]]()
    held = 0

    def looked_at() -> Iterator[tuple[Mesh, Floats, Triangles, NDArray[np.bool_]]]:
        vertices = checked(np.concatenate([each.vertices for *_, each in batch]), where)
        first = np.cumsum([0, *(len(each.vertices) for *_, each in batch)])
        ends = np.cumsum([len(each.faces) for *_, each in batch])
        faces = [each.faces + start for (*_, each), start in zip(batch, first, strict=False)]
        kept = np.split(with_area(Triangles(vertices, np.concatenate(faces))), ends[:-1])
        for (mesh, matrix, triangles), own in zip(batch, kept, strict=True):
            yield mesh, matrix, triangles, own

    for mesh, matrix in instances:
        batch.append((mesh, matrix, transformed(Triangles(mesh.vertices, mesh.faces), matrix)))
        held += len(mesh.faces)
        if held >= _BATCH:
            yield from looked_at()
            batch.clear()
            held = 0
    if batch:
        yield from looked_at()
