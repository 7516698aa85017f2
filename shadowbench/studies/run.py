"""Measuring a study, or a part of it: its blocks, what is noted about them, and their campaigns."""

import hashlib
import json
import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, TypeVar

from shadowbench.errors import InputError, ShadowbenchError
from shadowbench.measure.campaign import Block, Campaign, Cell, Failure, Reporter
from shadowbench.measure.worker import DeviceInfo
from shadowbench.scenes.opening import first_of
from shadowbench.studies.study import Study, scenes_of

if TYPE_CHECKING:  # what imports pandas, 0.3 s, waits until the cells are measured
    from shadowbench.results.frame import Run

T = TypeVar("T")
_PIXEL_S = 12e-9  # seconds of a drawn pixel or texel, on two cores without a GPU
_DRAWN = 4  # frames that take as long as drawing and scoring a cell
_TIMED = 4 / 3  # frames of a round, with the passes
_LONG_S = 60.0  # from which an estimate is given


def dealt(items: Sequence[T], part: str | None, identity: Callable[[T], object], reporter: Reporter) -> list[T]:
    """The items of a part K/N, in their order; all for None. Raises InputError for another part.

    Parts differ in length by at most one, and may be empty, which is noted. They are dealt in the order of hashes,
    which mixes large and small ones, and is the same on every machine. identity: a JSON value unique to an item.
    """
    named = re.fullmatch(r"0*([1-9]\d{0,4})/0*([1-9]\d{0,4})", "1/1" if part is None else part, re.ASCII)
    number, count = map(int, named.groups()) if named else (2, 1)
    if number > count:
        raise InputError(f"--part: found {part!r:.60}; allowed: K/N, as in 3/16, with K from 1 to N, N up to 99999")
    digests = [hashlib.sha256(json.dumps(identity(item)).encode()).digest() for item in items]
    own = sorted(range(len(items)), key=digests.__getitem__)[number - 1 :: count]
    if not own and part is not None:  # there are more parts than views
        reporter.note(f"--part {part}: nothing to measure, as the cells of a view stay together")
    return [items[index] for index in sorted(own)]


def names_of(block: Block) -> list[str]:
    """Names of a block's scene, camera, light and sequence, by which blocks of a study are dealt to its parts."""
    names = [block.view.scene.name, block.view.camera.name, block.view.light.name]
    return [*names, block.place["sequence"]] if block.place else names


@dataclass(frozen=True, eq=False)
class StudyResult:
    """Result of measuring a study into a folder.

    run: the whole folder, with cells of earlier commands, of which `run.last` are the study's; failures: what was left
    out, if it kept going.
    """

    study: Study
    run: "Run"
    info: DeviceInfo
    failures: tuple[Failure, ...] = ()


def measure(study: Study, campaign: Campaign, part: str | None = None) -> StudyResult:
    """Measure a study into a folder: rows, masks, pictures, `table.csv` and `run.json`. Existing rows are reused.

    campaign: in that folder; part: K/N, to measure only its blocks. If it keeps going, scenes, truths and blocks that
    fail are left out. Raises InputError for a scene that cannot be read and a map or view too large for the device. A
    cell that fails gets a row with that status.
    """
    failures: list[Failure] = []
    blocks = readable_blocks(study, failures) if campaign.keep_going else [*study.blocks()]
    blocks = dealt(blocks, part, names_of, campaign.reporter)
    check_sizes(study, campaign.drawer.info)
    notes = list(dict.fromkeys(_notes(study, blocks)))
    # Before anything is written: a view that shows nothing raises InputError.
    traced = [(block, shows) for block, shows in zip(blocks, campaign.trace(blocks), strict=True) if shows]
    if blocks and not traced:
        raise _nothing("is left to measure", campaign.failures)
    for block, shows in traced:
        if shows != "with edges":
            everything = "nothing is in shadow" if shows == "lit" else "everything is in shadow"
            notes.append(f"{block.view.name}: {everything}, so most metrics are undefined or trivial")
    for line in notes:
        campaign.reporter.note(line)
    drawn = [block for block, _ in traced]
    with campaign:
        _announce(study, drawn, campaign)
        keys = [result.score["key"] for results in campaign.measure(drawn) for result in results]
        if blocks and not keys:
            raise _nothing("was measured", campaign.failures)
        from shadowbench.results.frame import write_cells

        campaign.finish(study.facts, notes, dict.fromkeys(keys))
        run = write_cells(campaign.folder, study.bias_sweeps)
    return StudyResult(study, run, campaign.drawer.info, tuple(dict.fromkeys([*failures, *campaign.failures])))


