"""Scenes by name or path: a built-in scene, a scene file, or a mesh file."""

import math
import os
from collections import Counter
from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from itertools import product
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from pydantic import BeforeValidator, Field, ValidationInfo

from shadowbench.errors import InputError, alternatives
from shadowbench.files import data_folder
from shadowbench.scenes.assumed import assumed_ground, mesh_bounds, with_assumptions
from shadowbench.scenes.cutouts import Cutout, Wrap, cut_out
from shadowbench.scenes.file_contents import BY_DEFAULT, Chosen, check_count, placed
from shadowbench.scenes.images import mask_of, read_image
from shadowbench.scenes.meshes import GLTF_SUFFIXES, MESH_SUFFIXES, USD_SUFFIXES, read_meshes
from shadowbench.scenes.model import Camera, Light, Mesh, Scene
from shadowbench.scenes.scene_tables import (
    MOST_COPIES,
    MOST_NAMED,
    NAME,
    NAMES,
    MeshTable,
    Name,
    camera_from_table,
    light_from_table,
    name_from,
)
from shadowbench.scenes.sequences import motion_from_table
from shadowbench.scenes.shapes import WITH_COORDINATES, build_shape, shape_table
from shadowbench.scenes.triangles import Triangles, mean_normals
from shadowbench.scenes.vectors import Floats
from shadowbench.strict import Strict, read_toml, short, validated


def _listed(value: object, info: ValidationInfo) -> object:
    """One `[camera]` or `[light]` as a list of one."""
    if isinstance(value, dict) and info.field_name in ("mesh", "sequence"):
        raise ValueError(f"found a table; allowed: tables, written [[{info.field_name}]]")
    return [value] if isinstance(value, dict) else value


Tables = Annotated[list[dict[str, Any]], BeforeValidator(_listed)]


class SceneFile(Strict):
    """The top level of a scene file; its tables are validated separately."""

    name: Name | None = None
    about: str = Field("", max_length=200, strict=True)
    camera: Tables = Field([], max_length=MOST_NAMED)
    light: Tables = Field([], max_length=MOST_NAMED)
    mesh: Tables = Field([], max_length=MOST_COPIES)
    sequence: Tables = Field([], max_length=MOST_NAMED)
    viewer: dict[str, object] = Field({})  # what `shadowbench view` showed when it saved the file

    def cameras(self, file: str) -> list[Camera]:
        """The cameras of its tables. Raises InputError that begins with the file's name."""
        return [camera_from_table(*each) for each in _named_tables(self.camera, "camera", file)]

    def lights(self, file: str) -> list[Light]:
        """The lights of its tables. Raises InputError that begins with the file's name."""
        return [light_from_table(*each) for each in _named_tables(self.light, "light", file)]


def _named_tables(tables: list[dict[str, Any]], kind: str, file: str) -> Iterator[tuple[dict[str, Any], str, str]]:
    """Each table with the beginning of its error messages and its default name. Raises InputError for names in use."""
    names = []
    for number, table in enumerate(tables, 1):
        title = f"[{kind}]" if len(tables) == 1 else f"[[{kind}]] {number}"
        default = kind if number == 1 else f"{kind}-{number}"
        names.append(str(table.get("name", default)))
        yield table, f"{file}: {title}", default
    name, times = Counter(names).most_common(1)[0] if names else ("", 0)
    if times > 1:
        raise InputError(f"{file}: [[{kind}]]: name {name!r} is used {times} times; names must differ")


def read_document(path: Path) -> SceneFile:
    """The validated top level of a scene file. Raises InputError if it is unreadable or not TOML."""
    return validated(SceneFile, read_toml(path, path.name), path.name)


