"""Row keys: hashes of everything a result depends on, so a changed default or shader never reuses old rows."""

import hashlib
import json
import sys
from collections.abc import Sequence
from functools import cache
from pathlib import Path

from shadowbench.data import data_folder
from shadowbench.measure import flips, scoring, session
from shadowbench.measure.cells import Cell
from shadowbench.scenes.digest import view_digest
from shadowbench.scenes.model import Coordinates, View
from shadowbench.sources import PACKAGE, SOURCES, code_digest, files_in
from shadowbench.techniques.base import Technique
from shadowbench.techniques.params import Component
from shadowbench.techniques.registry import own_techniques, source_file
from shadowbench.truths import cache as truths

# Modules that draw, score and trace; hashed with everything they import, which includes no technique.
_MEASURING = tuple(Path(str(module.__file__)) for module in (session, scoring, truths))


def view_key(view: View) -> str:
    """Digest of a view with its names: rows carry the names, so a renamed copy of a scene needs rows of its own."""
    return repr((view.scene.name, view.camera.name, view.light.name, view_digest(view)))


def cell_key(cell: Cell, view: str, coordinates: Coordinates, renderer: str) -> str:
    """Hex key of a cell on a renderer; `view` is a `view_key`."""
    # Built-in components are among what the technique imports.
    plugins = dict.fromkeys(type(component) for component in cell.spec.components if component.plugin_files())
    parts = {
        "spec": cell.spec.full_text,
        "phase": cell.phase,
        "view": view,
        "coordinates": coordinates,
        "renderer": renderer,
        "sources": [*map(_sources, cell.spec.techniques), *map(_sources, plugins)],
    }
    return hashlib.sha256(json.dumps(parts, sort_keys=True).encode()).hexdigest()[:24]


def joint_key(parts: Sequence[object]) -> str:
    """Hex key of what depends on several keys or other values, which JSON must be able to hold."""
    return hashlib.sha256(json.dumps(parts).encode()).hexdigest()[:24]


def counting_digest() -> str:
    """Digest of the sources that count flips, which cells without a step do not depend on."""
    return code_digest(Path(str(flips.__file__)))


@cache
def _sources(one: type[Technique] | type[Component]) -> str:
    classes = (*one.__mro__, *one.Params.__mro__) if issubclass(one, Technique) else one.__mro__
    lineage = [cls for cls in classes if not _is_library_class(cls)]
    files = dict.fromkeys(source_file(cls) for cls in lineage)
    around = dict.fromkeys(other for file in files for other in plugin_sources(file))
    return code_digest(*_MEASURING, *files, *around, extra_files=_shaders(lineage))


def _is_library_class(cls: type) -> bool:
    return cls.__module__.partition(".")[0] in {*sys.stdlib_module_names, "pydantic"}


def _shaders(lineage: Sequence[type]) -> list[Path]:
    """Built-in shader files and folders that a technique may include: all but other techniques' and the viewer's."""
    others = {"viewer", *(other.name for other in own_techniques() if other not in lineage)}
    return [file for file in sorted(data_folder("shaders").iterdir()) if file.name not in others]


def plugin_sources(file: Path) -> list[Path]:
    """Files a plug-in may use besides its imports: the shaders next to it, or its whole package. None for built-ins."""
    if file.is_relative_to(PACKAGE):
        return []
    folder = plugin_folder(file)
    if (folder / "__init__.py").exists():
        return files_in(folder)
    nearby = [other for pattern in ("*", "*/*") for other in sorted(folder.glob(pattern))]
    return [other for other in nearby if other.suffix in SOURCES - {".py"}]


def plugin_folder(file: Path) -> Path:
    """Folder of a plug-in's sources: that of the outermost package, all of which imports may reach, or its own."""
    folder = file.parent
    while (folder / "__init__.py").exists() and (folder.parent / "__init__.py").exists():
        folder = folder.parent
    return folder
