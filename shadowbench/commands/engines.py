"""`engines`: what other engines there are, their installation, whether they draw here, and how well."""

from collections.abc import Mapping
from contextlib import closing
from dataclasses import dataclass, fields
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, get_args

from shadowbench.commands import console, options
from shadowbench.commands.report import ReportOptions, report
from shadowbench.commands.run import RunOptions, run
from shadowbench.errors import InputError, ShadowbenchError, alternatives
from shadowbench.options import FIRST, MAP_SIZE, Measuring, ViewSize, option, view_size

if TYPE_CHECKING:
    from shadowbench.plugin.engine import Engine

    Engines = Mapping[str, type[Engine]]

_ALL = "all"
_ACTIONS = ("list", "install", "doctor", "measure", "page")
_OF_ACTIONS = {"json": ("list",), "output": ("measure", "page")}  # others are of `measure`
_PROBE_SIZE = ViewSize(128, 128)  # of what `doctor` draws
_PAGE = "report.html"


@dataclass(frozen=True)
class MeasureOptions:
    """What `measure` draws, and where it and `page` write."""

    output: Path | None = options.output(
        "measure: folder for rows, pictures and report.html; page: its file  [report.html in the first folder].",
        metavar="DIR|FILE",
    )
    view_size: ViewSize | None = view_size()
    map_size: int | None = option(
        "Texels along a side of the maps of all engines that have a parameter `size`  [1024].", "N", bounds=MAP_SIZE
    )
    scenes: str | None = option("Scenes with hard shadows, each as for `run`  [the built-in ones].", "SCENE,SCENE,...")


@options.command(
    "\b\nFor example\n"
    "  shadowbench engines\n"
    "  shadowbench engines install three ogre\n"
    "  shadowbench engines install all\n"
    "  shadowbench engines measure -o results/engines\n"
    "  shadowbench engines page results/engines results/engines-before -o engines.html\n"
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
    measuring: MeasureOptions,
    printed: options.Printed,
) -> int:
    """List, install, check or measure other engines.

    They are measured like techniques, each by a program of its own: `shadowbench run stairs -t three`.

    An engine is installed in an environment of its own below the cache folder, from a lock file with hashes; nothing
    is downloaded unless `install` asks for it. `doctor` starts each engine and has it draw a probe, and a shadow of
    each kind of light. An engine's parameters are those of `shadowbench list engines NAME`; at their defaults they are
    what the engine ships with.

    `measure` draws each preset of each engine, with single- and with double-sided materials, in scenes with hard
    shadows, and writes the report; repeated, it goes on where it was stopped. `page` writes the report again, also of
    several folders, such as those of two versions.
    """
    from shadowbench.plugin.registry import engines as known_engines

    known = known_engines()
    if action not in _ACTIONS:
        raise InputError(f"engines: found {action!r}{alternatives(action, _ACTIONS)}")
    for name in (field.name for field in (*fields(measuring), *fields(printed)) if field.name != "quiet"):
        allowed = _OF_ACTIONS.get(name, ("measure",))
        if action not in allowed and (getattr(measuring, name, None) or getattr(printed, name, None)):
            shown = "-o" if name == "output" else f"--{name.replace('_', '-')}"
            raise InputError(f"engines {action}: found {shown}; allowed for: {' and '.join(allowed)}")
    if action == "page":
        return _write_page([*map(Path, names or ())], measuring.output, printed.quiet)
    if action == "install" and names == [_ALL]:
        names = list(known)
    for name in names or ():
        if name not in known:
            raise InputError(f"engines {action}: found {name!r}{alternatives(name, known)}")
    chosen = {name: known[name] for name in names or known}
    if action == "install":
        if not names:
            raise InputError(f"engines install: found no name; allowed: {_ALL}, {', '.join(known)}")
        return _install(chosen, printed.quiet)
    if action == "measure":
        return _measure(chosen, bool(names), measuring, printed.quiet)
    return _list(chosen, printed.json) if action == "list" else _doctor(chosen, bool(names))


def _list(chosen: "Engines", json: bool) -> int:
    from shadowbench.engines.programs import locked_version, what_lacks

    entries = [
        {
            "name": name,
            "version": locked_version(engine),
            "lights": sorted(engine.lights),
            "presets": list(engine.presets),
            "lacks": what_lacks(engine),
        }
        for name, engine in chosen.items()
    ]
    if json:
        console.print_json(entries)
        return 0
    rows = [[" ".join(part) if isinstance(part, list) else part or "ready" for part in one.values()] for one in entries]
    console.print_table("", ("engine", "version", "lights", "presets", ""), rows, whole=("engine", "version"))
    return 0


