"""Mesh files as world-space meshes, welded and without zero-area triangles.

Here, and only here, exceptions of all readers become a one-line InputError.
"""

from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from shadowbench.errors import InputError
from shadowbench.scenes import gltf
from shadowbench.scenes.gltf_bytes import read_primitives
from shadowbench.scenes.gltf_checks import checked_layout
from shadowbench.scenes.gltf_layout import Layout, Primitive
from shadowbench.scenes.model import Camera, Light, Mesh
from shadowbench.scenes.obj import read_obj, read_off
from shadowbench.scenes.ply import read_ply
from shadowbench.scenes.polygons import triangulated
from shadowbench.scenes.stl import read_stl
from shadowbench.scenes.triangles import (
    MOST_TRIANGLES,
    Triangles,
    check_indices,
    checked,
    transformed,
    welded,
    without_zero_area,
)
from shadowbench.scenes.vectors import Floats, Vec3, vec3

MESH_SUFFIXES = (".glb", ".gltf", ".obj", ".ply", ".stl", ".off")
READERS = {".obj": read_obj, ".off": read_off, ".ply": read_ply, ".stl": read_stl}
GREY: Vec3 = (0.8, 0.8, 0.8)


class Contents(NamedTuple):
    """Contents of a mesh file. `dropped`: number of zero-area triangles removed, over all instances."""

    meshes: tuple[Mesh, ...]
    cameras: tuple[Camera, ...]
    lights: tuple[Light, ...]
    notes: tuple[str, ...]
    dropped: int


class MeshInstance(NamedTuple):
    """One instance of a mesh: triangles in object space, (4, 4) object-to-world matrix, linear RGB colour."""

    name: str
    triangles: Triangles
    matrix: Floats
    color: Vec3


def read_meshes(path: Path, where: str | None = None) -> Contents:
    """The meshes of a .glb, .gltf, .obj, .ply, .stl or .off file, with the cameras and lights of a glTF.

    where: the beginning of each error message, by default the file's name. Raises InputError for a file that is
    missing, unreadable, empty, truncated, of an unknown format, without triangles, or with invalid coordinates or
    indices.
    """
    where = where or path.name
    suffix = path.suffix.lower()
    if suffix not in MESH_SUFFIXES:
        raise InputError(f"{where}: unknown kind {path.suffix!r:.20}; allowed: {' '.join(MESH_SUFFIXES)}")
    try:
        if not path.is_file():
            raise InputError(f"{where}: {'is not a file' if path.exists() else 'no such file'}")
        if path.stat().st_size == 0:
            raise InputError(f"{where}: the file is empty")
        with np.errstate(all="ignore"):
            if suffix in (".glb", ".gltf"):
                instances, cameras, lights, notes = _gltf(path, where)
            else:
                (instances, notes), cameras, lights = _polygonal(path, where), [], []
            return _assembled(instances, cameras, lights, notes, where)
    except InputError:
        raise
    except (Exception, RecursionError) as error:  # a corrupt file makes the readers raise nearly anything
        reason = " ".join(str(error).split())[:160]
        cause = f"{type(error).__name__}: {reason}" if reason else type(error).__name__
        raise InputError(f"{where}: cannot be read as {suffix}: {cause}") from error


def _assembled(
    instances: list[MeshInstance], cameras: list[Camera], lights: list[Light], notes: list[str], where: str
) -> Contents:
    """The instances as world-space meshes. Raises InputError if no triangle with an area remains."""
    total = sum(len(instance.triangles.faces) for instance in instances)
    if total == 0:
        raise InputError(f"{where}: holds no triangles; at least one is needed")
    if total > MOST_TRIANGLES:
        raise InputError(f"{where}: {total} triangles; a scene may have {MOST_TRIANGLES}")
    meshes, dropped = [], 0
    for instance in instances:
        placed = checked(transformed(instance.triangles, instance.matrix), where)
        placed, lost = without_zero_area(placed)
        dropped += lost
        if len(placed.faces):
            placed = _compact(placed)
            meshes.append(Mesh(instance.name, placed.vertices, placed.faces, instance.color))
    if not meshes:
        raise InputError(f"{where}: all {total} triangles have zero area; at least one must have some")
    return Contents(tuple(meshes), tuple(cameras), tuple(lights), tuple(notes), dropped)


