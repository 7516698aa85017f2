"""`recommend`: the cheapest spec that meets a target in a view."""

import dataclasses
import json
import math
from collections.abc import Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rich.markup import escape
from rich.table import Table

from shadowbench.advice.recommend import Recommendation, Target, Unit, recommend
from shadowbench.advice.search import Tried
from shadowbench.commands.console import (
    ConsoleReporter,
    check_folder,
    number,
    out,
    print_json,
    print_table,
    techniques_with,
)
from shadowbench.commands.recommend_words import excluded_lines, in_the_way, step_lines
from shadowbench.errors import InputError
from shadowbench.files import replace_file
from shadowbench.measure.cells import Block, Cell, CellRequest, PlacedView
from shadowbench.measure.machine import write_run_file
from shadowbench.measure.measurer import Measurer
from shadowbench.measure.pictures import Pictures
from shadowbench.measure.references import USUAL
from shadowbench.measure.row_store import RowStore
from shadowbench.measure.rows import Result
from shadowbench.measure.session import DeviceInfo, Session
from shadowbench.measure.worker import Worker
from shadowbench.reports.folder import write_cells
from shadowbench.scenes.views import chosen_view, notes_on
from shadowbench.studies.study import Study
from shadowbench.studies.times import time_notes
from shadowbench.techniques.params import Row
from shadowbench.techniques.spec import Spec
from shadowbench.techniques.stage import ShaderText
from shadowbench.truth.cache import cached_truth

ROUNDS = 9
LEAST_IOU = 0.99


@dataclass(frozen=True)
class RecommendOptions:
    """What the command line says; None leaves it to what is usual."""

    scene: str
    min_iou: float | None
    max_edge_px: float | None
    budget_ms: float | None
    on_this_machine: bool
    export: Path | None
    view_size: int
    view: str | None
    light: str | None
    plugins: tuple[Path, ...]
    assets: Path | None
    up: str | None


def recommend_command(options: RecommendOptions, folder: Path, *, as_json: bool, quiet: bool) -> int:
    """Search, write rows, table and pictures, print the choice; 1 where nothing meets the target."""
    target = target_of(options)
    known = techniques_with(options.plugins)
    check_folder(folder)
    if options.export is not None:
        _check_folder(options.export)
    with ConsoleReporter(quiet) as reporter, Worker(options.plugins) as worker:
        view = chosen_view(options.scene, options.view_size, options.view, options.light, options.assets, options.up)
        info = worker.info
        unit = _unit(options, info)
        for note in notes_on(view, options.view, options.light):
            reporter.note(note)
        reporter.stage("truth", 1)
        truth = cached_truth(view)
        study = Study((view.scene.name,), (USUAL,), USUAL, view_size=view.size, rounds=ROUNDS if unit == "ms" else 0)
        results: list[Result] = []
        with closing(RowStore(folder)) as store:
            measurer = Measurer(worker, store, study.conditions(), reporter, Pictures(folder))
            reporter.stage("measuring", 1)

            def measure(spec: Spec) -> Result:
                results.extend(measurer.measured(Block(view, (Cell(spec),))))
                return results[-1]

            found = recommend(view, truth, target, unit, known, info.max_map_size, measure)
            shaders: list[ShaderText] = []
            if options.export is not None and found.choice is not None:
                at = PlacedView(view, study.coordinates)
                shaders = worker.call(Session.shaders, at, CellRequest(found.choice.spec.full_text))
    write_run_file(folder / "run.json", info, view.scene.notes, study.facts, [one.score for one in results])
    if results:
        write_cells(folder, results, {})
    if options.export is not None and found.choice is not None:
        export(options.export, found, found.choice.spec, shaders)
    if as_json:
        print_json(as_values(found, info))
    else:
        _print(found, info, folder)
        if options.export is not None and found.choice is not None and not quiet:
            out.print(f"{options.export}: parameters.json and the GLSL of the choice", markup=False, soft_wrap=True)
    return 0 if found.choice is not None else 1


def target_of(options: RecommendOptions) -> Target:
    """The target that options name; raises InputError for one that nothing could mean."""
    least, most, budget = options.min_iou, options.max_edge_px, options.budget_ms
    if least is not None and most is not None:
        raise InputError("--min-iou and --max-edge-px: found both; allowed: one of them")
    if least is not None and not 0 < least <= 1:
        raise InputError(f"--min-iou: found {least:g}; allowed: above 0, up to 1")
    if most is not None and not 0 <= most < math.inf:
        raise InputError(f"--max-edge-px: found {most:g}; allowed: 0 and more")
    if budget is not None and not 0 < budget < math.inf:
        raise InputError(f"--budget-ms: found {budget:g}; allowed: above 0")
    if most is not None:
        return Target("edge_px", most, budget)
    return Target("iou", LEAST_IOU if least is None else least, budget)


