"""The verdict: sentences that name the cheapest configuration for an accuracy, and the texts of the cost matrix."""

from collections.abc import Mapping, Sequence

from shadowbench.errors import counted
from shadowbench.plugin.registry import own_techniques
from shadowbench.reports.words import cost_source, digits, median_text, sentence
from shadowbench.results.configurations import Section
from shadowbench.results.ranking import Candidate, CostCell, Target, candidates, cheapest, closest, targets_of, ties
from shadowbench.scores.metrics import METRICS

_NONE = "No real-time technique here"
_EDGES = {1.0: "1 px", 0.5: "½ px", 0.25: "¼ px"}


def verdict(sections: Sequence[Section]) -> list[str]:
    """The sentences of the verdict on one scene, or on all scenes of a kind; configurations are in backticks.

    What `recommend` never chooses is left out; ray tracing, on the CPU as the truth is, is named for scale.
    """
    everything = candidates(sections)
    found = _able(everything)
    if not found and not everything:
        some = any(section.scored for section in sections)
        return [f"Nothing here has a score{' in each of its cells' if some else ''}."]
    if not found:
        what = "draws a shadow where one should be" if real_time(everything) else "has a score"
        return [f"{_NONE} {what}.", *_ray_traced(everything)]
    where = "" if len(sections) == 1 else f" in all {len(sections)} scenes"
    target, best = _answer(found)
    device = sections[0].device
    lines = _closest(found, target, where) if best is None else _cheapest(found, target, best, where, device)
    return [*lines, *_where_supported(found, target, best), *_ray_traced(everything)]


def _closest(found: Sequence[Candidate], target: Target, where: str) -> list[str]:
    near = closest(found, target)
    label, median = METRICS[target.metric].label, median_text(near.mean, target.metric, target.limit)
    how = f"in {near.scenes_met(target)} of them" if where else f"{label} {median}"
    return [f"{_NONE} {_reaches(target, ' of the shadow right')}{where}.", f"Closest: `{near.mean.label}`, {how}."]


def _cheapest(found: Sequence[Candidate], target: Target, best: Candidate, where: str, device: str) -> list[str]:
    complete = [one for one in found if one.in_all_scenes]
    tied = [one for one in ties(complete, best, target) if one.mean.technique != best.mean.technique][:2]
    noise = " within the noise" if best.mean.cost_name == "frame_ms" else ""
    also = f"; as cheap{noise}: {', '.join(f'`{one.mean.label}`' for one in tied)}" if tied else ""
    line = f"{_accuracy(target, ' of the shadow right')}{where}: {_cost_phrase(best, device)}{also}."
    return [line, *_next_target(complete, target, best, where)]


def verdict_candidate(found: Sequence[Candidate]) -> Candidate | None:
    """The candidate that the verdict names first, else the most accurate; None without candidates."""
    able = _able(found)
    if not able:
        return next(iter(found), None)
    target, best = _answer(able)
    return best or closest(able, target)


def real_time(found: Sequence[Candidate]) -> list[Candidate]:
    """The candidates that are real-time techniques: those that `recommend` may choose."""
    never = {technique.name for technique in own_techniques() if technique.catalogue.never_recommended}
    return [one for one in found if one.mean.technique not in never]


def _able(found: Sequence[Candidate]) -> list[Candidate]:
    """The candidates that are real-time techniques and draw a shadow where one should be."""
    return [one for one in real_time(found) if (one.mean.value("iou_soft" if one.mean.soft else "iou") or 0.0) > 0]


def _answer(found: Sequence[Candidate]) -> tuple[Target, Candidate | None]:
    """The target of the first sentence, and the cheapest that meets it in all scenes.

    The middle target, or if none meets that, the easiest.
    """
    complete = [one for one in found if one.in_all_scenes]
    easiest, middle = targets_of(found[0].mean.ranked_by)[:2]
    best = cheapest(complete, middle)
    return (easiest, cheapest(complete, easiest)) if best is None else (middle, best)


def _next_target(complete: Sequence[Candidate], main: Target, best: Candidate, where: str) -> list[str]:
    """A sentence on the cost of the next higher accuracy; none at the highest."""
    targets = targets_of(best.mean.ranked_by)
    for target in targets[targets.index(main) + 1 :][:1]:
        found = cheapest(complete, target)
        if found is None:
            return [f"{_NONE} {_reaches(target, ' right')}{where}."]
        if found is best:
            return [f"`{best.mean.label}` {_reaches(target, ' right')} too."]
        factor = f" (× {digits(found.cost / best.cost)})" if found.cost and best.cost else ""
        return [f"{_accuracy(target)} takes `{found.mean.label}`, {cost_text(found)}{factor}."]
    return []


def _where_supported(found: Sequence[Candidate], target: Target, best: Candidate | None) -> list[str]:
    """A sentence on the cheapest candidate that does not support all scenes, if it is cheaper than the best."""
    partial = cheapest([one for one in found if not one.in_all_scenes], target)
    if partial is None or (
        best is not None and (best.cost is None or partial.cost is None or partial.cost >= best.cost)
    ):
        return []
    met, of = len(partial.by_scene), counted(len(partial.by_scene) + len(partial.unsupported), "scene")
    cost = "" if partial.cost is None else f" for {cost_text(partial)}"
    return [f"`{partial.mean.label}` suffices{cost} in the {met} of {of} that it supports."]


