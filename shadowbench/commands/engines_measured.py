"""Measuring other engines, and the page about them: two actions of `engines`."""

from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from shadowbench.commands import console
from shadowbench.errors import InputError, counted

if TYPE_CHECKING:
    from shadowbench.plugin.engine import Engine
    from shadowbench.results.frame import Run

_PAGE = "engines.md"


@dataclass(frozen=True)
class What:
    """What is drawn; None, and no scenes, for the defaults."""

    view_size: int | None = None
    map_size: int | None = None
    scenes: Sequence[str] = ()
    phases: int | None = None


def measure_engines(
    known: "Mapping[str, type[Engine]]", names: Sequence[str], folder: Path, what: What, quiet: bool
) -> int:
    """Measure the presets of engines, all of `known` without names, into a folder, and write its page.

    Those that cannot draw here are told on stderr; exit code 1 if one of them was named, or if none can. Raises
    InputError for scenes with soft shadows.
    """
    from shadowbench.campaigns import campaign_in
    from shadowbench.engines.environment import what_lacks
    from shadowbench.files import check_folder, make_folder
    from shadowbench.reports.engines_page import is_engines_page
    from shadowbench.results.engine_settings import preset_specs
    from shadowbench.scenes.library import hard_names, load_scene
    from shadowbench.studies.run import measure
    from shadowbench.studies.study import Study

    for scene in what.scenes:
        if any(light.soft for light in load_scene(scene).lights):
            raise InputError(
                f"--scenes: {scene} has soft shadows; allowed: {', '.join(hard_names())}, or a file with hard ones"
            )
    lacking = {name: what_lacks(known[name]) for name in names or known}
    ready = [known[name] for name, reason in lacking.items() if reason is None]
    specs = [spec for engine in ready for spec in preset_specs(engine, what.map_size or 1024)]
    make_folder(folder, "-o ")
    if [file.name for file in folder.iterdir()] == [_PAGE] and is_engines_page(folder / _PAGE):
        (folder / _PAGE).unlink()  # of a command that found no engine
    check_folder(folder)
    for name, reason in lacking.items():
        if reason is not None and (names or not quiet):
            console.print_error(f"{name}: {reason}")
    code = int(not ready or any(lacking[name] for name in names))
    if not specs:
        _write_page(known, [], folder / _PAGE)
        return code
    study = Study.of(
        what.scenes or hard_names(), specs, view_size=what.view_size or 512, phases=what.phases or 1, rounds=0
    )
    with ExitStack() as stack:
        reporter = stack.enter_context(console.Reporter(quiet))
        campaign = stack.enter_context(campaign_in(folder, reporter, limits=study.limits))
        found = measure(study, campaign)
    _write_page(known, [found.run], folder / _PAGE)
    return console.exit_code_of(found.run.last.results, found.failures) or code


def page(known: "Mapping[str, type[Engine]]", folders: Sequence[Path], target: Path | None) -> int:
    """Write the page of folders that were measured. Raises InputError."""
    from shadowbench.files import check_outputs
    from shadowbench.results.engine_settings import engine_results
    from shadowbench.results.frame import read_runs

    if not folders:
        raise InputError("engines page: found no folder; allowed: those of `engines measure` or `run`")
    target = target or folders[0] / _PAGE
    runs = read_runs(folders)
    if not engine_results(runs):
        where = " and ".join(map(str, folders))
        raise InputError(f"{where}: found no cell of another engine; allowed: {', '.join(known)} among the techniques")
    check_outputs(".md", target)
    _write_page(known, runs, target)
    return 0


def _write_page(known: "Mapping[str, type[Engine]]", runs: "Sequence[Run]", target: Path) -> None:
    """Write the page, and print its first table."""
    from shadowbench.engines.environment import what_lacks
    from shadowbench.reports.engines_page import summary, write_engines_page

    gaps = {name: what_lacks(engine) or "not measured" for name, engine in known.items()}
    found = write_engines_page(runs, gaps, target)
    columns, rows = summary(found)
    if rows:
        plain = [[text.replace("`", "") for text in row] for row in rows]
        console.print_table("", columns, plain, numbers=columns[3:], whole=columns[:1])
    console.print_line(f"{target}: {counted(len(rows), 'setting')} of {counted(len(found), 'engine')}")
