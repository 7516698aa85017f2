"""Computation behind `tune`: a parameter search measured into a folder."""

from collections.abc import Sequence
from dataclasses import asdict, replace
from typing import Any

from shadowbench.advice.tune_search import ParameterSearch, Setting, Tuning, TuningCells
from shadowbench.advice.tune_space import SearchSpace, searched_parameters, split_scenes
from shadowbench.errors import InputError
from shadowbench.measure.campaign import Campaign
from shadowbench.measure.rows import Record
from shadowbench.plugin.spec import Spec, spec_of
from shadowbench.results.frame import write_cells
from shadowbench.scenes.library import hard_names
from shadowbench.scenes.model import Scene
from shadowbench.studies.run import check_sizes
from shadowbench.studies.study import Study, scenes_of


def tune_parameters(
    spec: Spec,
    campaign: Campaign,
    *,
    scenes: Sequence[str | Scene] = (),
    held_out: Sequence[str] = (),
    params: str | None = None,
    trials: int = 100,
    map_size: Sequence[int] = (2048,),
    **others: Any,
) -> Tuning:
    """Search a technique's parameters, from the default and the presets on.

    scenes: by default the built-in ones whose lights have no size; held_out: names of scenes for the last score, by
    default every third; params: comma-separated names of parameters, by default DEFAULT_PARAMETERS; map_size: results
    for several sizes are averaged, as are `phases`, 2 by default; others: fields of a study, such as `assets`. Writes
    rows, `table.csv` and `run.json` into the campaign's folder. Raises InputError for parameters that cannot be
    searched, CellFailed if the default fails.
    """
    base = _sizeless(spec, map_size)
    names = searched_parameters(base, params)
    presets = [
        _sizeless(spec_of(base.technique, (("preset", name),), f"preset {name}"), map_size)
        for name in base.technique.presets
    ]
    study_fields = {"reference": base, "map_size": map_size, "rounds": 0, "phases": 2, **others}
    study = Study.of(scenes or hard_names(), [base], **study_fields)
    info = campaign.drawer.info
    check_sizes(study, info)
    if base.technique.own and not info.pipeline_statistics:
        raise InputError(f"{info.renderer} does not count shader invocations, so that there is no cost to minimise")
    with campaign:
        cells = TuningCells(study, campaign)
        blocks = cells.eligible_blocks(base)
        campaign.keep_going = False  # every spec is judged by the same views
        split = split_scenes([scene.name for scene in scenes_of(blocks)], held_out)
        space = SearchSpace(base, names, cells.unsupported_components(base, names, blocks))
        found = ParameterSearch(space, cells, blocks, split).run(trials, presets)
        campaign.finish(study.facts, [], [result.score["key"] for result in found.results])
        write_cells(campaign.folder, {})
    return found


def no_image(row: Record) -> bool:
    """Never, of the cells of a search: see `Campaign`."""
    return False


def _sizeless(spec: Spec, sizes: Sequence[int]) -> Spec:
    """The spec without a map size of its own, so that all specs are compared at the given sizes."""
    sized = spec.with_(size=sizes[0]) if spec.has_size else spec
    return replace(sized, explicit=sized.explicit - {"size"})


def values(found: Tuning) -> dict[str, Any]:
    """JSON object of `tune --json`."""

    def of(setting: Setting) -> dict[str, Any]:
        return vars(setting) | {"spec": setting.spec.sizeless_text}

    return asdict(found.split) | {"front": list(map(of, found.front)), "default": of(found.default)}
