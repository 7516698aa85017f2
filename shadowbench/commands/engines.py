"""`engines`: what other engines there are, their installation, and whether they draw here."""

from collections.abc import Mapping
from typing import TYPE_CHECKING, Annotated, Any

from shadowbench.commands import console, options
from shadowbench.errors import InputError, ShadowbenchError, alternatives

if TYPE_CHECKING:
    from shadowbench.plugin.engine import Engine

_ACTIONS = ("list", "install", "doctor")
_SIZE = 128  # of the probe that `doctor` draws


@options.command(
    "\b\nFor example\n"
    "  shadowbench engines\n"
    "  shadowbench engines install three ogre\n"
    "  shadowbench run stairs -t three -t three:bias=-0.0005 -t shadow-map:preset=three --map-size 1024"
)
def engines(
    action: Annotated[str, options.argument("ACTION", "list, install or doctor  [list].")] = "list",
    names: Annotated[list[str] | None, options.argument("NAME...", "Engines  [doctor: those installed].")] = None,
    *,
    printed: options.Printed,
) -> int:
    """List, install or check other engines.

    They are measured like techniques, each by a program of its own: `shadowbench run stairs -t three`.

    An engine is installed in an environment of its own below the cache folder, from a lock file with hashes; nothing
    is downloaded unless `install` asks for it. `doctor` starts each engine and has it draw a probe. An engine's
    parameters are those of `shadowbench list engines NAME`; at their defaults they are what the engine ships with.
    """
    from shadowbench.plugin.registry import engines as known_engines

    known = known_engines()
    if action not in _ACTIONS:
        raise InputError(f"engines: found {action!r:.60}{alternatives(action, _ACTIONS)}")
    for name in names or ():
        if name not in known:
            raise InputError(f"engines {action}: found {name!r:.60}{alternatives(name, known)}")
    chosen = {name: known[name] for name in names or known}
    if action == "install":
        if not names:
            raise InputError(f"engines install: found no name; allowed: {', '.join(known)}")
        return _install(chosen, printed.quiet)
    return _list(chosen, printed.json) if action == "list" else _doctor(chosen, bool(names))


def _list(chosen: "Mapping[str, type[Engine]]", json: bool) -> int:
    from shadowbench.engines.environment import locked_version, what_lacks

    entries: list[dict[str, Any]] = [
        {
            "name": name,
            "version": locked_version(one),
            "lights": sorted(one.lights),
            "presets": list(one.presets),
            "ready": what_lacks(one) is None,
            "lacks": what_lacks(one),
        }
        for name, one in chosen.items()
    ]
    if json:
        console.print_json(entries)
        return 0
    rows = [
        (one["name"], one["version"], " ".join(one["lights"]), " ".join(one["presets"]), one["lacks"] or "ready")
        for one in entries
    ]
    console.print_table("", ("engine", "version", "lights", "presets", ""), rows, whole=("engine", "version"))
    return 0


def _install(chosen: "Mapping[str, type[Engine]]", quiet: bool) -> int:
    """Install engines one after the other; exit code 1 if one failed."""
    from shadowbench.engines.environment import install, needed_programs

    failed = False
    for name, one in chosen.items():
        if not quiet:
            console.print_error(f"{name}: installing")
        try:
            folder = install(one)
        except ShadowbenchError as error:
            failed = True
            console.print_error(f"{name}: {error}")
            continue
        console.print_line(f"{name}: {folder}")
        if missing := needed_programs(one):
            console.print_error(
                f"{name}: {' and '.join(missing)} not found: apt-get install {' '.join(missing.values())}"
            )
    return int(failed)


def _doctor(chosen: "Mapping[str, type[Engine]]", named: bool) -> int:
    """Have engines draw a probe; exit code 1 if one does not."""
    from shadowbench.engines.environment import what_lacks
    from shadowbench.engines.session import EngineSession
    from shadowbench.measure.drawer import CellFailed

    failed = False
    for name, one in chosen.items():
        lacking = what_lacks(one)
        if lacking is not None:
            failed |= named
            console.print_line(f"{name}: {lacking}")
            continue
        try:
            session = EngineSession(one, _SIZE)
            console.print_line(f"{name}: draws; {session.version}, {session.renderer}")
            session.close()
        except CellFailed as error:
            failed = True
            console.print_line(f"{name}: {error}")
    return int(failed)
