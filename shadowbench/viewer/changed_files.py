"""Files that the window shows, and whether they have changed on disk."""

import time
from collections.abc import Iterable, Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from shadowbench.errors import InputError
from shadowbench.files import data_folder
from shadowbench.scenes.files import read_document
from shadowbench.scenes.library import builtin_names
from shadowbench.viewer.state import Origin

EVERY_S = 0.5
"""How often files are looked at, in seconds."""
_SHADERS = (".glsl", ".vert", ".frag", ".geom")


@dataclass(frozen=True)
class Changes:
    """What has changed: any of the scene's files, any shader, plug-ins."""

    scene: bool = False
    shaders: bool = False
    plugins: tuple[Path, ...] = ()


class ChangedFiles:
    """Looks at the modification times of a scene's files, of plug-ins and of shaders, theirs included."""

    def __init__(self, origin: Origin | None, plugins: Iterable[Path] = ()) -> None:
        self._scene = [] if origin is None else scene_files(origin)
        self._plugins = list(plugins)
        self._folders = [plugin.resolve().parent for plugin in self._plugins]
        self._times, self._looked = self._modified(), time.monotonic()

    def changed(self) -> Changes:
        """What has changed since the last call; nothing if that was a moment ago."""
        if time.monotonic() - self._looked < EVERY_S:
            return Changes()
        before, self._times, self._looked = self._times, self._modified(), time.monotonic()
        changed = {file for file in {*before, *self._times} if before.get(file) != self._times.get(file)}
        return Changes(
            any(file in self._scene for file in changed),
            any(file.suffix in _SHADERS for file in changed),
            tuple(file for file in self._plugins if file in changed),
        )

    def _modified(self) -> Mapping[Path, int]:
        near = [file for folder in self._folders for pattern in ("*", "*/*") for file in folder.glob(pattern)]
        files = [file for file in (*data_folder("shaders").rglob("*"), *near) if file.suffix in _SHADERS]
        times = {}
        for file in (*self._scene, *self._plugins, *files):
            with suppress(OSError):  # removed, as an editor does while it saves
                times[file] = file.stat().st_mtime_ns
        return times


def scene_files(origin: Origin) -> list[Path]:
    """A scene's file and the meshes that it names; of a file that cannot be read only that."""
    if origin.source in builtin_names():
        return [data_folder("scenes") / f"{origin.source}.toml"]
    file, tables = Path(origin.source), []
    if file.suffix.lower() == ".toml":
        with suppress(InputError):
            tables = read_document(file).mesh
    folders = [file.parent, *([origin.assets] if origin.assets else [])]
    names = [str(table["file"]) for table in tables if isinstance(table.get("file"), str)]
    return [file, *(folder / name for folder in folders for name in names)]
