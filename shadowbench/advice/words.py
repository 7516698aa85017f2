"""A recommendation as a table, in words, as JSON and as files for an engine. It says no more than was measured."""

import json
import math
from dataclasses import asdict
from decimal import ROUND_CEILING, ROUND_FLOOR, Context
from pathlib import Path
from typing import TYPE_CHECKING, Any

from shadowbench.advice.recommend import Recommendation
from shadowbench.advice.search import LEFT_OUT, SIZES, Trial, start_size
from shadowbench.errors import number
from shadowbench.files import replace_file
from shadowbench.measure.campaign import Block, Cell
from shadowbench.measure.worker import DeviceInfo
from shadowbench.plugin.params import Component
from shadowbench.results.law import SHORTEST_MS, kind_of
from shadowbench.results.summary import Target
from shadowbench.results.times import ROUGH, time_notes
from shadowbench.scores.metrics import METRICS, is_soft, soft_faults

if TYPE_CHECKING:
    from shadowbench.measure.gl_drawer import GLDrawer

_KINDS = {
    "contact": "of the shadow next to its caster is lit",
    "leak": "of the umbra away from edges is lit",
    "acne": "of the lit surface away from edges is dark",
}

_FACETS = 0.01  # share of smooth surfaces' light from which dark facets are mentioned


def table(advice: Recommendation, info: DeviceInfo) -> tuple[str, tuple[str, ...], list[list[str]]]:
    """Title, headings and lines of the table; all headings but the first two and the last are of numbers."""
    by, caveat = "this GPU's times", ""
    if advice.cost.law is not None:
        by = f"predicted times on {advice.cost.law.device}"
    elif info.software:
        by = "work" if advice.cost.name == "work_cost" else "this machine's times"
        caveat = "; times of a software renderer are not those of a GPU"
    among = f", of {', '.join(advice.among)}" if advice.among else ""
    title = f"{advice.view.scene.name}, {advice.asked}{among}, by {by}{caveat}"
    flicker = ("flicker",) if advice.steadiness else ()
    headings = ("", "spec", "map", advice.target.metric, *flicker, _unit(advice), "× choice", "MiB", "key")
    return title, headings, [_cells(advice, trial) for trial in _shown(advice)]


def _shown(advice: Recommendation) -> list[Trial]:
    return list(dict.fromkeys(filter(None, (advice.choice, advice.closest, *advice.runners_up))))


def _unit(advice: Recommendation) -> str:
    return "work" if advice.cost.name == "work_cost" else "ms"


def _cells(advice: Recommendation, trial: Trial) -> list[str]:
    row, metric = trial.result.score, METRICS[advice.target.metric]
    value = row["metrics"][metric.name]
    return [
        advice.standing(trial),
        trial.spec.sizeless_text,
        str(trial.spec.map_size or ""),
        "" if value is None else metric.text(value, lambda value: rounded(advice.target, value), row),
        *([f"{row['metrics']['flicker'] or 0:.3g}"] if advice.steadiness else []),
        "~" * _is_rough(advice, trial) + _cost_text(advice, trial),
        _relative_text(advice, trial),
        f"{row['gpu_bytes'] / 2**20:.3g}",
        str(row["key"]),
    ]


def lines(advice: Recommendation) -> list[str]:
    """What is said below the table."""
    answer = _step_lines(advice) if advice.choice else obstacles(advice)
    return [*answer, *notes(advice), *excluded_lines(advice)]


def _is_rough(advice: Recommendation, trial: Trial) -> bool:
    """Whether the rounds of a time varied much."""
    time = trial.result.time
    return advice.cost.name == "frame_ms" and time is not None and time["ratio_iqr"] > ROUGH * time["ratio"]


def notes(advice: Recommendation) -> list[str]:
    """What target, scores and costs do not say, and how far they can be trusted."""
    rough = [_is_rough(advice, trial) for trial in _shown(advice)]
    return [*_score_notes(advice), *_cost_notes(advice), *time_notes(advice.reference, rough)]