def _ray_traced(found: Sequence[Candidate]) -> list[str]:
    """A sentence on the cost of ray tracing on the CPU, if it was measured and timed in all scenes."""
    traced = [one for one in found if one.mean.technique == "ray-traced" and one.in_all_scenes and one.cost]
    costs = [cost_text(one) for one in traced if "where=gpu" not in one.mean.full_spec]
    return [f"For scale: ray tracing on the CPU takes {cost}." for cost in costs[:1]]


def _accuracy(target: Target, of_what: str = "") -> str:
    return f"{100 * target.limit:g}%{of_what}" if target.metric == "iou" else target_name(target)


def _reaches(target: Target, of_what: str) -> str:
    return f"{'gets' if target.metric == 'iou' else 'reaches'} {_accuracy(target, of_what)}"


def _cost_phrase(one: Candidate, device: str) -> str:
    """What the cheapest candidate costs, and by what it is the cheapest; device: whose times are predicted."""
    if one.cost is not None:
        by = {"predicted_ms": f" by times predicted for {device}", "work_cost": " by work"}.get(one.mean.cost_name, "")
        return f"`{one.mean.label}` is the cheapest real-time setting{by}, {cost_text(one)} a frame"
    if one.mean.cost_name != "map_size":
        return f"`{one.mean.label}` suffices, at a cost that is not known; nothing does at a known one"
    what = "the smallest map that suffices" if one.mean.map_size else "sufficient, without a map"
    return f"`{one.mean.label}` is {what}"


def target_name(target: Target) -> str:
    """A target as a column heading: `IoU ≥ 0.99`, `edge ≤ ½ px`, `RMSE ≤ 0.02`."""
    metric = METRICS[target.metric]
    limit = _EDGES[target.limit] if target.metric == "edge_px" else f"{target.limit:g}"
    return f"{metric.label} {'≥' if metric.better == 'higher' else '≤'} {limit}"


def cost_note(sections: Sequence[Section]) -> str:
    """A note on what the costs are, and how far their times can be trusted."""
    found, first = candidates(sections), sections[0]
    costs = [one.cost is not None for one in found]
    if first.cost_name == "map_size":
        return "Nothing here was timed: the cost is the size of the smallest map that suffices."
    if not any(costs):
        return "Nothing here has a cost that is known."
    timed = first.cost_name == "frame_ms"
    what = "work" if first.cost_name == "work_cost" else "frame time of shadows"
    mean = f"mean {what} over these scenes" if len(sections) > 1 else what
    rough = " ~ marks a rough time." if any(one.rough for section in sections for one in section.timed) else ""
    why = "lacks times" if timed else "has none that is known"
    unranked = "" if all(costs) else f" What is not ranked {why}."
    return f"Cost: {mean}. {sentence(cost_source(first))}{rough}{unranked}"


def device_note(section: Section) -> str:
    """That no device's times are predicted for lights with a size; nothing for other lights, and on a GPU."""
    if not (section.run.software and section.soft):
        return ""
    return "No device's times are predicted for lights with a size; a run on a GPU measures its own."


def cost_text(one: Candidate) -> str:
    """A candidate's cost: a time, work, or where nothing has either the map size."""
    if one.mean.cost_name != "map_size":
        return one.mean.cost_text(digits)
    return f"map {one.mean.map_size}" if one.mean.map_size else "no map"


def cell_texts(cell: CostCell, scenes: int) -> tuple[str, str, str]:
    """Texts of a cell of the cost matrix: cost, configuration, and a note.

    If no candidate meets the target: a dash, nothing, and the best accuracy.
    """
    best = cell.cheapest
    if best is not None:
        met = len(best.by_scene)
        return cost_text(best), best.mean.label, "" if met == scenes else f"supports {met} of {scenes} scenes"
    if scenes > 1:
        return "–", "", f"at best in {cell.closest.scenes_met(cell.target)} of {scenes} scenes"
    name, mean = cell.target.metric, cell.closest.mean
    if mean.value(name) is None:
        return "–", "", f"no {METRICS[name].label}"
    return "–", "", f"best {median_text(mean, name, cell.target.limit)}"


def accuracy_text(cell: CostCell, scenes: Mapping[str, str]) -> str:
    """What the cheapest candidate of a cell reaches; if scenes differ, in the worst: `IoU 0.9534 in street`.

    scenes: names by title. Empty if no candidate meets the target.
    """
    if cell.cheapest is None:
        return ""
    name = cell.target.metric
    texts = {
        title: f"{METRICS[name].label} {median_text(one, name, cell.target.limit)}"
        for title, one in cell.cheapest.by_scene.items()
    }
    worst = cell.cheapest.worst_by(name)
    return texts[worst] + (f" in {scenes[worst]}" if len(set(texts.values())) > 1 else "")
