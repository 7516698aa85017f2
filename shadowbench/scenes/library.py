"""Scenes by name or path: a built-in scene, a scene file, or a mesh file."""

import os
from dataclasses import replace
from pathlib import Path

import numpy as np

from shadowbench.errors import InputError, NotInFile, alternatives
from shadowbench.files import data_folder
from shadowbench.scenes.assumed import assumed_ground, mesh_bounds, with_assumptions
from shadowbench.scenes.contents import BY_DEFAULT, Chosen
from shadowbench.scenes.files import SceneFile, read_document, read_scene_file
from shadowbench.scenes.meshes import GLTF_SUFFIXES, MESH_SUFFIXES, USD_SUFFIXES, read_meshes
from shadowbench.scenes.model import Scene
from shadowbench.scenes.tables import NAME, NAMES, name_from

LONGEST_PATH = 4096
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
        raise NotInFile(
            f"--time, --clip: {text:.200} is no glTF file; allowed for {' and '.join(GLTF_SUFFIXES)}; a scene file has "
            "time and clip in its [[mesh]] tables"
        )
    if text in builtin_names():
        return read_scene_file(data_folder("scenes") / f"{text}.toml", assets)
    path = Path(text)
    suffix = path.suffix.lower()
    if "\0" in text or not text or len(text) > LONGEST_PATH:
        raise InputError(f"scene {text!r:.60}: neither a built-in scene nor a path")
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


def _read_mesh_scene(path: Path, up: str | None, chosen: Chosen) -> Scene:
    """The scene of a mesh file: its own cameras and lights, and defaults, with notes, for those it has not."""
    name = name_from(path.stem)
    if not NAME.fullmatch(name):
        raise InputError(
            f"{path.name!r:.90}: the scene of a mesh file is named after it; rename the file to {NAMES}, "
            f'or name it in a scene file with name = "…"'
        )
    scene = read_meshes(path, chosen=chosen)
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