def read_scene_file(path: Path, assets: Path | None = None, later: float = 0.0) -> Scene:
    """The scene of a TOML file, with a default camera and light if it has none.

    assets: a second folder for its mesh files; later: seconds from the poses of the file to those of its meshes. Raises
    InputError for an invalid file.
    """
    document = read_document(path)
    name = document.name or path.stem
    if not NAME.fullmatch(name):
        raise InputError(
            f"{path.name!r:.90}: a scene without a name is named after its file; "
            f'rename the file or add name = "…" at its top, {NAMES}'
        )
    cameras, lights = document.cameras(path.name), document.lights(path.name)
    if not document.mesh:
        raise InputError(f"{path.name}: mesh: found none; at least one [[mesh]] is needed")
    files = _Files(path, assets)
    tables: list[tuple[list[tuple[Mesh, Floats]], str]] = []
    dropped = copies = 0
    for number, raw in enumerate(document.mesh, 1):
        where = f"{path.name}: [[mesh]] {number}"
        table, sources, lost = _sources(_posed(raw, later), files, where)
        repeats = math.prod(row.count for row in table.repeat)
        copies += repeats * len(sources)
        if copies > MOST_COPIES:
            raise InputError(f"{where}: {copies} meshes by now, each copy counted; allowed are at most {MOST_COPIES}")
        tables.append((list(_copies(table, sources)), where))
        dropped += lost
    check_count([mesh for instances, _ in tables for mesh, _ in instances], path.name)
    meshes: list[Mesh] = []
    for instances, where in tables:
        more, flat = placed(instances, where)
        meshes += more
        dropped += flat
    if not meshes:
        raise InputError(f"{path.name}: all {dropped} triangles have zero area; at least one must have some")
    notes = [note for contents in files.read.values() for note in contents.notes]
    scene = Scene(name, tuple(meshes), tuple(cameras), tuple(lights), tuple(notes), dropped)
    named = _named_tables(document.sequence, "sequence", path.name)
    motions = tuple(motion_from_table(table, meshes, where) for table, where, _ in named)
    scene = replace(scene, motions=motions, posed=partial(read_scene_file, path, assets))
    return with_assumptions(scene, mesh_bounds(meshes, path.name), path.name)


def _posed(raw: dict[str, Any], later: float) -> dict[str, Any]:
    """A mesh's table with the pose of some seconds later: of a glTF, or of the shape `walker`, a stride a second."""
    if not later:
        return raw
    if raw.get("shape") == "walker":
        return {**raw, "phase": (raw.get("phase", 0.1) + later) % 1.0}
    posed = Path(str(raw.get("file"))).suffix.lower() in GLTF_SUFFIXES
    return {**raw, "time": (raw.get("time") or 0.0) + later} if posed else raw


def _sources(raw: dict[str, Any], files: "_Files", where: str) -> tuple[MeshTable, tuple[Mesh, ...], int]:
    """The validated table, its shape's or file's meshes in object space, and the zero-area triangles of the file."""
    shape = raw.get("shape")
    model = shape_table(shape, MeshTable, where) if isinstance(shape, str) and shape else MeshTable
    table = validated(model, raw, where)
    meshes, dropped = files.meshes(table, where) if table.file is not None else ((_shaped(table, raw, where),), 0)
    return table, meshes if table.mask is None else files.masked(table, table.mask, meshes, f"{where}: mask"), dropped


def _shaped(table: MeshTable, raw: dict[str, Any], where: str) -> Mesh:
    """The mesh of a table's shape."""
    parameters = {key: value for key, value in raw.items() if key not in MeshTable.model_fields}
    mesh = build_shape(str(table.shape), parameters, where)
    normals = mean_normals(Triangles(mesh.vertices, mesh.faces)) if table.smooth else None
    return replace(mesh, name=table.name or mesh.name, normals=normals)


def _copies(table: MeshTable, sources: tuple[Mesh, ...]) -> Iterator[tuple[Mesh, Floats]]:
    """All copies of all meshes of a table, each with its (4, 4) object-to-world matrix."""
    matrix = transform_of(table)
    for indices in product(*(range(row.count) for row in table.repeat)):
        moved = matrix.copy()
        moved[:3, 3] += sum(
            (np.multiply(k, row.step) for k, row in zip(indices, table.repeat, strict=True)), np.zeros(3)
        )
        suffix = "".join(f" {k + 1}" for k in indices)
        for mesh in sources:
            name = (mesh.name if table.name is None or len(sources) > 1 else table.name) + suffix
            copy = replace(mesh, name=name, color=table.color or mesh.color)
            yield replace(copy, casts=table.casts, receives=table.receives), moved


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


