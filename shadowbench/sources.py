"""Digest of the code that a result depends on: source files, own modules that they import, and library versions."""

import ast
import hashlib
import warnings
from collections.abc import Iterable, Iterator
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

SOURCES = {".py", ".glsl", ".vert", ".geom", ".frag"}
LIBRARIES = {"embreex": "embreex", "moderngl": "moderngl", "numpy": "numpy", "pyglm": "pyglm", "scipy": "scipy"}
"""Distributions whose version may change a result, by module name."""
ABSENT = "not installed"
PACKAGE = Path(__file__).resolve().parent


def code_digest(*roots: Path, extra_files: Iterable[Path] = ()) -> str:
    """Hex digest of files, of the own modules that they import, and of the versions of their libraries.

    extra_files: further files, or folders of .py and GLSL files, whose imports are not followed.
    """
    digest = hashlib.sha256()
    closure = import_closure(*roots)
    for file in [*closure, *(file for place in extra_files for file in files_in(place))]:
        digest.update(file.name.encode() + b"\0" + file.read_bytes() + b"\0")
    used = {name.partition(".")[0] for file in closure for name in _imports(file)}
    digest.update(repr([installed(library) for module, library in LIBRARIES.items() if module in used]).encode())
    return digest.hexdigest()


def installed(library: str) -> str:
    """Version of a distribution; some platforms lack some."""
    try:
        return version(library)
    except PackageNotFoundError:
        return ABSENT


def import_closure(*roots: Path) -> list[Path]:
    """The files and all own modules that they import, directly or indirectly, at any level of the code."""
    found: set[Path] = set()
    pending = list(roots)
    while pending:
        file = pending.pop()
        if file not in found:
            found.add(file)
            pending += [other for name in _imports(file) for other in _module_files(name)]
    return sorted(found, key=_order)


def _order(file: Path) -> tuple[bool, tuple[str, ...], bytes]:
    """Own modules by their path in the package, then other files by name, wherever they are: a copy digests alike."""
    if file.is_relative_to(PACKAGE):
        return False, file.relative_to(PACKAGE).parts, b""
    return True, (file.name,), file.read_bytes()


def files_in(place: Path) -> list[Path]:
    """The .py and GLSL files below a folder; for a file, the file itself."""
    return sorted(path for path in place.rglob("*") if path.suffix in SOURCES) if place.is_dir() else [place]


def _imports(file: Path) -> frozenset[str]:
    return _names(file.read_bytes()) if file.suffix == ".py" else frozenset()


@cache
def _names(text: bytes) -> frozenset[str]:
    """Dotted names imported by a source; for `from a import b` both a and a.b, since b may be a module."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # Python has shown them on import
            tree = ast.parse(text)
    except (SyntaxError, ValueError):  # no Python, such as a template in a plug-in's package
        return frozenset()

    return frozenset(_imported(tree))


_BLOCKS = ("body", "orelse", "finalbody", "handlers", "cases")


def _imported(block: ast.AST) -> Iterator[str]:
    """Names imported by the statements in a block. Expressions, of which code mostly consists, hold no statements."""
    for node in (node for name in _BLOCKS for node in getattr(block, name, ())):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module and not node.level:
            yield node.module
            yield from (f"{node.module}.{alias.name}" for alias in node.names)
        else:
            yield from _imported(node)


def _module_files(name: str) -> list[Path]:
    """The file of an own module; none for the package itself, which imports everything lazily."""
    if not name.startswith(f"{PACKAGE.name}."):
        return []
    place = PACKAGE.parent.joinpath(*name.split("."))
    return [file for file in (place.with_suffix(".py"), place / "__init__.py") if file.is_file()]