def _install(chosen: "Engines", quiet: bool) -> int:
    """Install engines one after the other; exit code 1 if one failed."""
    from shadowbench.engines.programs import install, what_lacks

    failed = False
    for name, engine in chosen.items():
        if not quiet:
            console.print_error(f"{name}: installing")
        try:
            folder = install(engine)
        except ShadowbenchError as error:
            failed = True
            console.print_error(f"{name}: {error}")
            continue
        console.print_line(f"{name}: {folder}")
        if lacking := what_lacks(engine):
            console.print_error(f"{name}: {lacking}")
    return int(failed)


def _doctor(chosen: "Engines", named: bool) -> int:
    """Have engines draw a probe and a shadow of each kind of light; exit code 1 if one does not."""
    from shadowbench.engines.engine_session import EngineSession
    from shadowbench.engines.programs import what_lacks
    from shadowbench.measure.worker import CellFailed

    failed = False
    for name, engine in chosen.items():
        lacking = what_lacks(engine)
        if lacking is not None:
            failed |= named
            console.print_line(f"{name}: {lacking}")
            continue
        try:
            with closing(EngineSession(engine, _PROBE_SIZE)) as session:
                shares = [f"{light} {share:.0%}" for light, share in session.shadows_drawn().items()]
            console.print_line(f"{name}: draws; {session.version}, {session.renderer}; shadows: {', '.join(shares)}")
        except CellFailed as error:
            failed = True
            console.print_line(f"{name}: {error}")
    return int(failed)


def _measure(chosen: "Engines", named: bool, measuring: MeasureOptions, quiet: bool) -> int:
    """Run the presets of engines into a folder, and write its report.

    Engines that cannot draw here are named on stderr; exit code 1 if one of them was named, or if none can draw.
    Raises InputError without a folder, and for scenes with soft shadows.
    """
    from shadowbench.engines.programs import what_lacks
    from shadowbench.scenes.library import hard_names, load_scene

    if measuring.output is None:
        raise InputError("engines measure: found no -o; allowed: a folder for rows, pictures and the report")
    scenes = measuring.scenes.split(",") if measuring.scenes else hard_names()
    for scene in scenes:
        if any(light.soft for light in load_scene(scene).lights):
            raise InputError(
                f"--scenes: {scene} has soft shadows; allowed: {', '.join(hard_names())}, or a file with hard ones"
            )
    lacking = {name: reason for name, engine in chosen.items() if (reason := what_lacks(engine))}
    for name, reason in lacking.items():
        if named or not quiet:
            console.print_error(f"{name}: {reason}")
    specs = [
        spec for name in chosen if name not in lacking for spec in _presets(chosen[name], measuring.map_size or 1024)
    ]
    if not specs:
        return 1
    code = run.body(
        list(scenes),
        measuring=Measuring(measuring.view_size, rounds=0),
        view=FIRST,
        machines=options.Machines(),
        printed=options.Printed(quiet=quiet),
        chosen=RunOptions(techniques=specs, output=measuring.output),
    )
    _write_page([measuring.output], measuring.output / _PAGE, quiet)
    return code or int(named and bool(lacking))


def _presets(engine: "type[Engine]", map_size: int) -> list[str]:
    """The specs of an engine's presets, with materials single- and double-sided; those that are equal are one."""
    from shadowbench.plugin.engine import Sides
    from shadowbench.plugin.spec import has_size, parse_spec

    end = f",size={map_size}" if has_size(engine) else ""
    texts = [f"{engine.name}:preset={name},sides={side}{end}" for name in engine.presets for side in get_args(Sides)]
    return list({parse_spec(text, {engine.name: engine}): text for text in reversed(texts)}.values())[::-1]


def _write_page(folders: list[Path], target: Path | None, quiet: bool) -> int:
    """Write the report of folders. Raises InputError."""
    if not folders:
        raise InputError("engines page: found no folder; allowed: those of `engines measure` or `run`")
    report.body(folders, ReportOptions(output=target or folders[0] / _PAGE), quiet)
    return 0
