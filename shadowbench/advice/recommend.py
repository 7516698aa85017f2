"""Computation behind `recommend`: target, measured recommendation, and export of the chosen shaders."""

import dataclasses
import json
import math
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from shadowbench.advice.recommendation import Recommendation, Unit, find_cheapest
from shadowbench.advice.search import Trial
from shadowbench.advice.space import chosen_techniques
from shadowbench.advice.target import Measure, Target
from shadowbench.advice.words import obstacles, target_notes
from shadowbench.errors import InputError
from shadowbench.files import replace_file
from shadowbench.measure.campaign import Campaign
from shadowbench.measure.cells import DEFAULT_REFERENCE, Block, Cell
from shadowbench.measure.drawer import DeviceInfo, Drawer
from shadowbench.measure.gl_drawer import GLDrawer
from shadowbench.measure.rows import Result
from shadowbench.measure.scoring import prepare_truth
from shadowbench.plugin.params import Component
from shadowbench.plugin.spec import Spec
from shadowbench.results.folder import write_cells
from shadowbench.scenes.model import View
from shadowbench.scores.metrics import ranking
from shadowbench.studies.crossing import Techniques
from shadowbench.studies.study import Study
from shadowbench.truths.cache import cached_truth

ROUNDS = 9


_ALLOWED: dict[str, tuple[Callable[[float], bool], str]] = {
    "--min-iou": (lambda value: 0 < value <= 1, "above 0, up to 1"),
    "--max-edge-px": (lambda value: 0 <= value < math.inf, "0 and more"),
    "--max-rmse": (lambda value: 0 <= value <= 1, "0 to 1"),
    "--budget-ms": (lambda value: 0 < value < math.inf, "above 0"),
}
_METRICS: dict[str, Measure] = {"--min-iou": "iou", "--max-edge-px": "edge_px", "--max-rmse": "rmse"}


def target_of(
    min_iou: float | None = None,
    max_edge_px: float | None = None,
    budget_ms: float | None = None,
    max_rmse: float | None = None,
    *,
    soft: bool = False,
) -> Target:
    """Target given by options, by default an IoU of 0.99, or for soft shadows an RMSE of 0.02.

    soft: whether the view has penumbrae. Raises InputError for invalid or conflicting options.
    """
    options = {"--min-iou": min_iou, "--max-edge-px": max_edge_px, "--max-rmse": max_rmse}
    given = [name for name, value in options.items() if value is not None]
    if len(given) > 1:
        found = "both" if len(given) == 2 else "all"
        raise InputError(f"{' and '.join(given)}: found {found}; allowed: one of them")
    for name, value in {**options, "--budget-ms": budget_ms}.items():
        is_allowed, told = _ALLOWED[name]
        if value is not None and not is_allowed(value):
            raise InputError(f"{name}: found {value:g}; allowed: {told}")
    if given:
        (name,) = given
        return Target(_METRICS[name], options[name] or 0.0, budget_ms)
    metric = ranking(soft)
    return Target("rmse" if soft else "iou", metric.targets[1], budget_ms)


def has_penumbra(view: View) -> bool:
    """Whether any pixel of a view is in penumbra, so that RMSE ranks its shadows."""
    return view.light.soft and prepare_truth(cached_truth(view)).soft


def recommend(
    view: View,
    target: Target,
    known: Techniques,
    campaign: Campaign,
    *,
    on_this_machine: bool = False,
    timed: bool = True,
    among: Sequence[str] = (),
) -> tuple[Recommendation, DeviceInfo]:
    """The cheapest measured of the `known` techniques that meets a target in a view, and the device.

    Measures into a campaign's folder: rows, masks, pictures, `table.csv`, `run.json`. on_this_machine: rank by times
    even on a software renderer; timed: whether the campaign may time; among: names of the techniques to search, all if
    empty. Raises InputError for a folder with other files, a budget on a software renderer, a device without pipeline
    statistics, and names of techniques of which none supports the light.
    """
    chosen_techniques(known, among, view.light.hard_kind, view.light.soft)  # before the truth is traced
    info = campaign.drawer.info
    unit = _unit(target, info, on_this_machine, timed)
    campaign.reporter.stage("truth", 1)
    study = Study.of([view.scene], [DEFAULT_REFERENCE], view_size=view.size, rounds=ROUNDS if unit == "ms" else 0)
    block = study.block(view)
    truth = cached_truth(view)
    results: list[Result] = []
    with campaign:
        campaign.reporter.stage("measuring", None)  # the search ends when no spec is left that may be cheaper

        def measure(spec: Spec) -> Result:
            (found,) = campaign.measure([dataclasses.replace(block, cells=(Cell(spec),))])
            results.extend(found)
            return results[-1]

        found = find_cheapest(view, truth, target, unit, known, info.max_map_size, measure, among)
    campaign.finish(study.facts, view.scene.notes, [result.score["key"] for result in results])
    if results:
        write_cells(campaign.folder, {})
    return found, info


