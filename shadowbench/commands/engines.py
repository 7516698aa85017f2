"""`engines`: what other engines there are, their installation, whether they draw here, and how well."""

from collections.abc import Mapping
from contextlib import closing
from dataclasses import dataclass, fields
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from shadowbench.commands import console, engines_measured, options
from shadowbench.errors import InputError, ShadowbenchError, alternatives
from shadowbench.options import MAP_SIZE, PHASES, option, view_size

if TYPE_CHECKING:
    from shadowbench.plugin.engine import Engine

_ALL = "all"
_ACTIONS = ("list", "install", "doctor", "measure", "page")
_OF_ACTIONS = {"json": ("list",), "output": ("measure", "page")}  # others are of `measure`
_SIZE = 128  # of the probe that `doctor` draws


@dataclass(frozen=True)
class MeasureOptions:
    """What `measure` draws, and where it and `page` write."""

    output: Path | None = options.output(
        "measure: folder for rows, pictures and the page engines.md; page: its file  [engines.md in the first folder].",
        metavar="DIR|FILE",
    )
    view_size: int | None = view_size()
    map_size: int | None = option(
        "Texels along a side of the maps of all engines that have a parameter `size`  [1024].", "N", bounds=MAP_SIZE
    )
    scenes: str | None = option(
        "Scenes with hard shadows, each as for `run`  [the built-in ones].", "SCENE,SCENE,...", complete=options.scenes
    )
    phases: int | None = option(
        "Sub-texel offsets of maps whose box is given; values are medians over them  [1].", "N", bounds=PHASES
    )


@options.command(
    "\b\nFor example\n"
    "  shadowbench engines\n"
    "  shadowbench engines install three ogre\n"
    "  shadowbench engines install all\n"
    "  shadowbench engines measure -o results/engines\n"
    "  shadowbench engines page results/engines results/engines-before -o engines.md\n"
    "  shadowbench run stairs -t three -t three:bias=-0.0005 -t shadow-map:preset=three --map-size 1024"
)
def engines(
    action: Annotated[str, options.argument("ACTION", "list, install, doctor, measure or page  [list].")] = "list",
    names: Annotated[
        list[str] | None,
        options.argument(
            "NAME...",
            "Engines  [doctor, measure: those installed]; install: or `all`; page: folders of `measure` or `run`.",
        ),
    ] = None,
    *,
    asked: MeasureOptions,
    printed: options.Printed,
) -> int:
    """List, install, check or measure other engines.

    They are measured like techniques, each by a program of its own: `shadowbench run stairs -t three`.

    An engine is installed in an environment of its own below the cache folder, from a lock file with hashes; nothing
    is downloaded unless `install` asks for it. `doctor` starts each engine and has it draw a probe, and a shadow of
    each kind of light. An engine's parameters are those of `shadowbench list engines NAME`; at their defaults they are
    what the engine ships with.

    `measure` draws each preset of each engine, with single- and with double-sided materials, in scenes with hard
    shadows, and writes a page with tables and pictures; repeated, it goes on where it was stopped. `page` writes it
    again, also of several folders, such as those of two versions.
    """
    from shadowbench.plugin.registry import engines as known_engines

    known = known_engines()
    if action not in _ACTIONS:
        raise InputError(f"engines: found {action!r:.60}{alternatives(action, _ACTIONS)}")
    for name in (one.name for one in (*fields(asked), *fields(printed)) if one.name != "quiet"):
        allowed = _OF_ACTIONS.get(name, ("measure",))
        if action not in allowed and (getattr(asked, name, None) or getattr(printed, name, None)):
            shown = "-o" if name == "output" else f"--{name.replace('_', '-')}"
            raise InputError(f"engines {action}: found {shown}; allowed for: {' and '.join(allowed)}")
    if action == "page":
        return engines_measured.page(known, list(map(Path, names or ())), asked.output)
    if action == "install" and names == [_ALL]:
        names = list(known)
    for name in names or ():
        if name not in known:
            raise InputError(f"engines {action}: found {name!r:.60}{alternatives(name, known)}")
    chosen = {name: known[name] for name in names or known}
    if action == "install":
        if not names:
            raise InputError(f"engines install: found no name; allowed: {_ALL}, {', '.join(known)}")
        return _install(chosen, printed.quiet)
    if action == "measure":
        if asked.output is None:
            raise InputError("engines measure: found no -o; allowed: a folder for rows, pictures and the page")
        what = engines_measured.What(asked.view_size, asked.map_size, options.listed(asked.scenes), asked.phases)
        return engines_measured.measure_engines(known, list(names or ()), asked.output, what, printed.quiet)
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
    from shadowbench.engines.environment import check_lock, install, what_lacks

    failed = False
    for one in chosen.values():
        check_lock(one)
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
        if lacking := what_lacks(one):
            console.print_error(f"{name}: {lacking}")
    return int(failed)


def _doctor(chosen: "Mapping[str, type[Engine]]", named: bool) -> int:
    """Have engines draw a probe and a shadow of each kind of light; exit code 1 if one does not."""
    from shadowbench.engines.environment import what_lacks
    from shadowbench.engines.session import EngineSession
    from shadowbench.engines.trial import shadows_drawn
    from shadowbench.measure.worker import CellFailed

    failed = False
    for name, one in chosen.items():
        lacking = what_lacks(one)
        if lacking is not None:
            failed |= named
            console.print_line(f"{name}: {lacking}")
            continue
        try:
            with closing(EngineSession(one, _SIZE)) as session:
                drawn = [f"{light} {share:.0%}" for light, share in shadows_drawn(session).items()]
            console.print_line(f"{name}: draws; {session.version}, {session.renderer}; shadows: {', '.join(drawn)}")
        except CellFailed as error:
            failed = True
            console.print_line(f"{name}: {error}")
    return int(failed)
