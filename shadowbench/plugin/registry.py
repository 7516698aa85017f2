"""The registry of techniques: built-in ones, those of installed packages, and files given by --plugin.

Plug-ins may also define components (a bias, filter, fit or split), which register themselves where they are defined,
and metrics: instances of `Metric`. Engines are known by the entry points of the group `shadowbench.engines` alone.
"""

import hashlib
import importlib.util
import inspect
import logging
import re
import sys
from collections.abc import Callable, Mapping, Sequence
from functools import cache
from importlib import import_module
from importlib.metadata import entry_points
from pathlib import Path
from pkgutil import iter_modules
from types import ModuleType
from typing import TypeVar

from shadowbench.errors import InputError, message, quoted
from shadowbench.plugin.base import Subject, Technique
from shadowbench.plugin.engine import Engine
from shadowbench.plugin.params import WORD, Component
from shadowbench.plugin.spec import forget_parsed, parse_spec
from shadowbench.scenes.scene_tables import LONGEST_NAME
from shadowbench.scores.metrics import METRICS, Metric, plug_in

GROUP = "shadowbench.techniques"
ENGINES = "shadowbench.engines"
T = TypeVar("T")
Plugged = type[Technique] | type[Component]
_KINDS = "Technique, Bias, Filter, Fit or Split"
_SCORED = "Metric(name, function(comparison) -> float | None, better, kind, help)"
_MODULE = "shadowbench_plugin_"  # begins the names of modules loaded from files
log = logging.getLogger(__name__)


@cache
def own_techniques() -> tuple[type[Technique], ...]:
    """The techniques of this package's modules, in the order of the module names; imports all components too."""
    rooms = [import_module(f"shadowbench.{room}") for room in ("maps", "techniques")]
    modules = [import_module(f"{room.__name__}.{one.name}") for room in rooms for one in iter_modules(room.__path__)]
    found = [one for module in modules for one in _defined_in(module)]
    return tuple(one for one in found if issubclass(one, Technique) and _named(one))


@cache
def engines() -> Mapping[str, type[Engine]]:
    """The engines of installed packages, this one among them, by name, in alphabetical order."""
    loaded = _installed(ENGINES, _checked_engine)
    return {engine.name: engine for engine in sorted(loaded, key=lambda engine: engine.name)}


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
    own = own_techniques()
    loaded = [_from_file(file) for file in dict.fromkeys(Path(plugin).resolve() for plugin in plugins)]
    try:
        plug_in([metric for _, metrics in loaded for metric in metrics])
    except ValueError as error:
        raise InputError(f"--plugin: {error}") from None
    installed = [one for one in _installed(GROUP, _checked) if issubclass(one, Technique)]
    found: dict[str, type[Technique]] = {}
    for technique in [*own, *installed, *(one for plugged, _ in loaded for one in plugged)]:
        if found.setdefault(technique.name, technique) is not technique:
            places = " and ".join(str(source_file(one)) for one in (found[technique.name], technique))
            raise InputError(f"two techniques are called {technique.name!r}: {places}")
    return found


def forget_components() -> None:
    """Forget the components of files that were loaded before."""
    for family in Component.__subclasses__():
        for one in [one for one in family.table.values() if one.__module__.startswith(_MODULE)]:
            del family.table[one.name]
    forget_parsed()


def shader_folder(technique: type[Technique]) -> Path | None:
    """The folder of a plug-in's own shader files, that of its Python file; None for built-in techniques."""
    return None if technique in own_techniques() else source_file(technique).parent


def source_file(technique: Plugged) -> Path:
    """The file that defines a technique or a component."""
    return Path(inspect.getfile(technique))


def _installed(group: str, check: Callable[[object, str], T]) -> list[T]:
    """What entry points of other packages name, as `check` returns it.

    What cannot be loaded, or is refused, is skipped with a warning; the others still run.
    """
    loaded = []
    for point in entry_points(group=group):
        where = f"entry point {point.name!r} of {point.dist.name if point.dist else 'a package'}"
        try:
            loaded.append(check(point.load(), where))
        except InputError as error:
            log.warning("%s; it is left out", error)
        except (Exception, SystemExit) as error:  # importing a foreign package may raise anything
            log.warning("%s cannot be imported: %s; it is left out", where, _summary(error))
    return loaded


