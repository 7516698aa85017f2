"""Scenes from TOML scene files."""

import math
import os
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import product
from pathlib import Path

import numpy as np
from pydantic import Field, ValidationError

from shadowbench.errors import InputError, alternatives
from shadowbench.scenes.assumed import mesh_bounds, with_assumptions
from shadowbench.scenes.meshes import Contents, read_meshes
from shadowbench.scenes.model import Light, Mesh, Scene
from shadowbench.scenes.shapes import SHAPES, build_shape
from shadowbench.scenes.tables import (
    MOST_COPIES,
    MOST_NAMED,
    NAME,
    NAMES,
    MeshTable,
    Name,
    camera_from_table,
    light_from_table,
)
from shadowbench.scenes.triangles import MOST_TRIANGLES, Triangles, checked, transformed, without_zero_area
from shadowbench.scenes.vectors import Floats
from shadowbench.strict import Strict, explain, read_toml, short


class SceneFile(Strict):
    """The top level of a scene file; its tables are validated separately."""

    name: Name | None = None
    about: str = Field("", max_length=200, strict=True)
    camera: dict[str, object] | list[dict[str, object]] = Field([])
    light: dict[str, object] | list[dict[str, object]] = Field([])
    mesh: list[dict[str, object]] = Field([])
    viewer: dict[str, object] = Field({})  # what `shadowbench view` showed when it saved the file


def read_document(path: Path) -> SceneFile:
    """The validated top level of a scene file. Raises InputError if it is unreadable or not TOML."""
    document = read_toml(path, path.name)
    if "scenes" in document and "mesh" not in document:
        raise InputError(
            f"{path.name}: found a study file; allowed: a scene file, or `shadowbench run --study` with it"
        )
    for key in ("camera", "light", "mesh"):
        value = document.get(key, [])
        tables = value if isinstance(value, list) else [value]
        if not all(isinstance(table, dict) for table in tables) or (key == "mesh" and isinstance(value, dict)):
            raise InputError(f"{path.name}: {key}: found {value!r:.60}; allowed: tables, written [[{key}]]")
        most = MOST_COPIES if key == "mesh" else MOST_NAMED
        if len(tables) > most:
            raise InputError(f"{path.name}: {key}: found {len(tables)} tables; allowed are at most {most}")
    try:
        return SceneFile.model_validate(document)
    except ValidationError as error:
        raise explain(path.name, error) from error


def read_scene_file(path: Path, assets: Path | None = None) -> Scene:
    """The scene of a TOML file, with a default camera and light if it has none.

    assets: a second folder for its mesh files. Raises InputError for an invalid file.
    """
    document = read_document(path)
    name = document.name or path.stem
    if not NAME.fullmatch(name):
        raise InputError(
            f"{path.name!r:.90}: a scene without a name is named after its file; "
            f'rename the file or add name = "…" at its top, {NAMES}'
        )
    cameras = [camera_from_table(*each) for each in _tables(document.camera, "camera", path.name)]
    _check_unique([camera.name for camera in cameras], f"{path.name}: [[camera]]")
    lights = read_lights(document, path.name)
    _check_unique([light.name for light in lights], f"{path.name}: [[light]]")
    if not document.mesh:
        raise InputError(f"{path.name}: mesh: found none; at least one [[mesh]] is needed")
    meshes: list[Mesh] = []
    notes: list[str] = []
    read: dict[Path, Contents] = {}
    dropped = triangles = copies = 0
    for number, raw in enumerate(document.mesh, 1):
        where = f"{path.name}: [[mesh]] {number}"
        table, parameters = _mesh_table(raw, where)
        sources: tuple[Mesh, ...]
        if table.file is None:
            sources, lost = _shape_mesh(table, parameters, where), 0
        else:
            file = _resolved(table.file, path, assets, where)
            if file not in read:  # many tables may use the same large file
                read[file] = read_meshes(file, f"{where}: {table.file}")
                notes.extend(read[file].notes)
            sources, lost = read[file].meshes, read[file].dropped
        repeats = math.prod(row.count for row in table.repeat)
        copies += repeats * len(sources)
        if copies > MOST_COPIES:
            raise InputError(f"{where}: {copies} meshes by now, each copy counted; allowed are at most {MOST_COPIES}")
        triangles += repeats * sum(len(mesh.faces) for mesh in sources)
        if triangles > MOST_TRIANGLES:
            raise InputError(f"{where}: {triangles} triangles by now; a scene may have {MOST_TRIANGLES}")
        dropped += lost
        for mesh in _placed(table, sources, where):
            kept, lost = without_zero_area(Triangles(mesh.vertices, mesh.faces))
            dropped += lost
            if len(kept.faces):
                meshes.append(replace(mesh, vertices=kept.vertices, faces=kept.faces))
    if not meshes:
        raise InputError(f"{path.name}: all {dropped} triangles have zero area; at least one must have some")
    scene = Scene(name, tuple(meshes), tuple(cameras), tuple(lights), tuple(notes), dropped)
    return with_assumptions(scene, mesh_bounds(meshes, path.name), path.name)


