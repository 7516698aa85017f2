"""The registry of techniques: built-in ones, those of installed packages, and files given by --plugin."""

import hashlib
import importlib.util
import inspect
import logging
import re
import sys
from collections.abc import Mapping, Sequence
from functools import cache
from importlib import import_module
from importlib.metadata import entry_points
from pathlib import Path
from pkgutil import iter_modules
from types import ModuleType

from shadowbench import techniques as package
from shadowbench.errors import InputError, message, quoted
from shadowbench.scenes.tables import LONGEST_NAME
from shadowbench.techniques.base import Technique
from shadowbench.techniques.grammar import WORD

GROUP = "shadowbench.techniques"
log = logging.getLogger(__name__)


@cache
def own_techniques() -> tuple[type[Technique], ...]:
    """The techniques of this package's modules, in the order of the module names."""
    modules = [import_module(found.name) for found in iter_modules(package.__path__, f"{package.__name__}.")]
    return tuple(one for module in modules for one in _defined_in(module) if _named(one))


def techniques(plugins: Sequence[Path] = ()) -> Mapping[str, type[Technique]]:
    """All techniques by name. Raises InputError for a plug-in that cannot be loaded or whose name is taken."""
    found: dict[str, type[Technique]] = {}
    files = dict.fromkeys(Path(plugin).resolve() for plugin in plugins)
    for technique in [*own_techniques(), *_installed(), *(one for file in files for one in _from_file(file))]:
        if technique.name in found and found[technique.name] is not technique:
            places = " and ".join(str(source_file(one)) for one in (found[technique.name], technique))
            raise InputError(f"two techniques are called {technique.name!r}: {places}")
        found[technique.name] = technique
    return found


def shader_folder(technique: type[Technique]) -> Path | None:
    """The folder of a plug-in's own shader files, that of its Python file; None for built-in techniques."""
    return None if technique in own_techniques() else source_file(technique).parent


def source_file(technique: type[Technique]) -> Path:
    """The file that defines a technique."""
    return Path(inspect.getfile(technique))


def _installed() -> list[type[Technique]]:
    """Techniques of other packages. One that cannot be loaded is skipped with a warning; the others still run."""
    loaded = []
    for point in entry_points(group=GROUP):
        package = point.dist.name if point.dist else "a package"
        where = f"entry point {point.name!r} of {package}"
        try:
            loaded.append(_checked(point.load(), where))
        except InputError as error:
            log.warning("%s; it is left out", error)
        except (Exception, SystemExit) as error:  # importing a foreign package may raise anything
            log.warning("%s cannot be imported: %s; it is left out", where, _summary(error))
    return loaded


def _from_file(file: Path) -> list[type[Technique]]:
    if not file.is_file():
        raise InputError(f"--plugin {file}: no such file")
    # The hash keeps files of the same name in different folders apart.
    name = f"shadowbench_plugin_{file.stem}_{hashlib.sha256(str(file).encode()).hexdigest()[:8]}"
    spec = importlib.util.spec_from_file_location(name, file)
    if spec is None:
        raise InputError(f"--plugin {file}: not a Python file (.py)")
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module  # pydantic and inspect look up the file's classes there
    try:
        exec(compile(file.read_bytes(), file, "exec"), module.__dict__)  # an import would leave __pycache__ beside it
    except (Exception, SystemExit) as error:  # executing a foreign file may raise anything
        raise InputError(f"--plugin {file}: {_summary(error)}") from error
    own = _defined_in(module)
    if not own:
        raise InputError(f"--plugin {file}: defines no subclass of shadowbench.techniques.base.Technique")
    bases = {base for technique in own for base in technique.__mro__[1:]}
    return [_checked(technique, f"--plugin {file}") for technique in own if technique not in bases or _named(technique)]


def _defined_in(module: ModuleType) -> list[type[Technique]]:
    return [
        thing
        for thing in vars(module).values()
        if inspect.isclass(thing) and issubclass(thing, Technique) and thing.__module__ == module.__name__
    ]


def _checked(technique: object, where: str) -> type[Technique]:
    if not (inspect.isclass(technique) and issubclass(technique, Technique)):
        raise InputError(f"{where}: {technique!r} is not a subclass of Technique")
    if not _named(technique):
        raise InputError(f"{where}: {technique.__name__} has no name")
    if not re.fullmatch(WORD, technique.name) or len(technique.name) > LONGEST_NAME:
        allowed = f"letters, digits, _ and -, at most {LONGEST_NAME} of them"
        raise InputError(f"{where}: the name {technique.name!r:.90} is not a valid name; allowed: {allowed}")
    missing = sorted(technique.__abstractmethods__)
    if missing:
        raise InputError(f"{where}: {technique.__name__} lacks {', '.join(missing)}")
    return technique


def _named(technique: type[Technique]) -> bool:
    return isinstance(getattr(technique, "name", None), str)


def _summary(error: BaseException) -> str:
    return f"{type(error).__name__}: {quoted(message(error))}"
