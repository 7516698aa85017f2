"""Jobs and plug-ins by value, for processes that share no files with this one."""

import io
import pickle
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from shadowbench.measure.executor import Limits
from shadowbench.measure.keys import plugin_folder, plugin_sources
from shadowbench.scenes.model import Scene
from shadowbench.techniques.spec import Spec, parse_spec

if TYPE_CHECKING:
    from shadowbench.techniques.base import Technique


class _Pickler(pickle.Pickler):
    """Pickler that leaves out scenes, which are sent once, and writes specs as text.

    The classes of plug-ins have no name that another process knows.
    """

    def __init__(self, stream: io.BytesIO) -> None:
        super().__init__(stream, pickle.HIGHEST_PROTOCOL)
        self.scenes: list[Scene] = []

    def persistent_id(self, thing: object) -> tuple[str, str | int] | None:
        if isinstance(thing, Spec):
            return "spec", thing.full_text
        if not isinstance(thing, Scene):
            return None
        known = [n for n, scene in enumerate(self.scenes) if scene is thing]
        if not known:
            self.scenes.append(thing)
        return "scene", known[0] if known else len(self.scenes) - 1


class _Unpickler(pickle.Unpickler):
    def __init__(self, data: bytes, scenes: Sequence[Scene], techniques: "Mapping[str, type[Technique]]") -> None:
        super().__init__(io.BytesIO(data))
        self._scenes, self._techniques = scenes, techniques

    def persistent_load(self, sent: tuple[str, Any]) -> Spec | Scene:
        kind, value = sent
        return parse_spec(value, self._techniques) if kind == "spec" else self._scenes[value]


def pack(thing: object) -> tuple[bytes, list[Scene]]:
    """A thing as bytes, and the scenes that it refers to."""
    stream = io.BytesIO()
    pickler = _Pickler(stream)
    pickler.dump(thing)
    return stream.getvalue(), pickler.scenes


def unpack(data: bytes, scenes: Sequence[Scene], techniques: "Mapping[str, type[Technique]]") -> Any:
    """The thing of `pack`; techniques: those that its specs name."""
    return _Unpickler(data, scenes, techniques).load()


@dataclass(frozen=True)
class PluginFiles:
    """A plug-in's Python file, and by path in its folder all files that its rows' keys depend on."""

    path: str
    files: tuple[tuple[str, bytes], ...]

    @staticmethod
    def of(plugin: Path) -> "PluginFiles":
        """The files of a plug-in, which must exist."""
        plugin = plugin.resolve()
        root = plugin_folder(plugin).parent
        found = dict.fromkeys([plugin, *plugin_sources(plugin)])
        return PluginFiles(
            str(plugin.relative_to(root)), tuple((str(file.relative_to(root)), file.read_bytes()) for file in found)
        )

    def write(self, folder: Path) -> Path:
        """Write the files into a folder; returns the path of the plug-in there."""
        for name, data in self.files:
            file = folder / name
            file.parent.mkdir(parents=True, exist_ok=True)
            file.write_bytes(data)
        return folder / self.path


@dataclass(frozen=True)
class Setup:
    """What a worker process is started with. number: of the program that asks for it."""

    number: str
    plugins: tuple[PluginFiles, ...]
    limits: Limits
