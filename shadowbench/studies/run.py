"""Measuring a study: its blocks, what is noted about them, and their campaign."""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

from shadowbench.errors import InputError, ShadowbenchError
from shadowbench.measure.campaign import Campaign, Uniform
from shadowbench.measure.cells import Block, Cell
from shadowbench.measure.failures import Failure
from shadowbench.measure.flips import size_after
from shadowbench.measure.rows import Result
from shadowbench.measure.session import DeviceInfo
from shadowbench.scenes.model import Scene
from shadowbench.scenes.views import first_of
from shadowbench.studies.study import Study, scenes_of
from shadowbench.techniques.unshadowed import Unshadowed

_PIXEL_S = 12e-9  # seconds of a drawn pixel or texel, on two cores without a GPU
_DRAWN = 4  # frames that take as long as drawing and scoring a cell
_TIMED = 4 / 3  # frames of a round, with the passes


def cell_seconds(study: Study, cell: Cell) -> float:
    """Approximate seconds of drawing, scoring and timing a cell on two cores without a GPU."""
    pixels, stepped = _pixels(study, cell), size_after(study.step, study.view_size) ** 2
    timed = _TIMED * study.rounds * pixels if cell.phase == 0 else 0.0
    return _PIXEL_S * (_DRAWN * (pixels + stepped) + timed)


def _pixels(study: Study, cell: Cell) -> int:
    return study.view_size**2 + (cell.spec.map_size or 0) ** 2


def duration(seconds: float) -> str:
    """Text of a rough duration: `40 s`, `12 min`, `2.5 h`."""
    if seconds < 90:
        return f"{max(seconds, 1):.0f} s"
    return f"{seconds / 60:.0f} min" if seconds < 5400 else f"{seconds / 3600:.1f} h"


_TRIVIAL: dict[Uniform | None, tuple[str, ...]] = {
    "lit": ("nothing is in shadow, so most metrics are undefined or trivial",),
    "in shadow": ("everything is in shadow, so most metrics are undefined or trivial",),
    None: (),
}
_LONG_S = 60.0  # from which an estimate is given


@dataclass(frozen=True, eq=False)
class RunResult:
    """Keys of all cells of a run, measured now or before, and its notes."""

    keys: list[str]
    notes: list[str]


def run_blocks(study: Study, blocks: Sequence[Block], campaign: Campaign) -> RunResult:
    """Measure the blocks of a study. Raises InputError before anything is written.

    Raises ShadowbenchError if nothing is left of a campaign that keeps going.
    """
    check_sizes(study, campaign.drawer.info)
    reporter = campaign.reporter
    notes = [*study.notes, *(note for scene in scenes_of(blocks) for note in _of(study, scene))]
    for note in notes:
        reporter.note(note)

    def add(block: Block, lines: Iterable[str]) -> None:
        for line in lines:
            notes.append(f"{block.view.name}: {line}")
            reporter.note(notes[-1])

    traced = campaign.trace(blocks)  # before anything is written: a view that shows nothing raises InputError
    if not traced:
        raise _nothing("is left to measure", campaign.failures)
    for block, uniform in traced:
        add(block, _TRIVIAL[uniform])
    with campaign:
        cells = [(block, cell) for block, _ in traced for cell in block.cells]
        missing = [cell for block, _ in traced for cell in campaign.unscored(block)]
        if (seconds := sum(cell_seconds(study, cell) for cell in missing)) >= _LONG_S:
            rough = f"about {duration(seconds)} on two cores without a GPU"
            reporter.note(f"{len(missing)} of {len(cells)} cells to measure: {rough}")
        reporter.stage("cells", len(cells) + sum(block.times(cell) for block, cell in cells))
        keys: list[str] = []
        measured = campaign.measure(block.fresh() for block, _ in traced)
        for (block, uniform), found in zip(traced, measured, strict=True):
            keys += [result.score["key"] for result in found.values()]
            if uniform is None:
                add(block, dict.fromkeys(filter(None, map(_uniform_mask, found.values()))))  # phases may say the same
    if not keys:
        raise _nothing("was measured", campaign.failures)
    return RunResult(keys, notes)


def _nothing(what: str, failures: Sequence[Failure]) -> ShadowbenchError:
    return ShadowbenchError(f"nothing {what}: {failures[0].where}: {failures[0].reason}")


def readable_blocks(study: Study, failures: list[Failure]) -> list[Block]:
    """The blocks of a study whose scenes can be read; failures: receives the others."""
    blocks: list[Block] = []
    for source in study.scenes:
        try:
            own = list(study.with_(scenes=(source,)).blocks())
            if any(block.scene.name == own[0].scene.name for block in blocks):
                raise InputError(f"found two scenes that are called {own[0].scene.name!r}; names must differ")
            blocks += own
        except InputError as error:
            name = source if isinstance(source, str) else source.name
            reason = str(error).removeprefix(f"{Path(name).name}: ").removeprefix(f"{name}: ")
            failures.append(Failure("scene", name, reason))
    if not blocks:
        raise InputError(f"{failures[0].where}: {failures[0].reason}")
    return blocks


def check_sizes(study: Study, info: DeviceInfo) -> None:
    """Raises InputError if a map or the view is larger than the device allows."""
    largest = max(study.reference.map_size or 0, *(cell.spec.map_size or 0 for cell in study.cells()))
    view = max(study.view_size, size_after(study.step, study.view_size))
    for what, size in (("map size", largest), ("view size", view)):
        if size > info.max_map_size:
            raise InputError(f"{what} {size}: {info.renderer} allows 1 to {info.max_map_size}")


def _uniform_mask(result: Result) -> str | None:
    """A line about a mask without an edge, in a view whose truth has one: it is lit, or in shadow, all over."""
    row = result.score
    if row["status"] != "ok" or row["technique"] == Unshadowed.name:
        return None
    if row["metrics"]["edge_px"] != math.hypot(row["view_size"], row["view_size"]):
        return None
    size = f" at {row['map_size']}" if row["map_size"] else ""
    where = "in shadow" if row["metrics"]["iou"] else "lit"
    return f"{row['spec']}{size} draws every scored pixel {where}"


def _of(study: Study, scene: Scene) -> list[str]:
    first = "file" in study.views
    several = first_of(scene.name, "cameras", scene.cameras, "--view or a study") if first else []
    return [*scene.notes, *several]
