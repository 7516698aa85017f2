"""`truth` and `render`: one view, one answer."""

from pathlib import Path

import numpy as np

from shadowbench.commands.console import ConsoleReporter, check_outputs, out, techniques_with
from shadowbench.errors import InputError, ShadowbenchError
from shadowbench.measure.cells import Cell, PlacedView
from shadowbench.measure.pictures import write_picture
from shadowbench.measure.place import CellFailed
from shadowbench.measure.session import Session, Unsupported
from shadowbench.measure.worker import Worker
from shadowbench.scenes.model import View
from shadowbench.scenes.views import chosen_view, notes_on
from shadowbench.scores.masks import write_mask
from shadowbench.techniques.base import Technique
from shadowbench.techniques.spec import parse_spec
from shadowbench.truth.cache import cached_truth, write_truth


def truth_command(
    scene: str,
    output: Path,
    view_size: int,
    pixel_samples: int,
    view: str | None,
    light: str | None,
    assets: Path | None,
    up: str | None,
    quiet: bool,
) -> None:
    """Trace a view and write its arrays."""
    check_outputs(".npz", output)
    with ConsoleReporter(quiet) as reporter:
        truth = cached_truth(_view(scene, view, light, view_size, assets, up, reporter), pixel_samples)
    write_truth(output, truth)
    if not quiet:
        receivers = int(truth.receivers.sum())
        shadowed = int((truth.visibility < 0.5).sum())
        undecided = int((truth.receivers & truth.undecided).sum())
        out.print(
            f"{output}: {receivers} receivers of {truth.receivers.size} pixels, {shadowed} in shadow, "
            f"{undecided} undecided",
            soft_wrap=True,
        )


def render_command(
    scene: str,
    techniques: tuple[str, ...],
    output: Path,
    mask: Path | None,
    map_file: Path | None,
    tint: bool,
    view_size: int,
    view: str | None,
    light: str | None,
    plugins: tuple[Path, ...],
    assets: Path | None,
    up: str | None,
    quiet: bool,
) -> None:
    """Draw a view with one technique and write the pictures that were asked for."""
    if len(techniques) > 1:
        raise InputError(f"--technique: found {' and '.join(techniques)}; allowed: one, and several with `run`")
    check_outputs(".png", output, mask, map_file)
    (technique,) = techniques
    known = techniques_with(plugins)
    spec = parse_spec(technique, known)
    tinted = [name for name, one in known.items() if one.tint is not Technique.tint]
    if tint and spec.technique.name not in tinted:
        raise InputError(f"--tint: {spec.technique.name} has no colours of its own; allowed: {', '.join(tinted)}")
    with ConsoleReporter(quiet) as reporter:
        chosen = _view(scene, view, light, view_size, assets, up, reporter)
    with Worker(plugins) as worker:
        largest = worker.info.max_map_size
        if (spec.map_size or 0) > largest:
            raise InputError(f"map size {spec.map_size}: this device allows 1 to {largest}")
        try:
            at, request = PlacedView(chosen), Cell(spec).request
            drawn = worker.call(Session.draw, at, request, with_map=map_file is not None, tinted=tint)
        except Unsupported as reason:
            raise InputError(f"{technique} does not go with {chosen.scene.name}: {reason}") from None
        except CellFailed as reason:
            raise ShadowbenchError(f"{technique} on {chosen.scene.name} failed: {reason}") from None
    if map_file is not None and drawn.map is None:
        raise InputError(f"--map {map_file}: {spec.technique.name} has no map")
    write_picture(output, drawn.picture)
    if mask is not None:
        write_mask(mask, drawn.visibility)
    if map_file is not None and drawn.map is not None:
        write_picture(map_file, np.round(np.clip(drawn.map, 0, 1) * 255).astype(np.uint8))
    if not quiet:
        out.print(f"{output}: {technique} on {chosen.scene.name}", markup=False, soft_wrap=True)


def _view(
    scene: str,
    view: str | None,
    light: str | None,
    size: int,
    assets: Path | None,
    up: str | None,
    reporter: ConsoleReporter,
) -> View:
    """The view that the options name, its assumptions printed."""
    chosen = chosen_view(scene, size, view, light, assets, up)
    for note in notes_on(chosen, view, light):
        reporter.note(note)
    return chosen
