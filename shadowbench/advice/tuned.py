"""What `tune` computes: a technique's parameters searched on some scenes, into a folder, and what to make of it."""

from collections.abc import Mapping, Sequence
from contextlib import closing
from dataclasses import asdict, dataclass, fields, replace
from pathlib import Path
from typing import Any

from shadowbench.advice.tune import tune
from shadowbench.advice.tune_beside import Entry, Tuning
from shadowbench.advice.tune_cells import Cells
from shadowbench.advice.tune_space import Space, searched
from shadowbench.advice.tune_split import split_of
from shadowbench.errors import InputError
from shadowbench.files import check_folder
from shadowbench.measure.executor import Executor
from shadowbench.measure.machine import write_run_file
from shadowbench.measure.measurer import Measurer, Reporter
from shadowbench.measure.row_store import RowStore
from shadowbench.measure.rows import Result
from shadowbench.scenes.library import builtin_names
from shadowbench.scenes.model import Scene
from shadowbench.studies.folder import write_cells
from shadowbench.studies.run import check_sizes
from shadowbench.studies.study import Study, scenes_of
from shadowbench.studies.tables import Interval
from shadowbench.techniques.spec import Spec, spec_of


@dataclass(frozen=True, eq=False)
class Tuned:
    """What was found, and the cells that were measured for it."""

    tuning: Tuning
    results: tuple[Result, ...]


def tuned(
    spec: Spec,
    folder: Path,
    executor: Executor,
    reporter: Reporter,
    *,
    scenes: Sequence[str | Scene] = (),
    held_out: Sequence[str] = (),
    params: str | None = None,
    against: Mapping[str, Spec] = {},
    trials: int = 100,
    map_size: Sequence[int] = (2048,),
    phases: int = 2,
    **others: Any,
) -> Tuned:
    """Search a technique's parameters, and set what is found beside its default, its presets and specs `against` it.

    scenes: all built-in ones for none; held_out: names of scenes to compare on, every third for none; params: names,
    separated by commas, the usual ones for None; map_size: several are averaged, as phases are; others: fields of a
    study, such as `view_size` and `assets`. Writes rows, `table.csv` and `run.json`. Raises InputError for what cannot
    be searched, CellFailed where the default fails.
    """
    home = _at(spec, map_size)
    names = searched(home, params)
    beside = {name: _at(other, map_size) for name, other in (_presets(home) | dict(against)).items()}
    together = {"reference": home, "map_size": map_size, "rounds": 0, "phases": phases, **others}
    study = Study.of(scenes or builtin_names(), [home], **together)
    check_folder(folder)
    info = executor.info
    check_sizes(study, info)
    if not info.pipeline_statistics:
        raise InputError(f"{info.renderer} counts no invocations, so there is no cost to tune for")
    with closing(RowStore(folder)) as store:
        cells = Cells(study, Measurer(executor, store, study.conditions(), reporter))
        blocks = cells.taking_part(home)
        split = split_of([scene.name for scene in scenes_of(blocks)], held_out)
        space = Space(home, names, cells.refused_rows(home, names, blocks))
        found = tune(space, cells, blocks, split, trials, beside)
    results = tuple(cells.results.values())
    write_run_file(folder / "run.json", info, [], study.facts, [one.score for one in results])
    write_cells(folder, results, {})
    return Tuned(found, results)


def _at(spec: Spec, sizes: Sequence[int]) -> Spec:
    """A spec that takes the sizes, also where it names one: the comparison is at the same."""
    sized = spec.with_(size=sizes[0]) if spec.has_size else spec
    return replace(sized, named=sized.named - {"size"})


def _presets(home: Spec) -> dict[str, Spec]:
    """The technique's presets, by what tables call them."""
    return {
        f"preset={name}": spec_of(home.technique, (("preset", name),), f"preset {name}")
        for name in home.technique.presets
    }


def verdict(found: Tuning) -> str:
    """Whether the scenes held out speak for another default."""
    default = found.others[0]
    if found.tuned.spec == default.spec:
        return "the default stands: nothing at its cost was surely better on the scenes that were tuned on"
    iou, ssim = default.iou_ratio, default.ssim_ratio
    worse = iou is not None and ssim is not None and (iou.low or 0) > 1 and ssim.median > 1
    tuned = found.tuned.spec.sizeless_text
    if worse:
        return f"suggested default: {tuned}"
    return f"the default stands: on the scenes held out it is not surely behind {tuned}"


def values(found: Tuning) -> dict[str, Any]:
    """What was found, as JSON has it."""

    def entry(one: Entry) -> dict[str, Any]:
        values = {item.name: getattr(one, item.name) for item in fields(one)}
        return {key: asdict(value) if isinstance(value, Interval) else value for key, value in values.items()} | {
            "spec": one.spec.sizeless_text
        }

    return asdict(found.split) | {
        "front": [entry(one) for one in found.front],
        "tuned": entry(found.tuned),
        "others": [entry(one) for one in found.others],
        "verdict": verdict(found),
    }
