"""Computation behind `run`: the study given by a file and options, and its measurement into a folder."""

from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from shadowbench.measure.campaign import Campaign
from shadowbench.measure.failures import Failure
from shadowbench.measure.session import DeviceInfo
from shadowbench.options import AS_STUDIED, FIRST, Measuring, ViewOptions
from shadowbench.plugin.spec import Spec, has_size
from shadowbench.scenes.model import Scene
from shadowbench.studies.crossing import Techniques
from shadowbench.studies.part import WHOLE, Part
from shadowbench.studies.run import cell_seconds, readable_blocks, run_blocks
from shadowbench.studies.study import Study, find_study, read_study

if TYPE_CHECKING:  # what imports pandas, 0.3 s, waits until the cells are measured
    from shadowbench.results.folder import Run
    from shadowbench.results.tables import SweepPositions


def study_from_options(
    known: Techniques,
    scenes: Sequence[str | Scene] = (),
    specs: Sequence[Spec] = (),
    *,
    study: str | None = None,
    map_size: Sequence[int] | None = None,
    measuring: Measuring = AS_STUDIED,
    view: ViewOptions = FIRST,
) -> Study:
    """A study from a file or a built-in one (`default` for None), with what is asked for in place of its own.

    known: techniques that the file may name; view: options without a value keep the study's. Specs without a study and
    map sizes are measured at their own map sizes, in one phase. Raises InputError.
    """
    found = read_study(find_study(study or "default"), known)
    if specs:
        if study is None and map_size is None:
            found = found.with_(map_size=None, phases=1)
        found = found.with_specs(specs)
    elif measuring.phases:
        found = found.with_(technique=tuple(replace(crossed, phases=None) for crossed in found.technique))
    named = [spec.text for spec in specs if "size" in spec.explicit] if map_size else []
    sizes = ",".join(map(str, map_size or ()))
    notes = [f"{name} names its size, which --map-size {sizes} leaves as it is" for name in named]
    around = [spec.text for spec in found.specs if any(map(has_size, spec.techniques[1:]))] if map_size else []
    notes += [
        f"{name}: --map-size {sizes} leaves the map inside as it is; its size is written in the spec" for name in around
    ]
    changes = {
        "scenes": scenes,
        "map_size": map_size,
        "notes": (*found.notes, *notes),
        **asdict(measuring),
        **asdict(view),
    }
    for one, several in (("view", "views"), ("light", "lights")):
        changes[several] = tuple(filter(None, [changes.pop(one)]))
    return found.with_(**{name: value for name, value in changes.items() if value or type(value) is int})  # 0 rounds


def estimate(study: Study) -> tuple[int, float]:
    """Number of cells of a study, and their approximate run time in seconds on two cores without a GPU, at least 5.

    Lights other than `sun` are taken to have no size.
    """
    cells = study.cells(study.sun)
    seconds = sum(cell_seconds(study, cell) for cell in cells) * len(study.scenes)
    return len(cells) * len(study.scenes), max(seconds, 5)


@dataclass(frozen=True, eq=False)
class StudyResult:
    """Result of measuring a study into a folder.

    run: the whole folder, with cells of earlier commands, of which `run.last` are the study's; sweep_positions: of
    specs in its bias sweeps; failures: what was left out, if it kept going.
    """

    study: Study
    run: "Run"
    sweep_positions: "SweepPositions"
    info: DeviceInfo
    failures: tuple[Failure, ...] = ()


@dataclass(frozen=True, eq=False)
class Place:
    """Where a study is measured: what opens a campaign in a folder, and whether cells are timed there."""

    campaign: Callable[[Path], Campaign]
    times: bool = True


def measure(
    study: Study, folder: Path, places: Sequence[Place], part: Part = WHOLE, keep_going: bool = False
) -> StudyResult:
    """Measure a study into a folder: rows, masks, pictures, `table.csv` and `run.json`. Existing rows are reused.

    places: one after the other; part: measure only its blocks; keep_going: leave out scenes, truths and blocks that
    fail. Raises InputError for a folder with other files, a scene that cannot be read, and a map or view too large for
    the device. A cell that fails gets a row with that status.
    """
    failures: list[Failure] = []
    scored = part.of_blocks(readable_blocks(study, failures) if keep_going else [*study.blocks()])
    keys: dict[str, None] = {}
    notes: dict[str, None] = {}
    for place in places:
        campaign = place.campaign(folder)
        blocks = scored if place.times else [replace(block, rounds=0) for block in scored]
        found = run_blocks(study, blocks, campaign)
        keys |= dict.fromkeys(found.keys)
        failures += campaign.failures
        notes |= dict.fromkeys(found.notes)
    from shadowbench.results.folder import write_cells

    positions = study.sweep_positions
    campaign.finish(study.facts, list(notes), keys)
    run = write_cells(folder, positions)
    return StudyResult(study, run, positions, campaign.drawer.info, tuple(dict.fromkeys(failures)))