def read_lights(document: SceneFile, file: str) -> list[Light]:
    """The lights of a scene file's tables. Raises InputError that begins with the file's name."""
    return [light_from_table(*each) for each in _tables(document.light, "light", file)]


def _tables(
    given: dict[str, object] | list[dict[str, object]], kind: str, file: str
) -> Iterator[tuple[dict[str, object], str, str]]:
    """Each table of cameras or lights, with the beginning of its error messages and its default name."""
    tables = given if isinstance(given, list) else [given]
    for number, table in enumerate(tables, 1):
        title = f"[{kind}]" if len(tables) == 1 else f"[[{kind}]] {number}"
        yield table, f"{file}: {title}", kind if number == 1 else f"{kind}-{number}"


def _mesh_table(raw: dict[str, object], where: str) -> tuple[MeshTable, dict[str, object]]:
    """The validated table, and the unvalidated parameters of its shape."""
    own = {key: value for key, value in raw.items() if key in MeshTable.model_fields or "shape" not in raw}
    try:
        table = MeshTable.model_validate(own)
    except ValidationError as error:
        raise explain(where, error) from error
    return table, {key: value for key, value in raw.items() if key not in own}


def _shape_mesh(table: MeshTable, parameters: dict[str, object], where: str) -> tuple[Mesh]:
    """The mesh of a table's shape, in object space."""
    shape = str(table.shape)
    if shape in SHAPES:
        allowed = [*MeshTable.model_fields, *SHAPES[shape].parameters.model_fields]
        for key in parameters:
            if key not in allowed:
                known = alternatives(key, allowed, f"allowed with {shape}")
                raise InputError(f"{where}: unknown field {key!r:.60}{known}")
    triangles = build_shape(shape, parameters, where)
    return (Mesh(table.name or shape, triangles.vertices, triangles.faces),)


def _placed(table: MeshTable, sources: Sequence[Mesh], where: str) -> Iterator[Mesh]:
    """All copies of all meshes of a table, in world space."""
    matrix = transform_of(table)
    shifts = [np.outer(np.arange(row.count), row.step) for row in table.repeat]
    for indices in product(*(range(len(shift)) for shift in shifts)):
        moved = matrix.copy()
        moved[:3, 3] += sum((shift[k] for shift, k in zip(shifts, indices, strict=True)), np.zeros(3))
        suffix = "".join(f" {k + 1}" for k in indices)
        for mesh in sources:
            triangles = checked(transformed(Triangles(mesh.vertices, mesh.faces), moved), where)
            yield Mesh(
                name=(mesh.name if table.name is None or len(sources) > 1 else table.name) + suffix,
                vertices=triangles.vertices,
                faces=np.ascontiguousarray(triangles.faces),
                color=table.color or mesh.color,
                casts=table.casts,
                receives=table.receives,
                planar=table.planar,
            )


def transform_of(table: MeshTable) -> Floats:
    """(4, 4) float64 object-to-world matrix: scale, rotate about the fixed x, y and z axes in that order, translate."""
    matrix = np.diag([*table.scale, 1.0])
    for axis, degrees in enumerate(table.rotate):
        matrix = _rotation(axis, degrees) @ matrix
    matrix[:3, 3] = table.translate
    return matrix


def _rotation(axis: int, degrees: float) -> Floats:
    """(4, 4) right-handed rotation about a coordinate axis; exact for multiples of 90°."""
    quarter = {0.0: (1.0, 0.0), 90.0: (0.0, 1.0), 180.0: (-1.0, 0.0), 270.0: (0.0, -1.0)}
    turn = math.fmod(math.fmod(degrees, 360.0) + 360.0, 360.0)
    cosine, sine = quarter.get(turn, (math.cos(math.radians(turn)), math.sin(math.radians(turn))))
    i, j = (axis + 1) % 3, (axis + 2) % 3
    matrix = np.eye(4)
    matrix[[i, j, i, j], [i, j, j, i]] = cosine, cosine, -sine, sine
    return matrix


def _resolved(file: str, scene: Path, assets: Path | None, where: str) -> Path:
    """The path of a mesh file with links resolved. Raises InputError outside the scene's folder and `assets`."""
    folders = [scene.parent.resolve()] + ([assets.resolve()] if assets is not None else [])
    try:
        candidates = [Path(os.path.realpath(folder / file)) for folder in folders]
        found = [path for path in candidates if path.is_file()]
    except (OSError, ValueError) as error:  # a null byte, a name too long
        raise InputError(f"{where}: file: {file!r:.60} cannot be a path: {short(error)}") from error
    if not found:
        allowed = f"in {folders[0]}" + (f" or {folders[1]}" if assets is not None else " (or give --assets DIR)")
        raise InputError(f"{where}: file: {file!r} is not a file {allowed}")
    for path in found:
        if any(path.is_relative_to(folder) for folder in folders):
            return path
    raise InputError(
        f"{where}: file: {file!r} leads to {found[0]}, outside {folders[0]}; allowed are that folder and --assets DIR"
    )


def _check_unique(names: list[str], where: str) -> None:
    name, times = Counter(names).most_common(1)[0] if names else ("", 0)
    if times > 1:
        raise InputError(f"{where}: name {name!r} is used {times} times; names must differ")