class _Files:
    """Files that a scene names, read once each. read: mesh files by the arguments of `read_meshes`."""

    def __init__(self, scene: Path, assets: Path | None) -> None:
        self._folders = [folder.resolve() for folder in (scene.parent, assets) if folder is not None]
        self.read: dict[tuple[Path, Chosen], Scene] = {}
        self._cutouts: dict[tuple[object, ...], Cutout] = {}

    def meshes(self, table: MeshTable, where: str) -> tuple[tuple[Mesh, ...], int]:
        """The meshes of a table's file in object space, and the zero-area triangles of the file."""
        file = self._resolved(str(table.file), f"{where}: file")
        key = file, Chosen(table.time, table.clip, table.mask is not None)
        if key not in self.read:
            self.read[key] = read_meshes(file, f"{where}: {table.file}", key[1])
        return self.read[key].meshes, self.read[key].dropped

    def masked(self, table: MeshTable, mask: str, meshes: tuple[Mesh, ...], where: str) -> tuple[Mesh, ...]:
        """The meshes cut out by a table's mask. Raises InputError if one lacks texture coordinates."""
        file = self._resolved(mask, where)
        wrap: Wrap = "repeat" if table.shape is None else "clamp"  # a shape's coordinates reach from 0 to 1
        key = file, table.cutoff, table.mask_filter, wrap
        if key not in self._cutouts:
            alpha = mask_of(read_image(file.read_bytes(), f"{where}: {mask!r:.60}"))
            cutout = cut_out(alpha, 1.0, table.cutoff, table.mask_filter == "nearest", (wrap, wrap))
            if cutout.share == 0.0:
                found = f"below the cutoff {table.cutoff:g} everywhere, so that nothing is left"
                raise InputError(f"{where}: {mask!r:.60} is {found}")
            self._cutouts[key] = cutout
        cutout, masked = self._cutouts[key], []
        for mesh in meshes:
            if mesh.coordinates is None:
                allowed = f"files with them, and the shapes {', '.join(WITH_COORDINATES)}"
                raise InputError(f"{where}: {mesh.name!r:.60} has no texture coordinates; allowed: {allowed}")
            masked.append(replace(mesh, cutout=cutout, places=cutout.places(mesh.coordinates)))
        return tuple(masked)

    def _resolved(self, file: str, where: str) -> Path:
        """The path of a file with links resolved. Raises InputError outside the scene's folder and `assets`."""
        where = f"{where}: {file!r:.200}"
        try:
            for path in [Path(os.path.realpath(folder / file)) for folder in self._folders]:
                if path.is_file() and any(path.is_relative_to(folder) for folder in self._folders):
                    return path
        except (OSError, ValueError) as error:  # a null byte, a name too long
            raise InputError(f"{where} cannot be a path: {short(error)}") from error
        folders = " or ".join(map(str, self._folders))
        raise InputError(f"{where} is not a file in {folders}, or leads outside; --assets DIR gives another folder")


WITHOUT_UP = (".obj", ".ply", ".stl", ".off")
"""Mesh formats that do not specify the up axis; in glTF it is y."""

Z_UP = np.array([[1, 0, 0, 0], [0, 0, 1, 0], [0, -1, 0, 0], [0, 0, 0, 1]], dtype=np.float64)
"""Turns the z axis up."""


def load_scene(
    source: str | Path, assets: Path | None = None, up: str | None = None, chosen: Chosen = BY_DEFAULT
) -> Scene:
    """A built-in scene, the scene of a `.toml`, or that of a mesh file with a default ground, camera and sun.

    assets: a second folder for the meshes of a scene file. up: "y" or "z", the up axis of a mesh file whose format does
    not specify it; chosen: what is taken of a glTF. Raises InputError for an invalid name or file.
    """
    text = str(source)
    if up is not None:
        _check_up(up, text)
    if chosen != BY_DEFAULT and Path(text).suffix.lower() not in GLTF_SUFFIXES:
        raise InputError(
            f"--time, --clip: {text:.200} is no glTF file; allowed for {' and '.join(GLTF_SUFFIXES)}; a scene file has "
            "time and clip in its [[mesh]] tables"
        )
    if text in builtin_names():
        return read_scene_file(data_folder("scenes") / f"{text}.toml", assets)
    path = Path(text)
    suffix = path.suffix.lower()
    if text.encode(errors="ignore").decode() != text:
        raise InputError(f"{text!r:.200}: the path is not valid UTF-8; rename the file or folder")
    if assets is not None and not assets.is_dir():
        raise InputError(f"--assets {assets}: no such folder")
    if suffix == ".toml":
        return read_scene_file(path, assets)
    if suffix in (*MESH_SUFFIXES, *USD_SUFFIXES):
        return _read_mesh_scene(path, up, chosen)
    if isinstance(source, Path) or path.name != text or os.path.lexists(path):
        kinds = " ".join((".toml", *MESH_SUFFIXES))
        raise InputError(f"{text:.200}: unknown kind of file; allowed: a built-in scene's name, or {kinds}")
    raise InputError(f"{text!r:.60} {_not_builtin(text)}")