def _compact(triangles: Triangles) -> Triangles:
    """The triangles without unreferenced vertices."""
    used, faces = np.unique(triangles.faces, return_inverse=True)
    return Triangles(triangles.vertices[used], faces.reshape(-1, 3).astype(np.int32))


def _polygonal(path: Path, where: str) -> tuple[list[MeshInstance], list[str]]:
    """The named objects of an OBJ, PLY, STL or OFF file, and notes on what was left out."""
    polygons = READERS[path.suffix.lower()](path.read_bytes(), where)
    checked(Triangles(polygons.vertices, np.zeros((0, 3), dtype=np.int32)), where)
    faces, polygon, notes = triangulated(polygons, where)
    owners = polygons.owners[polygon]
    order = np.argsort(owners, kind="stable")
    bounds = np.searchsorted(owners[order], np.arange(len(polygons.names) + 1))
    instances = [
        MeshInstance(name or path.stem, welded(polygons.vertices, faces[order[start:end]]), np.eye(4), GREY)
        for name, start, end in zip(polygons.names, bounds, bounds[1:], strict=False)
        if start < end
    ]
    return instances, [*polygons.notes, *notes]


def _gltf(path: Path, where: str) -> tuple[list[MeshInstance], list[Camera], list[Light], list[str]]:
    """The instances of a glTF in the order of its nodes, its cameras, its lights and notes on unsupported features."""
    raw, chunk = gltf.read_json(path)
    layout = checked_layout(raw, where)
    gltf.check_supported(layout, where)
    sources: list[list[tuple[Triangles, Vec3]]] = [[] for _ in layout.meshes]
    for mesh, primitive, positions, corners in read_primitives(layout, chunk, path, where):
        color = _base_color(layout, primitive)
        sources[mesh].append((_triangles(positions, corners, where), color))
    instances, hidden = [], 0
    for node in gltf.nodes_of(layout):
        if node.data.mesh is None:
            continue
        rows = sources[node.data.mesh]
        if not node.visible:
            hidden += sum(len(triangles.faces) for triangles, _ in rows)
        else:
            name = node.data.name or layout.meshes[node.data.mesh].name or "mesh"
            for k, (triangles, color) in enumerate(rows, 1):
                instances.append(MeshInstance(name if len(rows) == 1 else f"{name} {k}", triangles, node.matrix, color))
    if hidden and not any(len(instance.triangles.faces) for instance in instances):
        raise InputError(f"{where}: all {hidden} triangles belong to hidden nodes; at least one must be visible")
    cameras, camera_notes = gltf.cameras_of(layout, where)
    lights, light_notes = gltf.lights_of(layout, where)
    return instances, cameras, lights, [*gltf.notes_on(layout, where), *camera_notes, *light_notes]


def _base_color(layout: Layout, primitive: Primitive) -> Vec3:
    """The material's linear base colour factor; grey without one, as where a texture has the colour."""
    if primitive.material is None:
        return GREY
    factor = layout.materials[primitive.material].pbrMetallicRoughness.baseColorFactor
    return GREY if factor is None else vec3(np.clip(factor[:3], 0.0, 1.0))


def _triangles(vertices: NDArray[Any], faces: NDArray[Any], where: str) -> Triangles:
    """Welded float64 triangles. Raises InputError for invalid coordinates or indices."""
    vertices = np.asarray(vertices, dtype=np.float64).reshape(-1, 3)
    indices = np.asarray(faces, dtype=np.int64).reshape(-1, 3)
    if len(indices) == 0:
        return Triangles(np.zeros((0, 3)), np.zeros((0, 3), dtype=np.int32))
    check_indices(indices, len(vertices), where)
    return welded(checked(Triangles(vertices, np.zeros((0, 3), dtype=np.int32)), where).vertices, indices)
