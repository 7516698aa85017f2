"""Row keys: hashes of everything a result depends on, so a changed default or shader never reuses old rows.

Of our Python code they hold the declared versions alone: tidying it voids no row.
"""

import hashlib
import inspect
import json
import re
import sys
from collections.abc import Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING

from shadowbench import versions
from shadowbench.files import PACKAGE, data_folder
from shadowbench.plugin.base import Technique
from shadowbench.plugin.params import Component
from shadowbench.plugin.registry import own_techniques, source_file
from shadowbench.plugin.spec import Spec
from shadowbench.scenes.model import Coordinates, View, view_digest
from shadowbench.scores.metrics import plugged_in

if TYPE_CHECKING:
    from shadowbench.measure.campaign import Cell

SOURCES = {".py", ".glsl", ".vert", ".geom", ".frag"}
_COMMENT = re.compile(r"//.*|/\*[\s\S]*?\*/")


def view_key(view: View) -> str:
    """Digest of a view with its names: rows carry the names, so a renamed copy of a scene needs rows of its own."""
    return repr((view.scene.name, view.camera.name, view.light.name, view_digest(view)))


def cell_key(cell: "Cell", view: str, coordinates: Coordinates, drawer: Mapping[str, str]) -> str:
    """Hex key of a cell; `view` is a `view_key`, `drawer` the identity of an executor."""
    parts: dict[str, object] = {
        "spec": cell.spec.full_text,
        "phase": cell.phase,
        "view": view,
        "coordinates": coordinates,
        "drawer": dict(drawer),
        "versions": versions.of_rows(),
        "sources": sources_of(cell.spec),
    }
    if metrics := plugged_in():
        parts["metrics"] = [(one.name, _digest(Path(inspect.getfile(one.function)))) for one in metrics]
    return joint_key(parts)


def joint_key(*parts: object) -> str:
    """Hex key of keys or other values, which JSON must be able to hold."""
    return hashlib.sha256(json.dumps(parts, sort_keys=True).encode()).hexdigest()[:24]


def sources_of(spec: Spec) -> str:
    """Digest of the shaders that a spec may use, without comments, and of plug-ins' files."""
    return _sources(spec.techniques, tuple(map(type, spec.components)))


def _digest(file: Path) -> str:
    return hashlib.sha256(file.read_bytes()).hexdigest()


@cache
def _sources(techniques: Sequence[type[Technique]], components: Sequence[type[Component]]) -> str:
    classes = [base for one in (*techniques, *components) for base in one.__mro__]
    classes += [base for one in techniques for base in one.Params.__mro__]
    libraries = {*sys.stdlib_module_names, "pydantic"}
    files = dict.fromkeys(source_file(one) for one in classes if one.__module__.partition(".")[0] not in libraries)
    plugins = [file for file in files if not file.is_relative_to(PACKAGE)]
    digest = hashlib.sha256(b"".join(map(_shader, shader_names(techniques))))
    beside = (other for file in plugins for other in (file, *plugin_sources(file)))
    for name, data in sorted((file.name, file.read_bytes()) for file in dict.fromkeys(beside)):
        digest.update(name.encode() + b"\0" + data + b"\0")
    return digest.hexdigest()


@cache
def _shader(name: str) -> bytes:
    """Text of a shader file without comments and indentation."""
    text = _COMMENT.sub("", (data_folder("shaders") / name).read_text(encoding="utf-8"))
    return "\n".join(filter(None, map(str.strip, text.splitlines()))).encode() + b"\0"


@cache
def shader_names(techniques: Sequence[type[Technique]]) -> list[str]:
    """Built-in shader files that a cell may use: its techniques' own, and those in no technique's folder."""
    bases = {base for one in techniques for base in one.__mro__}
    others = {other.name for other in own_techniques() if other not in bases}
    names = [file.relative_to(data_folder("shaders")) for file in files_in(data_folder("shaders"))]
    return [name.as_posix() for name in names if name.parts[0] not in others]


def files_in(folder: Path) -> list[Path]:
    """The .py and GLSL files below a folder."""
    return sorted(path for path in folder.rglob("*") if path.suffix in SOURCES)


def plugin_sources(file: Path) -> list[Path]:
    """Files a plug-in may use besides its imports: the shaders next to it, or its whole package."""
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
