"""Computation behind `tune`: a parameter search measured into a folder, and its verdict."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, fields, replace
from typing import Any

from shadowbench.advice.tune_cells import TuningCells
from shadowbench.advice.tune_comparison import Entry, TuningComparison
from shadowbench.advice.tune_search import search_parameters
from shadowbench.advice.tune_space import SearchSpace, searched_parameters
from shadowbench.advice.tune_split import split_scenes
from shadowbench.errors import InputError
from shadowbench.measure.campaign import Campaign
from shadowbench.measure.failures import Failure
from shadowbench.measure.rows import Record, Result
from shadowbench.scenes.library import hard_names
from shadowbench.scenes.model import Scene
from shadowbench.studies.folder import write_cells
from shadowbench.studies.run import check_sizes
from shadowbench.studies.study import Study, scenes_of
from shadowbench.studies.tables import Interval
from shadowbench.techniques.spec import Spec, spec_of


@dataclass(frozen=True, eq=False)
class TuningResult:
    """Result of a parameter search, and all cells measured for it; failures: what was left out, with `keep_going`."""

    tuning: TuningComparison
    results: tuple[Result, ...]
    failures: tuple[Failure, ...]


def tune_parameters(
    spec: Spec,
    campaign: Campaign,
    *,
    scenes: Sequence[str | Scene] = (),
    held_out: Sequence[str] = (),
    params: str | None = None,
    against: Mapping[str, Spec] = {},
    trials: int = 100,
    map_size: Sequence[int] = (2048,),
    phases: int = 2,
    **others: Any,
) -> TuningResult:
    """Search a technique's parameters, and compare the result with the default, the presets and the specs `against`.

    scenes: by default the built-in ones whose lights have no size; held_out: names of scenes for the comparison, by
    default every third; params: comma-separated names of parameters, by default DEFAULT_PARAMETERS; map_size: results
    for several sizes are averaged, as are phases; others: fields of a study, such as `view_size` and `assets`. Writes
    rows, `table.csv` and `run.json` into the campaign's folder. Raises InputError for parameters that cannot be
    searched, CellFailed if the default fails.
    """
    base = _sizeless(spec, map_size)
    names = searched_parameters(base, params)
    compared_specs = {name: _sizeless(other, map_size) for name, other in (_presets(base) | dict(against)).items()}
    study_fields = {"reference": base, "map_size": map_size, "rounds": 0, "phases": phases, **others}
    study = Study.of(scenes or hard_names(), [base], **study_fields)
    info = campaign.drawer.info
    check_sizes(study, info)
    if not info.pipeline_statistics:
        raise InputError(f"{info.renderer} does not count shader invocations, so that there is no cost to minimise")
    with campaign:
        cells = TuningCells(study, campaign)
        blocks = cells.eligible_blocks(base)
        campaign.keep_going = False  # every spec is judged by the same views
        split = split_scenes([scene.name for scene in scenes_of(blocks)], held_out)
        space = SearchSpace(base, names, cells.unsupported_components(base, names, blocks))
        found = search_parameters(space, cells, blocks, split, trials, compared_specs)
    results = tuple(cells.results.values())
    campaign.finish(study.facts, [], [result.score["key"] for result in results])
    write_cells(campaign.folder, results, {})
    return TuningResult(found, results, tuple(campaign.failures))


def no_image(row: Record) -> bool:
    """Never, of the cells of a search: see `Campaign`."""
    return False


def _sizeless(spec: Spec, sizes: Sequence[int]) -> Spec:
    """The spec without a map size of its own, so that all specs are compared at the given sizes."""
    sized = spec.with_(size=sizes[0]) if spec.has_size else spec
    return replace(sized, explicit=sized.explicit - {"size"})


def _presets(base: Spec) -> dict[str, Spec]:
    """Specs of the technique's presets, by their names in tables."""
    return {
        f"preset={name}": spec_of(base.technique, (("preset", name),), f"preset {name}")
        for name in base.technique.presets
    }


def verdict(found: TuningComparison) -> str:
    """A sentence on whether the held-out scenes support a new default."""
    default = found.others[0]
    if found.tuned.spec == default.spec:
        return "the default stands: nothing at its cost was significantly better on the scenes tuned on"
    errors = [ratio for ratio in (default.iou_ratio, default.rmse_ratio) if ratio is not None]
    ssim = default.ssim_ratio
    worse = ssim is not None and all((ratio.low or 0) > 1 for ratio in errors) and ssim.median > 1
    tuned = found.tuned.spec.sizeless_text
    if worse:
        return f"suggested default: {tuned}"
    return f"the default stands: on the scenes held out it is not significantly worse than {tuned}"


def values(found: TuningComparison) -> dict[str, Any]:
    """JSON object of `tune --json`."""

    def entry_values(entry: Entry) -> dict[str, Any]:
        values = {item.name: getattr(entry, item.name) for item in fields(entry)}
        ends = ("median", "low", "high")
        return {
            key: {end: getattr(value, end) for end in ends} if isinstance(value, Interval) else value
            for key, value in values.items()
        } | {"spec": entry.spec.sizeless_text}

    return asdict(found.split) | {
        "front": [entry_values(entry) for entry in found.front],
        "tuned": entry_values(found.tuned),
        "others": [entry_values(entry) for entry in found.others],
        "verdict": verdict(found),
    }