def _notes(study: Study, blocks: Sequence[Block]) -> Iterator[str]:
    """What is noted before anything is drawn."""
    yield from study.notes
    for scene in scenes_of(blocks):
        yield from scene.notes
        if "file" in study.views:
            yield from first_of(scene.name, "cameras", scene.cameras, "--view or a study")


def _announce(study: Study, blocks: Sequence[Block], campaign: Campaign) -> None:
    """Begin the stage of the cells, after a note if they take long."""
    cells = [(block, cell) for block in blocks for cell in block.cells]
    missing = [(cell, len(block.views)) for block in blocks for cell in campaign.unscored(block)]
    timed = sum(block.times(cell) for block, cell in cells)
    if (seconds := sum(_seconds(study, cell, frames) for cell, frames in missing)) >= _LONG_S:
        rough = f"about {duration(seconds)} on two cores without a GPU"
        also = f" and {timed} to time" if timed else ""
        campaign.reporter.note(f"{len(missing)} of {len(cells)} cells to draw{also}: {rough}")
    campaign.reporter.stage("cells", len(cells) + timed)


def _nothing(what: str, failures: Sequence[Failure]) -> ShadowbenchError:
    return ShadowbenchError(f"nothing {what}: {failures[0].where}: {failures[0].reason}")


def readable_blocks(study: Study, failures: list[Failure]) -> list[Block]:
    """The blocks of a study whose scenes can be read; failures: receives the others."""
    blocks: list[Block] = []
    for source in study.scenes:
        try:
            own = list(study.with_(scenes=(source,)).blocks())
            if any(block.view.scene.name == own[0].view.scene.name for block in blocks):
                raise InputError(f"found two scenes that are called {own[0].view.scene.name!r}; names must differ")
            blocks += own
        except InputError as error:
            name = source if isinstance(source, str) else source.name
            reason = str(error).removeprefix(f"{name.rpartition('/')[2]}: ").removeprefix(f"{name}: ")
            failures.append(Failure("scene", name, reason))
    if not blocks:
        raise InputError(f"{failures[0].where}: {failures[0].reason}")
    return blocks


def check_sizes(study: Study, info: DeviceInfo) -> None:
    """Raises InputError if a map or the view is larger than the device allows."""
    largest = max(study.reference.map_size or 0, *(cell.spec.map_size or 0 for cell in study.cells()))
    for what, size in (("map size", largest), ("view size", max(study.view_size))):
        if size > info.max_map_size:
            raise InputError(f"{what} {size}: {info.renderer} allows 1 to {info.max_map_size}")


def _seconds(study: Study, cell: Cell, frames: int) -> float:
    """Approximate seconds of drawing, scoring and timing a cell on two cores without a GPU."""
    view = study.view_size.pixels
    pixels = view + (cell.spec.map_size or 0) ** 2
    timed = _TIMED * study.rounds * pixels if cell.phase == 0 else 0.0
    return _PIXEL_S * (_DRAWN * frames * pixels + timed)


def duration(seconds: float) -> str:
    """Text of a rough duration: `40 s`, `12 min`, `2.5 h`."""
    if seconds < 90:
        return f"{max(seconds, 1):.0f} s"
    return f"{seconds / 60:.0f} min" if seconds < 5400 else f"{seconds / 3600:.1f} h"
