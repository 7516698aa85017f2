"""What `tune` computes: a technique's parameters searched on some scenes, into a folder, and what to make of it."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, fields, replace
from pathlib import Path
from typing import Any

from shadowbench.advice.tune import tune
from shadowbench.advice.tune_beside import Best, Entry, Tuning
from shadowbench.advice.tune_cells import Cells
from shadowbench.advice.tune_folds import folds
from shadowbench.advice.tune_space import Space, searched
from shadowbench.errors import InputError
from shadowbench.files import check_folder
from shadowbench.measure.machine import write_run_file
from shadowbench.measure.runner import Reporter, Result
from shadowbench.measure.worker import Worker
from shadowbench.scenes.library import builtin_names
from shadowbench.scenes.model import Scene
from shadowbench.studies.folder import write_cells
from shadowbench.studies.study import Study, scenes_of
from shadowbench.studies.tables import Interval
from shadowbench.techniques.spec import Spec, format_spec, spec_of


@dataclass(frozen=True, eq=False)
class Tuned:
    """What was found, and the cells that were measured for it."""

    tuning: Tuning
    results: tuple[Result, ...]


def tuned(
    spec: Spec,
    folder: Path,
    worker: Worker,
    reporter: Reporter,
    *,
    scenes: Sequence[str | Scene] = (),
    held_out: Sequence[str] = (),
    count: int | None = None,
    params: str | None = None,
    against: Mapping[str, Spec] = {},
    trials: int = 100,
    map_size: Sequence[int] = (2048,),
    phases: int = 2,
    **others: Any,
) -> Tuned:
    """Search a technique's parameters, and set what is found beside its default, its presets and specs `against` it.

    scenes: all built-in ones for none; held_out: names of scenes to compare on, every third for none; count: of folds;
    params: names, separated by commas, the usual ones for None; map_size: several are averaged, as phases are; others:
    fields of a study, such as `view_size` and `assets`. Writes rows, `table.csv` and `run.json`. Raises InputError for
    what cannot be searched, CellFailed where the default fails.
    """
    if held_out and count is not None:
        raise InputError(f"--folds {count} holds out every scene once; allowed: it or --held-out, not both")
    home = _at(spec, map_size)
    names = searched(home, params)
    beside = {name: _at(other, map_size) for name, other in (_presets(home) | dict(against)).items()}
    together = {"reference": home, "map_size": map_size, "rounds": 0, "phases": phases, **others}
    study = Study.of(scenes or builtin_names(), [home], **together)
    check_folder(folder)
    with Cells(study, folder, worker, reporter) as cells:
        if not cells.info.pipeline_statistics:
            raise InputError(f"{cells.info.renderer} counts no invocations, so there is no cost to tune for")
        blocks = cells.taking_part(home)
        split = folds([scene.name for scene in scenes_of(blocks)], held_out, count)
        space = Space(home, names, cells.refused_rows(home, names, blocks))
        found = tune(space, cells, blocks, split, trials, beside)
    results = tuple(cells.results.values())
    write_run_file(folder / "run.json", cells.info, [], study, [one.score for one in results])
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
    specs = dict.fromkeys(best.tuned.spec for best in found.folds)
    if list(specs) == [default.spec]:
        return "the default stands: nothing at its cost was surely better on the scenes that were tuned on"
    iou, ssim = default.iou_ratio, default.ssim_ratio
    worse = iou is not None and ssim is not None and (iou.low or 0) > 1 and ssim.median > 1
    texts = [format_spec(spec, size=False) for spec in specs if spec is not None]
    if worse:
        return f"suggested default: {' or '.join(texts)}"
    better = texts[0] if len(texts) == 1 else "what the folds chose"
    return f"the default stands: on the scenes held out it is not surely behind {better}"


def values(found: Tuning) -> dict[str, Any]:
    """What was found, as JSON has it."""

    def entry(one: Entry) -> dict[str, Any]:
        values = {item.name: getattr(one, item.name) for item in fields(one)}
        return {key: asdict(value) if isinstance(value, Interval) else value for key, value in values.items()} | {
            "spec": None if one.spec is None else format_spec(one.spec, size=False)
        }

    def fold(best: Best) -> dict[str, Any]:
        return asdict(best.fold) | {"tuned": entry(best.tuned), "front": [entry(one) for one in best.front]}

    return {
        "folds": [fold(best) for best in found.folds],
        "tuned": entry(found.tuned),
        "others": [entry(one) for one in found.others],
        "verdict": verdict(found),
    }
