"""The code that a result rests on: files, those of ours that they import, and the libraries that compute in them."""

import ast
import hashlib
import warnings
from collections.abc import Iterable, Iterator
from functools import cache
from importlib.metadata import version
from pathlib import Path

SOURCES = {".py", ".glsl", ".vert", ".geom", ".frag"}
LIBRARIES = {"embreex": "embreex", "moderngl": "moderngl", "numpy": "numpy", "pyglm": "pyglm", "scipy": "scipy"}
"""Distributions whose version may change a result, by the module that is imported."""
PACKAGE = Path(__file__).resolve().parent


def code_digest(*roots: Path, beside: Iterable[Path] = ()) -> str:
    """Hex digest of the text of files and of all that they import, and of their libraries' versions.

    beside: files, or folders with all their .py and GLSL files, whose text counts too and whose imports do not.
    """
    digest = hashlib.sha256()
    ours = imported(*roots)
    for file in [*ours, *(file for place in beside for file in files_in(place))]:
        digest.update(file.name.encode() + b"\0" + file.read_bytes() + b"\0")
    used = {name.partition(".")[0] for file in ours for name in _imports(file)}
    digest.update(repr([version(library) for module, library in LIBRARIES.items() if module in used]).encode())
    return digest.hexdigest()


def imported(*roots: Path) -> list[Path]:
    """The files, and the files of ours that are imported from them, directly or not, wherever the import stands."""
    found: set[Path] = set()
    left = list(roots)
    while left:
        file = left.pop()
        if file not in found:
            found.add(file)
            left += [other for name in _imports(file) for other in _ours(name)]
    return sorted(found)


def files_in(place: Path) -> list[Path]:
    """The .py and GLSL files in a folder and below; a file is itself alone."""
    return sorted(path for path in place.rglob("*") if path.suffix in SOURCES) if place.is_dir() else [place]


def _imports(file: Path) -> frozenset[str]:
    return _names(file.read_bytes()) if file.suffix == ".py" else frozenset()


@cache
def _names(text: bytes) -> frozenset[str]:
    """The dotted names that a source imports; of `from a import b` both a and a.b, since b may be a module."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # Python has told them on import
            tree = ast.parse(text)
    except (SyntaxError, ValueError):  # a template in somebody's package, say: nobody imports it either
        return frozenset()

    def names() -> Iterator[str]:
        for node in ast.walk(tree):
            if isinstance(node, ast.Import):
                yield from (alias.name for alias in node.names)
            elif isinstance(node, ast.ImportFrom) and node.module and not node.level:
                yield node.module
                yield from (f"{node.module}.{alias.name}" for alias in node.names)

    return frozenset(names())


def _ours(name: str) -> list[Path]:
    """The file of a module of ours; none for the package itself, whose names come from everywhere."""
    if not name.startswith(f"{PACKAGE.name}."):
        return []
    place = PACKAGE.parent.joinpath(*name.split("."))
    return [file for file in (place.with_suffix(".py"), place / "__init__.py") if file.is_file()]
