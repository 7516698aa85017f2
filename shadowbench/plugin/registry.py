"""The registry of techniques: built-in ones, those of installed packages, and files given by --plugin.

Plug-ins may also define components (a bias, filter, fit or split), which register themselves where they are defined,
and metrics: instances of `Metric`. Engines are known by the entry points of the group `shadowbench.engines` alone.
"""

import hashlib
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
from typing import Any

from shadowbench.errors import InputError, message, quoted
from shadowbench.plugin.base import Subject, Technique
from shadowbench.plugin.engine import Engine
from shadowbench.plugin.params import WORD, Component
from shadowbench.plugin.spec import forget_parsed, parse_spec
from shadowbench.scenes.scene_tables import LONGEST_NAME
from shadowbench.scores.metrics import METRICS, Metric, plug_in

GROUP = "shadowbench.techniques"
ENGINES = "shadowbench.engines"
_SCORED = "Metric(name, function(comparison) -> float | None, better, kind, help)"
_MODULE = "shadowbench_plugin_"  # begins the names of modules loaded from files
log = logging.getLogger(__name__)


@cache
def own_techniques() -> tuple[type[Technique], ...]:
    """The techniques of this package's modules, in the order of the module names; imports all components too."""
    rooms = [import_module(f"shadowbench.{room}") for room in ("maps", "techniques")]
    modules = [import_module(f"{room.__name__}.{one.name}") for room in rooms for one in iter_modules(room.__path__)]
    classes = [one for module in modules for one in _defined_in(module)]
    return tuple(one for one in classes if issubclass(one, Technique) and _name_of(one))


@cache
def engines() -> Mapping[str, type[Engine]]:
    """The engines of installed packages, this one among them, by name, in alphabetical order."""
    return {engine.name: engine for engine in sorted(_installed(ENGINES, Engine), key=lambda engine: engine.name)}


@cache
def preset_names() -> Mapping[str, str]:
    """The short form of specs that equal a preset, as in `shadow-map:preset=three`, by their `sizeless_text`."""
    known: dict[str, type[Subject]] = {technique.name: technique for technique in own_techniques()}
    known |= engines()
    shorts = [f"{name}:preset={preset}" for name, one in known.items() for preset in one.presets if one.presets[preset]]
    return {parse_spec(short, known).sizeless_text: short for short in reversed(shorts)}


def techniques(plugins: Sequence[Path] = ()) -> Mapping[str, type[Technique]]:
    """All techniques by name. Components and metrics are those of this package, of installed ones and of these files.

    Raises InputError for a plug-in that cannot be loaded or whose name is taken.
    """
    forget_components()
    loaded = [_from_file(file) for file in dict.fromkeys(Path(plugin).resolve() for plugin in plugins)]
    try:
        plug_in([metric for _, metrics in loaded for metric in metrics])
    except ValueError as error:
        raise InputError(f"--plugin: {error}") from None
    installed = [one for one in _installed(GROUP, Technique, Component) if issubclass(one, Technique)]
    by_name: dict[str, type[Technique]] = {}
    for technique in [*own_techniques(), *installed, *(one for plugged, _ in loaded for one in plugged)]:
        if by_name.setdefault(technique.name, technique) is not technique:
            places = " and ".join(str(source_file(one)) for one in (by_name[technique.name], technique))
            raise InputError(f"two techniques are called {technique.name!r}: {places}")
    return by_name


def forget_components() -> None:
    """Forget the components of files that were loaded before."""
    for family in Component.__subclasses__():
        for one in [one for one in family.table.values() if one.__module__.startswith(_MODULE)]:
            del family.table[one.name]
    forget_parsed()


def shader_folder(technique: type[Technique]) -> Path | None:
    """The folder of a plug-in's own shader files, that of its Python file; None for built-in techniques."""
    return None if technique in own_techniques() else source_file(technique).parent


def source_file(technique: type) -> Path:
    """The file that defines a technique or a component."""
    return Path(inspect.getfile(technique))


def _installed(group: str, *bases: type) -> list[Any]:
    """The subclasses of `bases` that entry points of other packages name.

    What cannot be loaded, or is refused, is skipped with a warning; the others still run.
    """
    loaded = []
    for point in entry_points(group=group):
        where = f"entry point {point.name!r} of {point.dist.name if point.dist else 'a package'}"
        try:
            loaded.append(_checked(point.load(), where, *bases))
        except InputError as error:
            log.warning("%s; it is left out", error)
        except (Exception, SystemExit) as error:  # importing a foreign package may raise anything
            log.warning("%s cannot be imported: %s; it is left out", where, _summary(error))
    return loaded


def _from_file(file: Path) -> tuple[list[type[Technique]], list[Metric]]:
    """The techniques and metrics that a file defines, after executing it."""
    where = f"--plugin {file}"
    if not file.is_file() or file.suffix != ".py":
        raise InputError(f"{where}: no such file; allowed: a Python file (.py)")
    # The hash keeps files of the same name in different folders apart.
    module = ModuleType(f"{_MODULE}{file.stem}_{hashlib.sha256(str(file).encode()).hexdigest()[:8]}")
    module.__file__ = str(file)
    sys.modules[module.__name__] = module  # pydantic and inspect look up the file's classes there
    try:
        exec(compile(file.read_bytes(), file, "exec"), module.__dict__)  # an import would leave __pycache__ beside it
    except InputError:  # a component's name is taken
        raise
    except (Exception, SystemExit) as error:  # executing a foreign file may raise anything
        raise InputError(f"{where}: {_summary(error)}") from error
    own = _defined_in(module)
    built_in = set(map(id, METRICS.values()))
    metrics = [one for one in vars(module).values() if isinstance(one, Metric) and id(one) not in built_in]
    if not own and not metrics:
        raise InputError(f"{where}: defines no subclass of Technique, Bias, Filter, Fit or Split, and no {_SCORED}")
    for metric in metrics:
        _check_name(metric.name, where)
    bases = {base for one in own for base in one.__mro__[1:]}
    checked = [_checked(one, where, object) for one in own if one not in bases or _name_of(one)]
    return [one for one in checked if issubclass(one, Technique)], metrics


def _defined_in(module: ModuleType) -> list[type[Technique] | type[Component]]:
    classes = [one for one in vars(module).values() if inspect.isclass(one) and one.__module__ == module.__name__]
    return [one for one in classes if issubclass(one, Technique | Component)]


def _checked(one: Any, where: str, *bases: type) -> Any:
    """A class, unless it is a subclass of none of `bases`, or lacks a name or a method."""
    if not isinstance(one, type) or not issubclass(one, bases):
        raise InputError(f"{where}: {one!r} is not a subclass of {' or '.join(base.__name__ for base in bases)}")
    if (name := _name_of(one)) is None:
        raise InputError(f"{where}: {one.__name__} has no name")
    _check_name(name, where)
    if missing := sorted(getattr(one, "__abstractmethods__", ())):
        raise InputError(f"{where}: {one.__name__} lacks {', '.join(missing)}; allowed: definitions of these")
    return one


def _check_name(name: str, where: str) -> None:
    if not re.fullmatch(WORD, name) or len(name) > LONGEST_NAME:
        allowed = f"letters, digits, _ and -, at most {LONGEST_NAME} of them"
        raise InputError(f"{where}: the name {name!r:.90} is not a valid name; allowed: {allowed}")


def _name_of(one: type) -> str | None:
    """The name of a class; that of a component must be its own, as it is registered by it."""
    return vars(one).get("name") if issubclass(one, Component) else getattr(one, "name", None)


def _summary(error: BaseException) -> str:
    return f"{type(error).__name__}: {quoted(message(error))}"