def _unit(options: RecommendOptions, info: DeviceInfo) -> Unit:
    if not info.software or options.on_this_machine:
        return "ms"
    if options.budget_ms is not None:
        raise InputError(
            f"--budget-ms: {info.renderer} is a software renderer, whose times are not a GPU's; --on-this-machine "
            "takes them for what they are"
        )
    if not info.pipeline_statistics:
        raise InputError(f"{info.renderer} counts no work; allowed: --on-this-machine, which ranks by its times")
    return "work"


def export(folder: Path, found: Recommendation, spec: Spec, shaders: Sequence[ShaderText]) -> None:
    """`parameters.json` of the choice, and a file for each of its shaders."""
    parameters = {
        "spec": spec.text,
        "technique": spec.technique.name,
        "parameters": {name: _parameter(value) for name, value in spec.params},
        "scene": found.view.scene.name,
        "target": str(found.target),
        "metre": found.view.scene.placement.length(1.0),  # a file unit in the shaders' units
        "uniforms": {one.name: {name: _parameter(value) for name, value in one.uniforms.items()} for one in shaders},
    }
    for one in shaders:
        with replace_file(folder / one.name) as beside:
            beside.write_text(one.text, encoding="utf-8")
    with replace_file(folder / "parameters.json") as beside:
        beside.write_text(json.dumps(parameters, indent=2) + "\n", encoding="utf-8")


def _parameter(value: Any) -> Any:
    """A value as JSON has it: a row by its name and with its own parameters."""
    if isinstance(value, Row):
        return {"name": value.name, **value.model_dump(mode="json")}
    return value.tolist() if hasattr(value, "tolist") else value


def _check_folder(folder: Path) -> None:
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"--export {folder}: cannot be made ({error.strerror or error})") from None


def as_values(found: Recommendation, info: DeviceInfo) -> dict[str, Any]:
    """A recommendation as JSON has it."""
    return {
        "scene": found.view.scene.name,
        "view": found.view.camera.name,
        "light": found.view.light.name,
        "view_size": found.view.size,
        "target": {"metric": found.target.metric, "value": found.target.value, "budget_ms": found.target.budget_ms},
        "ranked_by": "work_cost" if found.unit == "work" else "frame_ms",
        "reference": None if found.reference is None else dataclasses.asdict(found.reference),
        "renderer": info.renderer,
        "choice": _values(found.choice),
        "closest": _values(found.closest),
        "in_the_way": in_the_way(found) if found.closest else [],
        "runners_up": [_values(one) for one in found.runners_up],
        "relaxed": _values(found.cheaper),
        "tightened": _values(found.better),
        "measured": found.measured,
        "space": found.whole,
        "evidence": [_values(one) for one in found.tried],
        "refused": dict(found.refused),
        "excluded": [{"what": one.what, "why": one.why, "specs": one.specs} for one in found.excluded],
    }


def _values(one: Tried | None) -> Mapping[str, Any] | None:
    if one is None or one.result is None:
        return None
    row = one.result.score
    values = {"spec": one.spec.text, "cost": one.cost, "gpu_bytes": one.bytes, "key": row["key"]}
    return values | {"metrics": row["metrics"]}


def _print(found: Recommendation, info: DeviceInfo, folder: Path) -> None:
    by = "work" if found.unit == "work" else "this machine's times" if info.software else "this GPU's times"
    said = "; a software renderer's times are not a GPU's" if info.software else ""
    title = f"{found.view.scene.name}, {found.target}, by {by}{said}"
    table = Table(title=escape(title), title_justify="left", box=None, pad_edge=False)
    columns = (
        "",
        "spec",
        "map",
        found.target.metric,
        "work" if found.unit == "work" else "ms",
        "× choice",
        "MiB",
        "key",
    )
    for place, heading in enumerate(columns):
        table.add_column(heading, justify="right" if 1 < place < 7 else "left", no_wrap=place in (0, 1, 7))
    shown: list[tuple[str, Tried]] = []
    if found.choice is not None:
        shown.append(("choice", found.choice))
    if found.closest is not None:
        shown.append(("closest", found.closest))
    for one in found.runners_up:
        if one is not found.closest:
            shown.append(("next" if one.error <= found.target.limit else "misses", one))
    for place_name, one in shown:
        table.add_row(place_name, *_cells(found, one))
    print_table(table)
    lines = step_lines(found) if found.choice else in_the_way(found)
    for line in [*lines, *time_notes(found.reference), *excluded_lines(found)]:
        out.print(line, markup=False, soft_wrap=True)
    out.print(
        f"{found.measured} of {found.whole} specs measured; rows by key, masks and pictures in {folder}",
        markup=False,
        soft_wrap=True,
    )


def _cells(found: Recommendation, one: Tried) -> list[str]:
    assert one.result is not None
    value = one.result.score["metrics"][found.target.metric]
    return [
        escape(one.spec.sizeless_text),
        str(one.spec.map_size or ""),
        "" if value is None else number(value),
        f"{one.cost:,.0f}" if found.unit == "work" else number(one.cost),
        f"{one.cost / found.choice.cost:.3g}" if found.choice else "",
        f"{one.bytes / 2**20:.3g}",
        str(one.result.score["key"]),
    ]
