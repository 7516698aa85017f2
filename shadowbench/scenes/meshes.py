"""Mesh files: instances placed, welded, without zero-area triangles.

trimesh reads STL. It is lenient: it empties what it cannot decode and logs what it loses. This is the one boundary at
which exceptions, warnings and silences of readers become an InputError of one line.
"""

import io
import logging
import warnings
from codecs import BOM_UTF8
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import trimesh
from numpy.typing import NDArray

from shadowbench.errors import InputError
from shadowbench.scenes import gltf
from shadowbench.scenes.declared import checked_stl
from shadowbench.scenes.gltf_bytes import read_primitives
from shadowbench.scenes.gltf_layout import checked_layout
from shadowbench.scenes.gltf_schema import Layout, Primitive
from shadowbench.scenes.model import Camera, Floats, Light, Mesh, Vec3, vec3
from shadowbench.scenes.obj import read_obj
from shadowbench.scenes.off import read_off
from shadowbench.scenes.ply import read_ply
from shadowbench.scenes.polygons import triangulated
from shadowbench.scenes.triangles import (
    MOST_TRIANGLES,
    Triangles,
    check_indices,
    checked,
    transformed,
    welded,
    without_zero_area,
)

MESH_SUFFIXES = (".glb", ".gltf", ".obj", ".ply", ".stl", ".off")
READERS = {".obj": read_obj, ".off": read_off, ".ply": read_ply}
GREY: Vec3 = (0.8, 0.8, 0.8)
NAMELESS = "geometry_0"
"""What trimesh calls the only body of bytes that name none."""
HARMLESS = ("image", "face_normals", "vertex_normals", "texture", "material")
"""Words of trimesh's warnings that lose nothing of a shape."""


class Contents(NamedTuple):
    """What a mesh file holds. `dropped` counts zero-area triangles over all instances."""

    meshes: tuple[Mesh, ...]
    cameras: tuple[Camera, ...]
    lights: tuple[Light, ...]
    notes: tuple[str, ...]
    dropped: int


class Part(NamedTuple):
    """Triangles as the file has them, where an instance puts them, and its colour."""

    name: str
    triangles: Triangles
    matrix: Floats
    color: Vec3


