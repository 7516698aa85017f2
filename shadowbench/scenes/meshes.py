"""Mesh files as world-space meshes, welded and without zero-area triangles.

Here, and only here, exceptions of all readers become a one-line InputError.
"""

from collections.abc import Callable
from pathlib import Path

import numpy as np

from shadowbench.errors import InputError
from shadowbench.scenes.file_contents import BY_DEFAULT, Chosen, Contents, Look, check_count, placed
from shadowbench.scenes.model import Mesh, Scene
from shadowbench.scenes.obj import read_obj
from shadowbench.scenes.ply_off_stl import read_off, read_ply, read_stl
from shadowbench.scenes.polygons import Polygons, triangulated
from shadowbench.scenes.scene_tables import MOST_COPIES
from shadowbench.scenes.triangles import checked, welded
from shadowbench.strict import short

READERS: dict[str, Callable[[bytes, str], Polygons]] = {
    ".ply": read_ply, ".stl": read_stl, ".off": read_off,
}  # fmt: skip
GLTF_SUFFIXES = (".glb", ".gltf")
MESH_SUFFIXES = (*GLTF_SUFFIXES, ".obj", *READERS)
USD_SUFFIXES = (".usd", ".usda", ".usdc", ".usdz")


def read_meshes(path: Path, where: str | None = None, chosen: Chosen = BY_DEFAULT) -> Scene:
    """The meshes of a glTF, OBJ, PLY, STL or OFF file, with the cameras and lights of a glTF.

    where: the beginning of each error message, by default the file's name; chosen: what is taken of it. Raises
    InputError for a file that is missing, unreadable, empty, truncated, of an unknown format, without triangles, or
    with invalid coordinates or indices.
    """
    where = where or path.name
    suffix = path.suffix.lower()
    if suffix in USD_SUFFIXES:
        converters = "Blender, or usdcat with a plug-in that writes glTF"
        raise InputError(f"{where}: USD is not read; convert it to .glb, with {converters}")
    if suffix not in MESH_SUFFIXES:
        raise InputError(f"{where}: unknown kind {path.suffix!r:.20}; allowed: {' '.join(MESH_SUFFIXES)}")
    try:
        if not path.is_file():
            raise InputError(f"{where}: {'is not a file' if path.exists() else 'no such file'}")
        if path.stat().st_size == 0:
            raise InputError(f"{where}: the file is empty")
        if suffix not in GLTF_SUFFIXES and chosen._replace(coordinates=False) != BY_DEFAULT:
            raise InputError(f"{where}: time and clip are for glTF files, which may have them")
        with np.errstate(all="ignore"):
            if suffix in GLTF_SUFFIXES:
                from shadowbench.scenes.gltf import read_gltf  # whose tables take long to import

                contents = read_gltf(path, where, chosen)
            else:
                contents = _polygonal(path, where, chosen.coordinates)
            return _assembled(contents, path.stem, where)
    except InputError:
        raise
    except (Exception, RecursionError) as error:  # a corrupt file makes the readers raise nearly anything
        raise InputError(f"{where}: cannot be read as {suffix}: {type(error).__name__}: {short(error)}") from error


def _polygonal(path: Path, where: str, coordinates: bool) -> Contents:
    """The named objects of an OBJ, PLY, STL or OFF file, and notes on what was left out."""
    suffix, data = path.suffix.lower(), path.read_bytes()
    polygons = read_obj(data, where, path.parent, coordinates) if suffix == ".obj" else READERS[suffix](data, where)
    if not len(polygons.counts) and len(polygons.vertices):
        found = f"holds {len(polygons.vertices)} points, and no triangles"
        raise InputError(f"{where}: {found}; at least one is needed")
    if len(polygons.names) > MOST_COPIES:
        raise InputError(f"{where}: {len(polygons.names)} objects; allowed are at most {MOST_COPIES}")
    checked(polygons.vertices, where)
    corners, polygon, notes = triangulated(polygons, where)
    faces = polygons.corners[corners]
    owners = polygons.owners[polygon]
    order = np.argsort(owners, kind="stable")
    parts = np.split(order, np.searchsorted(owners[order], np.arange(1, len(polygons.names))))
    looks = polygons.looks or [Look()] * len(polygons.names)
    instances = []
    for name, look, part in zip(polygons.names, looks, parts, strict=True):
        if len(part):
            triangles, own = welded(polygons.vertices, faces[part]), corners[part]
            smooth = polygons.normals is not None and polygons.normals[own].any()
            if polygons.coordinates is not None:
                look = look._replace(coordinates=polygons.coordinates[own])
                if look.cutout is not None:
                    look = look._replace(places=look.cutout.places(polygons.coordinates[own]))
            normals = polygons.normals[own] if polygons.normals is not None and smooth else None
            instances.append((Mesh(name or path.stem, *triangles, normals=normals, **look._asdict()), np.eye(4)))
    return Contents(instances, [], [], [*polygons.notes, *notes])


def _assembled(contents: Contents, name: str, where: str) -> Scene:
    """The instances as world-space meshes. Raises InputError if no triangle with an area remains."""
    total = sum(len(mesh.faces) for mesh, _ in contents.instances)
    if total == 0:
        raise InputError(f"{where}: holds no triangles; at least one is needed")
    check_count([mesh for mesh, _ in contents.instances], where)
    meshes, dropped = placed(contents.instances, where)
    if not meshes:
        raise InputError(f"{where}: all {total} triangles have zero area; at least one must have some")
    cameras, lights, notes = contents.cameras, contents.lights, contents.notes
    return Scene(name, tuple(meshes), tuple(cameras), tuple(lights), tuple(notes), dropped)
