"""What a mesh file holds: meshes with their materials, cameras and lights; and its meshes placed in the world."""

from collections.abc import Sequence
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


def check_count(meshes: Sequence[Mesh], where: str) -> None:
    """Raise InputError that begins with `where` if meshes, each copy counted, have more than MOST_TRIANGLES."""
    count = sum(len(mesh.faces) for mesh in meshes)
    if count > MOST_TRIANGLES:
        raise InputError(f"{where}: {count} triangles, each copy of a mesh counted; a scene may have {MOST_TRIANGLES}")


def placed(instances: Sequence[tuple[Mesh, Floats]], where: str) -> tuple[list[Mesh], int]:
    """The meshes under affine (4, 4) matrices without triangles of zero area, and the number of those.

    Raises InputError that begins with `where` for coordinates that become infinite or too large.
    """
    moved = [transformed(Triangles(mesh.vertices, mesh.faces), matrix) for mesh, matrix in instances]
    first = np.cumsum([0, *(len(each.vertices) for each in moved)])
    faces = np.concatenate([each.faces + start for each, start in zip(moved, first, strict=False)])
    vertices = checked(np.concatenate([each.vertices for each in moved]), where)
    kept = np.split(with_area(Triangles(vertices, faces)), np.cumsum([len(each.faces) for each in moved[:-1]]))
    meshes, dropped = [], 0
    for (mesh, matrix), (vertices, faces), own in zip(instances, moved, kept, strict=True):
        lost = int(len(own) - own.sum())
        dropped += lost
        if lost:  # and without the vertices that only those used
            used, corners = np.unique(faces[own], return_inverse=True)
            vertices, faces = vertices[used], corners.reshape(-1, 3).astype(np.int32)
        if len(faces):
            meshes.append(mesh.reshaped(vertices, faces, matrix, own if lost else None))
    return meshes, dropped
