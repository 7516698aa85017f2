"""What is asked of a mesh file, and what it holds, before its meshes are placed."""

from typing import NamedTuple

import numpy as np

from shadowbench.scenes.model import Camera, Light, Mesh
from shadowbench.scenes.tables import LONGEST_NAME, name_from
from shadowbench.scenes.vectors import Floats, Vec3, vec3


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