def _score_notes(advice: Recommendation) -> list[str]:
    """What a target means for soft shadows, that no target counts dark facets, and that maps have one phase."""
    target, rows, said = advice.target, [trial.result.score for trial in advice.trials], []
    least = max((row.get("truth_error", 0.0) for row in rows), default=0.0)
    if target.metric == "rmse" and target.limit < least:
        said.append(f"the truth's own error is an RMSE of {least:.2g}: a smaller one cannot be told from 0")
    elif target.metric != "rmse" and any(is_soft(row["metrics"]) for row in rows):
        what = "IoU judges" if target.metric == "iou" else "edges are"
        said.append(f"{what} where visibility is ½, and not how soft a shadow is; --max-rmse judges that")
    best = advice.choice or advice.closest
    facets = best.result.score["metrics"].get("terminator") if best else None
    if facets is not None and facets >= _FACETS:
        said.append(
            f"dark facets take {facets:.0%} of the light on smooth surfaces, in the truth too, so that no target "
            "counts them; maps lose them by the bias terminator: docs/explanation/truth-and-scores.md#smooth-surfaces"
        )
    if any(trial.spec.technique.phased for trial in advice.trials):
        said.append(
            "maps are scored in one phase (sub-texel offset): `shadowbench run --phases 8` shows how others differ"
        )
    return said


def _cost_notes(advice: Recommendation) -> list[str]:
    """How far predicted times can be off; why work ranks where no time can; why specs have no cost."""
    notes = []
    if advice.cost.law is not None:
        errors = advice.cost.law.kinds
        kinds = sorted({kind_of(trial.spec.sizeless_text) for trial in advice.trials})
        factors = ", ".join(f"{kind} ×{errors[kind]['median']:.2f}" for kind in kinds if kind in errors)
        notes = [
            f"ms: beyond a frame without shadows, predicted from work; of <{SHORTEST_MS:g}, not told apart, less work "
            f"is first" + (f"; median error in other scenes at 1024²: {factors}" if factors else "")
        ]
    elif advice.cost.without_law:
        notes = [f"work, not predicted times: {advice.cost.without_law}"]
    whys: dict[str, dict[str, None]] = {}
    for spec, why in advice.unranked.items():
        whys.setdefault(why, {})[kind_of(spec.sizeless_text) if advice.cost.law else spec.sizeless_text] = None
    return [*notes, *(f"no cost is known of {', '.join(kinds)}: {why}" for why, kinds in whys.items())]


def _cost_text(advice: Recommendation, trial: Trial) -> str:
    """A cost in the unit of its column; empty if it is not known."""
    if not trial.ranked:
        return ""
    if advice.cost.name == "work_cost":
        return f"{trial.cost:,.0f}"
    if advice.cost.law is not None:
        return f"{trial.cost:.2g}" if trial.cost > SHORTEST_MS else f"<{SHORTEST_MS:g}"
    return number(trial.cost)


def _relative_text(advice: Recommendation, trial: Trial) -> str:
    """A cost relative to the choice's, or a lower bound; empty without either."""
    if advice.choice is None or not (trial.ranked and advice.choice.ranked and advice.choice.cost):
        return ""
    least = advice.cost.law is not None and trial.cost > advice.choice.cost <= SHORTEST_MS
    return f"{'>' * least}{trial.cost / advice.choice.cost:.3g}"


def _step_lines(advice: Recommendation) -> list[str]:
    """What relaxing the target would save and tightening it would cost, among the trials."""
    choice, cheaper, better = advice.choice, advice.cheaper, advice.better
    assert choice is not None
    lines = ["of those measured, none saves a tenth or more if the target is relaxed"]
    if not choice.ranked:
        lines = ["nothing whose cost is known meets the target"]
    if cheaper is not None:
        saved = math.floor(100 * (1 - cheaper.cost / choice.cost))
        target = _error(advice, cheaper, as_target=True)
        lines = [f"of those measured, relaxing the target to {target} saves {saved}%: {_name(cheaper)}"]
    if better is not None:
        target, times = _error(advice, better, as_target=True), _relative_text(advice, better)
        costs = f"costs {times} × as much" if times else f"costs {_cost_text(advice, better)} {_unit(advice)}"
        lines.append(f"of those measured, tightening it to {target} {costs}: {_name(better)}")
    elif choice.error > 0:
        lines.append("tightening it: nothing measured has less than half the error")
    return lines


