"""`score`: a mask or screenshots of another renderer."""

import json
import shlex
from dataclasses import dataclass
from pathlib import Path

from rich.table import Table

from shadowbench.commands.console import (
    ConsoleReporter,
    check_folder,
    check_outputs,
    err,
    number,
    out,
    print_json,
    print_table,
)
from shadowbench.engines.difference import write_difference
from shadowbench.engines.export import DESCRIPTION
from shadowbench.engines.pictures import Handed, from_screenshots, mask_from_file
from shadowbench.engines.scored import Accuracy, accuracy_of
from shadowbench.engines.store import append_row, check_name
from shadowbench.errors import InputError
from shadowbench.scenes.model import View
from shadowbench.scenes.views import chosen_view, notes_on
from shadowbench.scores.metrics import METRICS


@dataclass(frozen=True)
class ScoreOptions:
    """What the command line says: the scene and what was drawn of it, and where results go."""

    scene: str
    mask: Path | None
    lit: Path | None
    shadowed: Path | None
    ambient: Path | None
    view: str | None
    light: str | None
    assets: Path | None
    up: str | None
    folder: Path | None
    name: str | None
    difference: Path | None


def score_command(options: ScoreOptions, *, as_json: bool, quiet: bool) -> None:
    """Score what was handed over, print every metric, and write what was asked for."""
    if (options.folder is None) != (options.name is None):
        raise InputError("-o DIR and --name NAME: found one of them; allowed: both, for a row in a run folder, or none")
    if options.name is not None:
        check_name(options.name)
    check_outputs(".png", options.difference)
    _check_difference(options)
    if options.folder is not None:
        check_folder(options.folder)
    handed = _handed(options)
    with ConsoleReporter(quiet) as reporter:
        view = chosen_view(options.scene, handed.size, options.view, options.light, options.assets, options.up)
        for note in notes_on(view, options.view, options.light):
            reporter.note(note)
        accuracy = accuracy_of(handed, view)
    warnings = [*accuracy.warnings, *_beside(options, view)]
    if options.difference is not None:
        write_difference(options.difference, accuracy.difference())
    new = None
    if options.folder is not None and options.name is not None:
        new = append_row(accuracy, options.name, options.folder)
    if as_json:
        print_json(_as_json(accuracy, warnings))
        return
    _print(accuracy)
    if quiet:
        return
    for warning in warnings:
        err.print(f"warning: {warning}", markup=False, soft_wrap=True)
    if options.difference is not None:
        out.print(f"{options.difference}: false shadow orange, false light blue", markup=False, soft_wrap=True)
    if new is not None and options.folder is not None:
        said = f"a row of {options.name}, its mask and difference" if new else f"has this row of {options.name} already"
        out.print(f"{options.folder}: {said}", markup=False, soft_wrap=True)


def _handed(options: ScoreOptions) -> Handed:
    """A mask, or screenshots; InputError for both, neither or half of them."""
    if options.mask is not None and options.lit is options.shadowed is options.ambient is None:
        return mask_from_file(options.mask)
    if options.mask is None and options.lit is not None and options.shadowed is not None:
        return from_screenshots(options.lit, options.shadowed, options.ambient)
    if options.mask is options.lit is options.shadowed is options.ambient is None:
        command = f"shadowbench score {shlex.quote(options.scene)}"
        raise InputError(
            f"score: found neither a mask nor screenshots of {options.scene:.200}; allowed: {command} MASK.png, or "
            f"{command} --lit LIT.png --shadowed SHADOWED.png; shadowbench export says what to draw"
        )
    given = {"MASK": options.mask, "--lit": options.lit, "--shadowed": options.shadowed, "--ambient": options.ambient}
    found = " and ".join(key for key, value in given.items() if value is not None)
    raise InputError(f"score: found {found}; allowed: MASK, or --lit and --shadowed, with or without --ambient")


def _check_difference(options: ScoreOptions) -> None:
    """Raise InputError for a difference that would be written over what is scored."""
    drawn = options.difference
    for given in (options.mask, options.lit, options.shadowed, options.ambient):
        if drawn is not None and given is not None and drawn.exists() and given.exists() and drawn.samefile(given):
            raise InputError(f"--diff {drawn}: is one of the pictures to score; name another file")


def _beside(options: ScoreOptions, view: View) -> list[str]:
    """A line where `export` wrote the scene beside what was handed over, at another size than that has."""
    given = options.mask or options.shadowed
    if given is None or not (exported := given.parent / DESCRIPTION).is_file():
        return []
    try:
        described = json.loads(exported.read_text(encoding="utf-8"))
    except ValueError:  # somebody else's file of that name
        return []
    match described:
        case {"scene": view.scene.name, "image": {"width": int(width)}} if width != view.size:
            sizes = f"{view.size}², where {exported} says {width}²"
            return [f"{given}: {sizes}; a mask's size is the view's: scored as the view of {view.size}²"]
    return []


def _print(accuracy: Accuracy) -> None:
    view = accuracy.view
    title = f"{accuracy.handed.name} on {view.scene.name}, {view.camera.name}, {view.light.name}, {view.size}²"
    table = Table(title=title, title_justify="left", box=None, pad_edge=False)
    table.add_column("metric", no_wrap=True)
    table.add_column("", justify="right", no_wrap=True)
    table.add_column("better", no_wrap=True)
    table.add_column("what it is")
    for metric in METRICS.values():
        value = accuracy.metrics[metric.name]
        table.add_row(metric.name, "–" if value is None else number(value), metric.better, metric.help.split(". ")[0])
    print_table(table)
    for line in accuracy.summary():
        out.print(f"  {line}", markup=False, soft_wrap=True)


def _as_json(accuracy: Accuracy, warnings: list[str]) -> dict[str, object]:
    view = accuracy.view
    false_shadow, false_light = accuracy.wrong
    return {
        "scene": view.scene.name,
        "view": view.camera.name,
        "light": view.light.name,
        "view_size": view.size,
        **accuracy.record,
        "false_shadow": false_shadow,
        "false_light": false_light,
        "errors": [{"kind": kind.name, "pixels": kind.pixels, "line": kind.line} for kind in accuracy.kinds],
        "warnings": warnings,
    }
