"""What a mesh file holds: meshes with their materials, cameras and lights; and its meshes placed in the world."""

from collections.abc import Iterable, Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from shadowbench.errors import InputError
from shadowbench.scenes.cutouts import Cutout
from shadowbench.scenes.model import GREY, Camera, Light, Mesh
from shadowbench.scenes.scene_tables import LONGEST_NAME, name_from
from shadowbench.scenes.triangles import MOST_TRIANGLES, Triangles, checked, transformed, with_area
from shadowbench.scenes.vectors import Floats, Vec3, vec3

BLEND_CUTOFF = 0.5
"""Alpha below which surfaces are cut out whose material mixes them with what is behind."""
OPAQUE = np.full((1, 1), 255, dtype=np.uint8)
"""Alphas of a material without an image."""


class Look(NamedTuple):
    """Fields of `Mesh` of these names."""

    color: Vec3 = GREY
    cutout: Cutout | None = None
    coordinates: NDArray[np.float32] | None = None
    places: NDArray[np.float32] | None = None
    tints: NDArray[np.float32] | None = None


class Chosen(NamedTuple):
    """What is read of a mesh file, all but coordinates of a glTF alone.

    time: in seconds, None for 0; clip: by name or number from 1, or NO_CLIP, None for the first. coordinates: texture
    coordinates too, even if no material needs them.
    """

    time: float | None = None
    clip: str | None = None
    coordinates: bool = False


BY_DEFAULT = Chosen()


class Contents(NamedTuple):
    """Contents of a file: meshes in object space with their (4, 4) object-to-world matrices, cameras, lights, notes."""

    instances: list[tuple[Mesh, Floats]]
    cameras: list[Camera]
    lights: list[Light]
    notes: list[str]


def target_of(position: Floats, forward: Floats) -> Vec3:
    """A point that a camera at a position looks at along a unit vector.

    Its distance scales with the position's coordinates, so that rounding keeps the direction.
    """
    return vec3(position + forward * max(1.0, float(np.linalg.norm(position))))


def unique_name(name: str | None, default: str, taken: set[str]) -> str:
    """A valid name for a scene file, with a number appended if it is taken."""
    plain = candidate = (name_from(name or "") or default)[:LONGEST_NAME]
    number = 2
    while candidate in taken:
        candidate, number = f"{plain[: LONGEST_NAME - len(f'-{number}')]}-{number}", number + 1
    return candidate


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