def obstacles(advice: Recommendation) -> list[str]:
    """Why nothing that was measured meets the target."""
    target, near = advice.asked, advice.closest
    of = f" of {', '.join(advice.among)}" if advice.among else ""
    if near is None:
        why = f"; {'; '.join(advice.unsuccessful.values())}" if advice.unsuccessful else ""
        return [f"nothing{of} was measured that meets {target}: no spec could be{why}"]
    line = f"nothing measured{of} meets {target}; the closest is {_name(near)}: {_error(advice, near)}"
    if advice.met:  # over the budget
        met = advice.met[0]
        time = f"in {met.cost:.3g} ms" if met.ranked else "in a time that is not known"
        return [line, f"obstacle: the budget; {_name(met)} reaches {_error(advice, met)} {time}"]
    metrics = near.result.score["metrics"]
    faults = [f"flicker, {metrics['flicker']:.3g} px"] if near.flicker > 1 else []
    if near.error > advice.limit:
        soft = advice.target.metric == "rmse" and is_soft(metrics)
        faults += _soft_faults(near) if soft else _hard_faults(advice, near)
    return [line, *(f"obstacle: {one}" for one in faults)]


def _soft_faults(near: Trial) -> list[str]:
    """What is wrong with the penumbrae of the closest trial."""
    row = near.result.score
    faults = [f"{name}, {line}" for name, line in soft_faults(row["metrics"], row.get("width_bias")).items()]
    worst = faults[:1] or [f"an RMSE of {row['metrics']['rmse_pen']:.2g} in the penumbra (rmse_pen)"]
    if near.spec.map_size == SIZES[-1]:
        worst.append(f"map size; the closest has {SIZES[-1]} texels a side, the most that are tried")
    return worst


def _hard_faults(advice: Recommendation, near: Trial) -> list[str]:
    """What is wrong with the closest trial, where IoU or edges judge it."""
    metrics, name = near.result.score["metrics"], near.spec.technique.name
    largest = max(trial.spec.map_size or 0 for trial in advice.trials if trial.spec.technique.name == name)
    size = start_size(near.spec, advice.needs)
    kinds = {kind: metrics[kind] for kind in _KINDS if metrics[kind] and METRICS[kind].suits(is_soft(metrics))}
    lines = []
    if kinds:
        worst = max(kinds, key=lambda kind: kinds[kind])
        lines.append(f"{worst}, {100 * kinds[worst]:.3g}% {_KINDS[worst]}")
    if 0 < largest < size:
        slices = near.spec.technique.view_slices(near.spec.params)
        each = f" of each of {slices} cascades" if slices > 1 else ""
        lines.append(
            f"map size; `needs` asks for about {size:.0f} texels a side{each}, the largest tried has {largest}"
        )
    elif not kinds and metrics["edge_px"] is not None:
        lines.append(f"edges, {metrics['edge_px']:.3g} px off on average")
    return lines


def excluded_lines(advice: Recommendation) -> list[str]:
    """What was not tried or failed: techniques, what `needs` rules out, what predictions leave out, and failures."""
    names = [one.what for one in advice.excluded if not one.specs]
    lines = [f"not tried: {', '.join(names)}; --json says why"] if names else []
    lines += [f"not tried: {one.what} ({one.specs} specs): {one.why}" for one in advice.excluded if one.specs]
    limit = "the choice" if advice.choice or not advice.met else _name(advice.met[0])
    counts = []
    for key, why in LEFT_OUT.items():
        of_each = {name: count for (name, own), count in advice.untried.items() if own == key}
        if of_each:
            named = ", ".join(f"{name} {count}" for name, count in of_each.items())
            counts.append(f"{sum(of_each.values())} {why.format(limit)} ({named})")
    if counts:
        lines.append(f"not tried: {', '.join(counts)}; -t TECHNIQUE searches one alone")
    return [*lines, *(f"not measured: {spec}: {status}" for spec, status in advice.unsuccessful.items())]


def _error(advice: Recommendation, trial: Trial, as_target: bool = False) -> str:
    """Text of a trial's error by the target's metric, such as `edges 0.21 px off`.

    as_target: rounded to a target that the error meets.
    """
    if math.isinf(trial.error):
        return "no edges to compare, and other shadows"
    target, metric = advice.target, METRICS[advice.target.metric]
    digits = reached if as_target else rounded
    # The function from a value to its error is its own inverse.
    text = metric.text(metric.error(trial.error), lambda value: digits(target, value), trial.result.score)
    return f"edges {text} px off" if metric.name == "edge_px" else f"{metric.label} {text}"