def _check_up(up: str, source: str) -> None:
    if up not in ("y", "z"):
        raise InputError(f"--up: found {up!r:.60}; allowed: y, z")
    if Path(source).suffix.lower() not in WITHOUT_UP:
        kinds = " ".join(WITHOUT_UP)
        raise InputError(
            f"--up {up}: {source:.200} specifies its up axis; allowed for mesh files that do not ({kinds}); "
            "a scene file rotates its meshes by rotate = [-90, 0, 0]"
        )


def _read_mesh_scene(path: Path, up: str | None, chosen: Chosen, later: float = 0.0) -> Scene:
    """The scene of a mesh file: its own cameras and lights, and defaults, with notes, for those it has not.

    later: seconds from the chosen time of a clip to the pose.
    """
    name = name_from(path.stem)
    if not NAME.fullmatch(name):
        raise InputError(
            f"{path.name!r:.90}: the scene of a mesh file is named after it; rename the file to {NAMES}, "
            f'or name it in a scene file with name = "…"'
        )
    time = (chosen.time or 0.0) + later if later else chosen.time
    scene = read_meshes(path, chosen=chosen._replace(time=time))
    meshes, notes = list(scene.meshes), list(scene.notes)
    if scene.lights:
        notes.append(f"{path.name}: glTF gives lights no size: their shadows are hard")
    if up is None and path.suffix.lower() in WITHOUT_UP:
        notes.append(f"no up axis in {path.name}: assumed y; --up z takes z")
    if up == "z":
        meshes = [mesh.reshaped(mesh.vertices @ Z_UP[:3, :3].T + 0.0, mesh.faces, Z_UP) for mesh in meshes]
    bounds = mesh_bounds(meshes, path.name)
    ground = assumed_ground(meshes, bounds, path.name)
    if ground is not None:
        meshes.append(ground[0])
        notes.append(ground[1])
    scene = replace(scene, name=name, meshes=tuple(meshes), notes=tuple(notes), ground=ground)
    if path.suffix.lower() in GLTF_SUFFIXES:
        scene = replace(scene, posed=partial(_read_mesh_scene, path, up, chosen))
    return with_assumptions(scene, bounds, path.name)


def builtin_names() -> list[str]:
    """Sorted names of the built-in scenes."""
    return sorted(path.stem for path in data_folder("scenes").glob("*.toml"))


def hard_names() -> list[str]:
    """Sorted names of the built-in scenes whose lights have no size."""
    return [name for name in builtin_names() if not any(light.soft for light in _builtin(name).lights(name))]


def builtin_about(name: str) -> str:
    """One line on what a built-in scene tests. Raises InputError for an unknown name."""
    if name not in builtin_names():
        raise InputError(f"{name!r:.60} {_not_builtin(name)}")
    return _builtin(name).about


def builtin_light(name: str) -> str:
    """The kinds of a built-in scene's lights: `directional`, or `directional, soft` for one with a size."""
    kinds = [f"{light.kind}, soft" if light.soft else light.kind for light in _builtin(name).lights(name)]
    return "; ".join(dict.fromkeys(kinds))


def _builtin(name: str) -> SceneFile:
    return read_document(data_folder("scenes") / f"{name}.toml")


def _not_builtin(name: str) -> str:
    return f"is no built-in scene{alternatives(name, builtin_names())}; or a .toml or mesh file"
