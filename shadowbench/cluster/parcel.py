"""Blocks and plug-ins by value, for processes that share no files with this one."""

import io
import pickle
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from shadowbench.measure.failures import Limits
from shadowbench.measure.keys import plugin_folder, plugin_sources
from shadowbench.techniques.spec import Spec, parse_spec

if TYPE_CHECKING:
    from shadowbench.techniques.base import Technique


class _Pickler(pickle.Pickler):
    """Pickler that writes specs as text: the classes of plug-ins have no name that another process knows."""

    def persistent_id(self, thing: object) -> str | None:
        return thing.full_text if isinstance(thing, Spec) else None


class _Unpickler(pickle.Unpickler):
    def __init__(self, data: bytes, techniques: "Mapping[str, type[Technique]]") -> None:
        super().__init__(io.BytesIO(data))
        self._techniques = techniques

    def persistent_load(self, text: str) -> Spec:
        return parse_spec(text, self._techniques)


def pack(thing: object) -> bytes:
    """A thing as bytes."""
    stream = io.BytesIO()
    _Pickler(stream, pickle.HIGHEST_PROTOCOL).dump(thing)
    return stream.getvalue()


def unpack(data: bytes, techniques: "Mapping[str, type[Technique]]") -> Any:
    """The thing of `pack`; techniques: those that its specs name."""
    return _Unpickler(data, techniques).load()


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
