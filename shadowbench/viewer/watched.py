"""The files that the window reads again when they change."""

from collections.abc import Mapping, Sequence
from contextlib import suppress
from pathlib import Path

from shadowbench.errors import InputError
from shadowbench.files import data_folder
from shadowbench.scenes.library import read_document
from shadowbench.viewer.state import Origin

SHADERS = (".glsl", ".vert", ".frag", ".geom")
"""Endings of shaders' files."""


def modified(origin: Origin | None, plugins: Sequence[Path]) -> Mapping[Path, int]:
    """Modification times of a scene's files, of plug-ins and of shaders, theirs included."""
    folders = [plugin.resolve().parent for plugin in plugins]
    near = [file for folder in folders for pattern in ("*", "*/*") for file in folder.glob(pattern)]
    shaders = [file for file in (*data_folder("shaders").rglob("*"), *near) if file.suffix in SHADERS]
    times = {}
    for file in (*scene_files(origin), *plugins, *shaders):
        with suppress(OSError):  # removed, as an editor does while it saves
            times[file] = file.stat().st_mtime_ns
    return times


def scene_files(origin: Origin | None) -> list[Path]:
    """A scene's file and the meshes and masks that it names; of a file that cannot be read only that."""
    if origin is None:
        return []
    tables = []
    if origin.file.suffix.lower() == ".toml":
        with suppress(InputError):
            tables = read_document(origin.file).mesh
    folders = [folder for folder in (origin.file.parent, origin.options.assets) if folder]
    names = [table[key] for table in tables for key in ("file", "mask") if isinstance(table.get(key), str)]
    return [origin.file, *(folder / name for folder in folders for name in names)]