def read_meshes(path: Path, where: str | None = None) -> Contents:
    """The meshes of a .glb, .gltf, .obj, .ply, .stl or .off file, with a glTF's own cameras and lights.

    `where` begins each error, the file's name if not given. Raises InputError for a file that is missing, unreadable,
    empty, cut short, of an unknown kind, without triangles, or with coordinates or indices that make no sense.
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
            with _strictly(where):
                if suffix in (".glb", ".gltf"):
                    parts, cameras, lights, notes = _gltf(path, where)
                else:
                    parts, notes = (_stl(path, where), []) if suffix == ".stl" else _polygonal(path, where)
                    cameras, lights = [], []
            return _assembled(parts, cameras, lights, notes, where)
    except InputError:
        raise
    except (Exception, RecursionError) as error:  # a corrupt file makes the readers raise nearly anything
        reason = " ".join(str(error).split())[:160]
        told = f"{type(error).__name__}: {reason}" if reason else type(error).__name__
        raise InputError(f"{where}: cannot be read as {suffix}: {told}") from error


def _assembled(parts: list[Part], cameras: list[Camera], lights: list[Light], notes: list[str], where: str) -> Contents:
    """The parts as world-space meshes; InputError if nothing remains."""
    total = sum(len(part.triangles.faces) for part in parts)
    if total == 0:
        raise InputError(f"{where}: holds no triangles; at least one is needed")
    if total > MOST_TRIANGLES:
        raise InputError(f"{where}: {total} triangles; a scene may have {MOST_TRIANGLES}")
    meshes, dropped = [], 0
    for part in parts:
        placed = checked(transformed(part.triangles, part.matrix), where)
        placed, lost = without_zero_area(placed)
        dropped += lost
        if len(placed.faces):
            placed = _compact(placed)
            meshes.append(Mesh(part.name, placed.vertices, placed.faces, part.color))
    if not meshes:
        raise InputError(f"{where}: all {total} triangles have zero area; at least one must have some")
    return Contents(tuple(meshes), tuple(cameras), tuple(lights), tuple(notes), dropped)


def _compact(triangles: Triangles) -> Triangles:
    """The triangles without vertices that none of them uses."""
    used, faces = np.unique(triangles.faces, return_inverse=True)
    return Triangles(triangles.vertices[used], faces.reshape(-1, 3).astype(np.int32))


def _polygonal(path: Path, where: str) -> tuple[list[Part], list[str]]:
    """An OBJ, PLY or OFF file: a part for each object that it names."""
    polygons = READERS[path.suffix.lower()](path.read_bytes().removeprefix(BOM_UTF8), where)
    checked(Triangles(polygons.vertices, np.zeros((0, 3), dtype=np.int32)), where)
    faces, polygon, notes = triangulated(polygons, where)
    owners = polygons.owners[polygon]
    order = np.argsort(owners, kind="stable")
    bounds = np.searchsorted(owners[order], np.arange(len(polygons.names) + 1))
    parts = [
        Part(name or path.stem, welded(polygons.vertices, faces[order[start:end]]), np.eye(4), GREY)
        for name, start, end in zip(polygons.names, bounds, bounds[1:], strict=False)
        if start < end
    ]
    return parts, [*polygons.notes, *notes]


def _stl(path: Path, where: str) -> list[Part]:
    """An STL file: a part for each solid that it names."""
    # As bytes, so that nothing that the file names is looked for.
    data = io.BytesIO(checked_stl(path.read_bytes(), where))
    data.name = path.name
    scene = trimesh.load_scene(data, file_type="stl", process=False)
    return [
        Part(
            path.stem if name in (path.name, NAMELESS) else str(name),
            _triangles(geometry.vertices, geometry.faces, where),
            np.eye(4),
            GREY,
        )
        for name, geometry in scene.geometry.items()
        if isinstance(geometry, trimesh.Trimesh) and len(geometry.faces)
    ]


def _gltf(path: Path, where: str) -> tuple[list[Part], list[Camera], list[Light], list[str]]:
    """A glTF's instances in the order of its nodes, its cameras and its lights."""
    raw, chunk = gltf.read_json(path)
    layout = checked_layout(raw, where)
    gltf.check_supported(layout, where)
    sources: list[list[tuple[Triangles, Vec3]]] = [[] for _ in layout.meshes]
    for mesh, primitive, positions, corners in read_primitives(layout, chunk, path, where):
        color = _base_color(layout, primitive)
        sources[mesh].append((_triangles(positions, corners, where), color))
    parts, hidden = [], 0
    for node in gltf.nodes_of(layout):
        if node.data.mesh is None:
            continue
        rows = sources[node.data.mesh]
        if not node.visible:
            hidden += sum(len(triangles.faces) for triangles, _ in rows)
        else:
            name = node.data.name or layout.meshes[node.data.mesh].name or "mesh"
            for k, (triangles, color) in enumerate(rows, 1):
                parts.append(Part(name if len(rows) == 1 else f"{name} {k}", triangles, node.matrix, color))
    if hidden and not any(len(part.triangles.faces) for part in parts):
        raise InputError(f"{where}: all {hidden} triangles are of hidden nodes; at least one must be visible")
    cameras, camera_notes = gltf.cameras_of(layout, where)
    lights, light_notes = gltf.lights_of(layout, where)
    return parts, cameras, lights, [*gltf.notes_on(layout, where), *camera_notes, *light_notes]


def _base_color(layout: Layout, primitive: Primitive) -> Vec3:
    """The material's base colour factor, linear already; grey where a texture would give it."""
    if primitive.material is None:
        return GREY
    factor = layout.materials[primitive.material].pbrMetallicRoughness.baseColorFactor
    return GREY if factor is None else vec3(np.clip(factor[:3], 0.0, 1.0))


def _triangles(vertices: NDArray[Any], faces: NDArray[Any], where: str) -> Triangles:
    """Welded float64 triangles, once vertices and indices are known to be sound."""
    vertices = np.asarray(vertices, dtype=np.float64).reshape(-1, 3)
    indices = np.asarray(faces, dtype=np.int64).reshape(-1, 3)
    if len(indices) == 0:
        return Triangles(np.zeros((0, 3)), np.zeros((0, 3), dtype=np.int32))
    check_indices(indices, len(vertices), where)
    return welded(checked(Triangles(vertices, np.zeros((0, 3), dtype=np.int32)), where).vertices, indices)


@contextmanager
def _strictly(where: str) -> Iterator[None]:
    """Whatever trimesh or NumPy says they lost while reading becomes an InputError."""
    lost: list[str] = []

    class Listener(logging.Handler):
        def emit(self, record: logging.LogRecord) -> None:
            message = record.getMessage()
            if not any(word in message for word in HARMLESS):
                lost.append(" ".join(message.split())[:160])

    log, listener = logging.getLogger("trimesh"), Listener(logging.WARNING)
    log.addHandler(listener)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            # A number that NumPy cannot parse ends the text for it, and with it all that follows.
            warnings.filterwarnings("error", message=".*(could not be read to its end|unmatched data).*")
            yield
    finally:
        log.removeHandler(listener)
    if lost:
        raise InputError(f"{where}: would load incompletely: {lost[0]}")