def _unit(target: Target, info: DeviceInfo, on_this_machine: bool, timed: bool) -> Unit:
    if not timed and (target.budget_ms is not None or on_this_machine):
        option = "--on-this-machine" if on_this_machine else "--budget-ms"
        raise InputError(f"{option}: nothing is timed with --dask; allowed: with --time-on WORKER")
    if timed and (not info.software or on_this_machine):
        return "ms"
    if target.budget_ms is not None:
        raise InputError(
            f"--budget-ms: {info.renderer} is a software renderer, whose times are not a GPU's; --on-this-machine "
            "ranks by them nevertheless"
        )
    if not info.pipeline_statistics:
        raise InputError(f"{info.renderer} does not count work; allowed: --on-this-machine, which ranks by its times")
    return "work"


def export_choice(found: Recommendation, folder: Path, drawer: Drawer) -> None:
    """Write `parameters.json` and one file per shader stage of the choice into a folder; nothing without a choice."""
    if found.choice is None:
        return
    spec = found.choice.spec
    assert isinstance(drawer, GLDrawer)  # what it recommends
    shaders = drawer.shaders(Block(found.view, ()), Cell(spec))
    parameters = {
        "spec": spec.text,
        "technique": spec.technique.name,
        "parameters": {name: _parameter(value) for name, value in spec.params},
        "scene": found.view.scene.name,
        "target": str(found.target),
        "metre": found.view.scene.placement.length(1.0),  # length of 1 m in the shaders' units
        "uniforms": {
            shader.name: {name: _parameter(value) for name, value in shader.uniforms.items()} for shader in shaders
        },
    }
    for shader in shaders:
        with replace_file(folder / shader.name) as temporary:
            temporary.write_text(shader.text, encoding="utf-8")
    with replace_file(folder / "parameters.json") as temporary:
        temporary.write_text(json.dumps(parameters, indent=2) + "\n", encoding="utf-8")


def _parameter(value: Any) -> Any:
    """JSON value of a parameter; a component is an object with its name and parameters."""
    if isinstance(value, Component):
        return {"name": value.name, **value.model_dump(mode="json")}
    return value.tolist() if hasattr(value, "tolist") else value


def values(found: Recommendation, info: DeviceInfo) -> dict[str, Any]:
    """JSON object of `recommend --json`."""
    return {
        "scene": found.view.scene.name,
        "view": found.view.camera.name,
        "light": found.view.light.name,
        "view_size": found.view.size,
        "target": {"metric": found.target.metric, "value": found.target.value, "budget_ms": found.target.budget_ms},
        "notes": target_notes(found),
        "ranked_by": "work_cost" if found.unit == "work" else "frame_ms",
        "reference": None if found.reference is None else dataclasses.asdict(found.reference),
        "renderer": info.renderer,
        "choice": _values(found.choice),
        "closest": _values(found.closest),
        "in_the_way": obstacles(found) if found.closest else [],
        "runners_up": [{"standing": found.standing(one)} | (_values(one) or {}) for one in found.runners_up],
        "relaxed": _values(found.cheaper),
        "tightened": _values(found.better),
        "measured": found.measured,
        "space": found.space_size,
        "evidence": [_values(trial) for trial in found.trials],
        "techniques": list(found.among) or None,
        "refused": dict(found.unsuccessful),
        "untried": [{"technique": name, **dataclasses.asdict(one)} for name, one in found.untried.items()],
        "excluded": [
            {"what": exclusion.what, "why": exclusion.why, "specs": exclusion.specs} for exclusion in found.excluded
        ],
    }


def _values(trial: Trial | None) -> dict[str, Any] | None:
    if trial is None or trial.result is None:
        return None
    row = trial.result.score
    values = {"spec": trial.spec.text, "cost": trial.cost, "gpu_bytes": trial.bytes, "key": row["key"]}
    return values | {"metrics": row["metrics"]}
