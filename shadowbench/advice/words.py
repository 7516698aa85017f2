"""A recommendation in words: costs of other targets, obstacles, and exclusions. It says no more than was measured."""

import math
from collections.abc import Iterator

from shadowbench.advice.recommendation import Recommendation
from shadowbench.advice.search import Trial
from shadowbench.advice.space import SIZES
from shadowbench.advice.target import Target
from shadowbench.measure.rows import Record
from shadowbench.scores.metrics import METRICS, is_soft
from shadowbench.scores.soft_faults import soft_faults

_KINDS = {
    "contact": "of the shadow next to its caster is lit",
    "leak": "of the umbra away from edges is lit",
    "acne": "of the lit surface away from edges is dark",
}


def target_notes(found: Recommendation) -> list[str]:
    """What a target means for soft shadows, where IoU and edges say little and the truth has an error of its own."""
    target = found.target
    rows = [trial.result.score for trial in found.trials if trial.result is not None]
    if target.metric != "rmse":
        what = "IoU judges" if target.metric == "iou" else "edges are"
        soft = any(is_soft(row["metrics"]) for row in rows)
        return [f"{what} where visibility is ½, and not how soft a shadow is; --max-rmse judges that"] if soft else []
    least = max((row.get("truth_error", 0.0) for row in rows), default=0.0)
    if target.value >= least:
        return []
    return [f"the truth's own error is an RMSE of {least:.2g}: a smaller one cannot be told from 0"]


def phase_notes(found: Recommendation) -> list[str]:
    """That scores of maps are of one position of their texels, of which tables of `run` may show several."""
    if not any(trial.spec.technique.phased for trial in found.trials):
        return []
    return ["maps are scored in one phase (sub-texel offset): `shadowbench run --phases 8` shows how others differ"]


def step_lines(found: Recommendation) -> list[str]:
    """What relaxing the target would save and tightening it would cost, among the trials."""
    choice, target = found.choice, found.target
    assert choice is not None
    lines = []
    if found.cheaper is not None:
        saved = math.floor(100 * (1 - found.cheaper.cost / choice.cost))
        cheaper = f"relaxing the target to {_text(target, found.cheaper, as_target=True)} saves {saved}%"
        lines.append(f"of those measured, {cheaper}: {_name(found.cheaper)}")
    else:
        lines.append("of those measured, none saves a tenth or more if the target is relaxed")
    if found.better is not None:
        times = found.better.cost / choice.cost
        better = f"tightening it to {_text(target, found.better, as_target=True)} costs {times:.3g} × as much"
        lines.append(f"of those measured, {better}: {_name(found.better)}")
    elif choice.error > 0:
        lines.append("tightening it: nothing measured has less than half the error")
    return lines


def obstacles(found: Recommendation) -> list[str]:
    """Why nothing that was measured meets the target."""
    return list(_obstacles(found))


def _obstacles(found: Recommendation) -> Iterator[str]:
    target, near = found.target, found.closest
    of = f" of {', '.join(found.among)}" if found.among else ""
    if near is None or near.result is None:
        why = f"; {'; '.join(found.unsuccessful.values())}" if found.unsuccessful else ""
        yield f"nothing{of} was measured that meets {target}: no spec could be{why}"
        return
    met = [trial for trial in found.trials if trial.error <= target.limit]
    yield f"nothing measured{of} meets {target}; the closest is {_name(near)}: {_text(target, near)}"
    if met and target.budget_ms is not None:
        yield f"obstacle: the budget; {_name(met[0])} reaches {_text(target, met[0])} in {met[0].cost:.3g} ms"
        return
    yield from _faults(found, near, near.result.score)


def _faults(found: Recommendation, near: Trial, row: Record) -> Iterator[str]:
    """What is wrong with the closest trial, of which this is the score row."""
    target, needs = found.target, found.needs
    metrics, largest = row["metrics"], max(trial.spec.map_size or 0 for trial in found.trials)
    if target.metric == "rmse" and is_soft(metrics):
        faults = [f"{fault.name}, {fault.line}" for fault in soft_faults(metrics, row.get("width_bias"))]
        error = f"an RMSE of {metrics['rmse_pen']:.2g} in the penumbra (rmse_pen)"
        yield f"obstacle: {faults[0] if faults else error}"
        if near.spec.map_size == largest == SIZES[-1]:
            yield f"obstacle: map size; the closest has {largest} texels a side, the most that are tried"
        return
    kinds = {kind: metrics[kind] for kind in _KINDS if metrics[kind] and METRICS[kind].suits(is_soft(metrics))}
    size = (needs.texels.edge_size or needs.texels.size).value
    if kinds:
        worst = max(kinds, key=lambda kind: kinds[kind])
        yield f"obstacle: {worst}, {100 * kinds[worst]:.3g}% {_KINDS[worst]}"
    if 0 < largest < size:
        yield f"obstacle: map size; `needs` asks for about {size:.0f} texels a side, the largest tried has {largest}"
    elif not kinds and metrics["edge_px"] is not None:
        yield f"obstacle: edges, {metrics['edge_px']:.3g} px off on average"


def excluded_lines(found: Recommendation) -> list[str]:
    """What was not tried or failed, and why."""
    lines = []
    for exclusion in found.excluded:
        count = f" ({exclusion.specs} specs)" if exclusion.specs > 1 else ""
        lines.append(f"not tried: {exclusion.what}{count}: {exclusion.why}")
    lines += [_untried_line(found, name) for name in found.untried]
    return [*lines, *(f"not measured: {spec}: {status}" for spec, status in found.unsuccessful.items())]


def _untried_line(found: Recommendation, name: str) -> str:
    """What is predicted of the specs of a technique that were not measured, and how to have it searched."""
    rest = found.untried[name]
    met = [trial for trial in found.trials if trial.error <= found.target.limit]
    limit = "the choice" if found.choice or not met else _name(met[0])
    whys = {
        f"predicted to cost at least as much as {limit}": rest.dearer,
        "predicted to miss the target": rest.inaccurate,
        "with the map of one that failed, or a larger one": rest.beyond,
    }
    reasons = [f"{count} {why}" for why, count in whys.items() if count]
    further = " further" if name in {trial.spec.technique.name for trial in found.trials} else ""
    has_met = name in {trial.spec.technique.name for trial in met}
    alone = f"; -t {name} searches it alone" if rest.dearer and not has_met else ""
    return f"not tried{further}: {name}: {', '.join(reasons)}{alone}"


def _text(target: Target, trial: Trial, as_target: bool = False) -> str:
    return target.text(trial.error, {} if trial.result is None else trial.result.score, as_target)


def _name(trial: Trial) -> str:
    size = f" at {trial.spec.map_size}" if trial.spec.map_size else ""
    return trial.spec.sizeless_text + size