def _from_file(file: Path) -> tuple[list[type[Technique]], list[Metric]]:
    where = f"--plugin {file}"
    module = _executed(file, where)
    own = _defined_in(module)
    built_in = set(map(id, METRICS.values()))
    metrics = [one for one in vars(module).values() if isinstance(one, Metric) and id(one) not in built_in]
    if not own and not metrics:
        raise InputError(f"{where}: defines no subclass of {_KINDS}, and no {_SCORED}")
    for metric in metrics:
        _check_name(metric.name, where)
    bases = {base for one in own for base in one.__mro__[1:]}
    checked = [_checked(one, where) for one in own if one not in bases or _named(one)]
    return [one for one in checked if issubclass(one, Technique)], metrics


def _executed(file: Path, where: str) -> ModuleType:
    """The module of a plug-in's file."""
    if not file.is_file():
        raise InputError(f"{where}: no such file")
    # The hash keeps files of the same name in different folders apart.
    name = f"{_MODULE}{file.stem}_{hashlib.sha256(str(file).encode()).hexdigest()[:8]}"
    spec = importlib.util.spec_from_file_location(name, file)
    if spec is None:
        raise InputError(f"{where}: not a Python file (.py)")
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module  # pydantic and inspect look up the file's classes there
    try:
        exec(compile(file.read_bytes(), file, "exec"), module.__dict__)  # an import would leave __pycache__ beside it
    except InputError:  # a component's name is taken
        raise
    except (Exception, SystemExit) as error:  # executing a foreign file may raise anything
        raise InputError(f"{where}: {_summary(error)}") from error
    return module


def _defined_in(module: ModuleType) -> list[Plugged]:
    classes = [one for one in vars(module).values() if inspect.isclass(one) and one.__module__ == module.__name__]
    return [one for one in classes if issubclass(one, Technique | Component)]


def _checked(one: object, where: str) -> Plugged:
    if not (inspect.isclass(one) and issubclass(one, Technique | Component)):
        raise InputError(f"{where}: {one!r} is not a subclass of {_KINDS}")
    if not _named(one):
        raise InputError(f"{where}: {one.__name__} has no name")
    _check_name(one.name, where)
    missing = [_signature(one, name) for name in sorted(one.__abstractmethods__)]
    missing += one.missing() if issubclass(one, Component) else []
    if missing:
        raise InputError(f"{where}: {one.__name__} lacks {'; '.join(missing)}")
    return one


def _checked_engine(one: object, where: str) -> type[Engine]:
    if not (inspect.isclass(one) and issubclass(one, Engine)):
        raise InputError(f"{where}: {one!r} is not a subclass of Engine")
    return one


def _signature(one: Plugged, name: str) -> str:
    """A method, or a property, as a subclass has to define it."""
    found = inspect.getattr_static(one, name)
    getter = found.fget if isinstance(found, property) else None
    signature = re.sub(r"\b\w+\.(?=\w)", "", str(inspect.signature(getter or found)))
    return f"the property {name}{signature[6:]}" if getter else f"{name}{signature}"


def _check_name(name: str, where: str) -> None:
    if not re.fullmatch(WORD, name) or len(name) > LONGEST_NAME:
        allowed = f"letters, digits, _ and -, at most {LONGEST_NAME} of them"
        raise InputError(f"{where}: the name {name!r:.90} is not a valid name; allowed: {allowed}")


def _named(one: Plugged) -> bool:
    """Whether it has a name; that of a component must be its own, as it is registered by it."""
    name = vars(one).get("name") if issubclass(one, Component) else getattr(one, "name", None)
    return isinstance(name, str)


def _summary(error: BaseException) -> str:
    return f"{type(error).__name__}: {quoted(message(error))}"
