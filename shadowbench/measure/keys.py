"""Keys of rows: everything that a result rests on, hashed: a changed default or shader never mixes with old rows."""

import hashlib
import json
import sys
from collections.abc import Sequence
from functools import cache
from importlib.metadata import version
from pathlib import Path

from shadowbench import gl, scores, truth
from shadowbench.data import SOURCES, data_folder, source_digest
from shadowbench.measure import loaded, scoring, session
from shadowbench.measure.cells import Cell
from shadowbench.scenes import model, planes
from shadowbench.scenes.digest import view_digest
from shadowbench.scenes.model import Coordinates, View
from shadowbench.techniques import registry
from shadowbench.techniques.base import Technique
from shadowbench.techniques.registry import own_techniques, source_file

_LIBRARIES = ("embreex", "moderngl", "numpy", "pyglm", "scikit-image", "scipy")
_PACKAGES = tuple(Path(str(package.__file__)).parent for package in (gl, truth, scores))
_MODULES = tuple(Path(str(module.__file__)) for module in (model, planes, loaded, scoring, session))
_TECHNIQUES = Path(str(registry.__file__)).parent


def view_key(view: View) -> str:
    """A view's digest with its names: a row carries them, so the same triangles under another name are another row."""
    return repr((view.scene.name, view.camera.name, view.light.name, view_digest(view)))


def cell_key(cell: Cell, view: str, coordinates: Coordinates, renderer: str) -> str:
    """Hex key of a cell in a view (its key), on a renderer."""
    parts = {
        "spec": cell.spec.full_text,
        "phase": cell.phase,
        "view": view,
        "coordinates": coordinates,
        "renderer": renderer,
        "sources": _sources(cell.spec.technique),
    }
    return hashlib.sha256(json.dumps(parts, sort_keys=True).encode()).hexdigest()[:24]


@cache
def _sources(technique: type[Technique]) -> str:
    lineage = [*technique.__mro__, *technique.Params.__mro__]
    inherited = [place for one in lineage for place in _places(one)]
    places = [*_PACKAGES, *_MODULES, *_shared(), *_shaders(lineage), *dict.fromkeys(inherited)]
    return source_digest(*places) + ",".join(version(library) for library in _LIBRARIES)


def _shared() -> list[Path]:
    """What all techniques share: the files beside them that are no technique themselves."""
    others = {source_file(other) for other in own_techniques()}
    return [file for file in sorted(_TECHNIQUES.rglob("*.py")) if file not in others]


def _shaders(lineage: Sequence[type]) -> list[Path]:
    """Every shader text of ours that could be composed for a technique: all but other techniques' own folders."""
    others = {other.name for other in own_techniques() if other not in lineage}
    return [file for file in sorted(data_folder("shaders").iterdir()) if file.name not in others]


def _places(one: type) -> list[Path]:
    """Where the code of a class is: its file; for a plug-in also the shaders beside it, or its whole package."""
    if one.__module__.partition(".")[0] in {*sys.stdlib_module_names, "pydantic"}:
        return []
    file = source_file(one)
    if file.is_relative_to(_TECHNIQUES.parent):  # ours
        return [file]
    folder = file.parent
    if not (folder / "__init__.py").exists():
        beside = [other for pattern in ("*", "*/*") for other in sorted(folder.glob(pattern))]
        return [file, *(other for other in beside if other.suffix in SOURCES - {".py"})]
    while (folder.parent / "__init__.py").exists():  # from anywhere in the package it may import
        folder = folder.parent
    return [folder]
