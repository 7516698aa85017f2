"""Keys of rows: everything that a result rests on, hashed: a changed default or shader never mixes with old rows."""

import hashlib
import json
from collections.abc import Iterable
from functools import cache
from importlib.metadata import version
from pathlib import Path

from shadowbench import gl, scores, truth
from shadowbench.data import SOURCES, data_folder, source_digest
from shadowbench.scenes.digest import view_digest
from shadowbench.scenes.model import Coordinates, View
from shadowbench.studies.study import Cell
from shadowbench.techniques.base import Technique
from shadowbench.techniques.registry import OWN, source_file
from shadowbench.techniques.spec import format_spec

_LIBRARIES = ("embreex", "moderngl", "numpy")


def view_key(view: View) -> str:
    """A view's digest with its names: a row carries them, so the same triangles under another name are another row."""
    return repr((view.scene.name, view.camera.name, view.light.name, view_digest(view)))


def cell_key(cell: Cell, view: str, coordinates: Coordinates, renderer: str) -> str:
    """Hex key of a cell in a view (its key), on a renderer."""
    parts = {
        "spec": format_spec(cell.spec, full=True),
        "phase": cell.phase,
        "view": view,
        "coordinates": coordinates,
        "renderer": renderer,
        "sources": _sources(cell.spec.technique),
    }
    return hashlib.sha256(json.dumps(parts, sort_keys=True).encode()).hexdigest()[:24]


@cache
def _sources(technique: type[Technique]) -> str:
    folders = [Path(str(package.__file__)).parent for package in (gl, truth, scores)]
    places = [*folders, *_shared(technique), source_file(technique), *_shaders(technique)]
    return source_digest(*places) + ",".join(version(library) for library in _LIBRARIES)


def _shared(technique: type[Technique]) -> Iterable[Path]:
    """What all techniques share: the files beside them that are no technique themselves."""
    others = {source_file(other) for other in OWN}
    return [file for file in sorted(source_file(OWN[0]).parent.glob("*.py")) if file not in others]


def _shaders(technique: type[Technique]) -> Iterable[Path]:
    """Every shader text that could be composed for it: the shared ones, its own folder, files beside a plug-in."""
    others = {other.name for other in OWN if other is not technique}
    shared = [file for file in sorted(data_folder("shaders").iterdir()) if file.name not in others]
    if technique in OWN:
        return shared
    folder = source_file(technique).parent
    beside = [file for pattern in ("*", "*/*") for file in sorted(folder.glob(pattern))]
    return [*shared, *(file for file in beside if file.suffix in SOURCES - {".py"})]