def rounded(target: Target, value: float) -> str:
    """A value of a target's metric, rounded, but neither across the target nor to an IoU of 1 unless it is that."""
    form = "{:.4g}" if target.metric == "iou" else "{:.3g}"
    return METRICS[target.metric].digits_beside(target.limit, form.format)(value)


def reached(target: Target, value: float) -> str:
    """A value of a target's metric as another target, which it meets: an IoU rounded down, others up."""
    least, rounding = (4, ROUND_FLOOR) if target.metric == "iou" else (3, ROUND_CEILING)
    for digits in range(least, 17):
        other = float(Context(digits, rounding).create_decimal(value))
        if other != target.limit and (other > target.limit) == (value > target.limit):
            return f"{other:.{digits}g}"
    return f"{value:.16g}"


def _name(trial: Trial) -> str:
    size = f" at {trial.spec.map_size}" if trial.spec.map_size else ""
    return trial.spec.sizeless_text + size


def values(advice: Recommendation, info: DeviceInfo) -> dict[str, Any]:
    """JSON object of `recommend --json`."""
    view, law = advice.view, advice.cost.law
    return {
        "scene": view.scene.name,
        "view": view.camera.name,
        "light": view.light.name,
        **view.size.columns,
        "target": {"metric": advice.target.metric, "value": advice.target.limit, "budget_ms": advice.budget_ms}
        | (advice.steadiness._asdict() if advice.steadiness else {}),
        "notes": notes(advice),
        "ranked_by": advice.cost.name,
        "device": law and law.device,
        "reference": None if advice.reference is None else asdict(advice.reference),
        "renderer": info.renderer,
        "choice": _values(advice.choice),
        "closest": _values(advice.closest),
        "in_the_way": obstacles(advice) if advice.closest else [],
        "runners_up": [{"standing": advice.standing(one)} | (_values(one) or {}) for one in advice.runners_up],
        "relaxed": _values(advice.cheaper),
        "tightened": _values(advice.better),
        "measured": advice.measured,
        "space": advice.space_size,
        "evidence": [_values(trial) for trial in advice.trials],
        "techniques": list(advice.among) or None,
        "refused": dict(advice.unsuccessful),
        "untried": [{"technique": name, "why": why, "specs": count} for (name, why), count in advice.untried.items()],
        "excluded": [asdict(exclusion) for exclusion in advice.excluded],
    }


def _values(trial: Trial | None) -> dict[str, Any] | None:
    if trial is None:
        return None
    row = trial.result.score
    values = {"spec": trial.spec.text, "cost": trial.cost if trial.ranked else None}
    return values | {name: row[name] for name in ("gpu_bytes", "key", "metrics")}


def export_choice(advice: Recommendation, folder: Path, drawer: "GLDrawer") -> None:
    """Write `parameters.json` and one file per shader stage of the choice into a folder; nothing without a choice."""
    if advice.choice is None:
        return
    spec, scene = advice.choice.spec, advice.view.scene
    shaders = drawer.shaders(Block((advice.view,), ()), Cell(spec))
    parameters = {
        "spec": spec.text,
        "technique": spec.technique.name,
        "parameters": {name: _parameter(value) for name, value in spec.params},
        "scene": scene.name,
        "target": advice.asked,
        "metre": scene.placement.length(1.0),  # length of 1 m in the shaders' units
        "uniforms": {one.name: {name: _parameter(value) for name, value in one.uniforms.items()} for one in shaders},
    }
    files = {shader.name: shader.text for shader in shaders}
    files["parameters.json"] = json.dumps(parameters, indent=2) + "\n"
    for name, text in files.items():
        with replace_file(folder / name) as temporary:
            temporary.write_text(text, encoding="utf-8")


def _parameter(value: Any) -> Any:
    """JSON value of a parameter; a component is an object with its name and parameters."""
    if isinstance(value, Component):
        return {"name": value.name, **value.model_dump(mode="json")}
    return value.tolist() if hasattr(value, "tolist") else value
