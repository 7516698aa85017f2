"""The verdict: sentences that name the cheapest configuration for an accuracy, and the texts of the cost matrix."""

from collections.abc import Mapping, Sequence

from shadowbench.errors import counted
from shadowbench.plugin.registry import own_techniques
from shadowbench.reports.words import EDGE_NAMES, digits, median_text, sentence, time_source, value_of
from shadowbench.results.configurations import Section
from shadowbench.results.ranking import Candidate, CostCell, Target, candidates, cheapest, closest, targets_of, ties
from shadowbench.scores.metrics import METRICS

_RAY_TRACED = "ray-traced"
_NONE = "No real-time technique here"


def verdict(sections: Sequence[Section]) -> list[str]:
    """The sentences of the verdict on one scene, or on all scenes of a kind; configurations are in backticks.

    What `recommend` never chooses is left out; ray tracing, on the CPU as the truth is, is named for scale.
    """
    everything = candidates(sections)
    found = _able(everything)
    where = "" if len(sections) == 1 else f" in all {len(sections)} scenes"
    complete = [one for one in found if one.in_all_scenes]
    if not found:
        if everything:
            what = "draws a shadow where one should be" if real_time(everything) else "has a score"
            return [f"{_NONE} {what}.", *_ray_traced(everything)]
        some = any(section.scored for section in sections)
        return [f"Nothing here has a score{' in each of its cells' if some else ''}."]
    main, easiest = _main_target(complete), _targets(found)[0]
    if main is None:
        lines = [f"{_NONE} {_reaches(easiest)}{where}."]
        lines.append(f"Closest: {_closest_text(closest(found, easiest), easiest, len(sections))}.")
        return [*lines, *_where_supported(found, easiest, None), *_ray_traced(everything)]
    best = cheapest(complete, main)
    assert best is not None
    line = f"{_accuracy(main)}{where}: {_cost_phrase(best)}"
    tied = [one for one in ties(complete, best, main) if one.mean.technique != best.mean.technique]
    if tied:
        line += f"; as cheap within the noise: {', '.join(f'`{one.mean.label}`' for one in tied[:2])}"
    return [
        f"{line}.",
        *_next_target(complete, main, best, where),
        *_where_supported(found, main, best),
        *_ray_traced(everything),
    ]


def real_time(found: Sequence[Candidate]) -> list[Candidate]:
    """The candidates that are real-time techniques: those that `recommend` may choose."""
    never = {technique.name for technique in own_techniques() if technique.catalogue.never_recommended}
    return [one for one in found if one.mean.technique not in never]


def verdict_candidate(found: Sequence[Candidate]) -> Candidate | None:
    """The candidate that the verdict names first, else the most accurate; None without candidates."""
    able = _able(found)
    complete = [one for one in able if one.in_all_scenes]
    main = _main_target(complete)
    if main is None:
        return closest(able, _targets(able)[0]) if able else next(iter(found), None)
    return cheapest(complete, main)


def _able(found: Sequence[Candidate]) -> list[Candidate]:
    """The candidates that are real-time techniques and draw a shadow where one should be."""
    return [one for one in real_time(found) if (one.mean.value("iou_soft" if one.mean.soft else "iou") or 0.0) > 0]


def cost_note(sections: Sequence[Section]) -> str:
    """A note on what the costs are, and how far their times can be trusted."""
    run = sections[0].run
    timed = [one.ms is not None for one in candidates(sections)]
    if not any(timed):
        return "Nothing here was timed: the cost is the size of the smallest map that suffices."
    mean = "mean frame time of shadows over these scenes" if len(sections) > 1 else "frame time of shadows"
    rough = " ~ marks a rough time." if any(one.rough for section in sections for one in section.timed) else ""
    untimed = "" if all(timed) else ' Where a cost is a map size or "no map", that setting lacks times.'
    return f"Cost: {mean}. {sentence(time_source(run))}{rough}{untimed}"


def _main_target(complete: Sequence[Candidate]) -> Target | None:
    """The target of the verdict's first sentence: the middle one, or if none meets that, the easiest; else None."""
    return next((target for target in _targets(complete)[1::-1] if cheapest(complete, target) is not None), None)


def _targets(found: Sequence[Candidate]) -> tuple[Target, ...]:
    return targets_of(found[0].mean.ranked_by) if found else ()


def _accuracy(target: Target) -> str:
    return f"{100 * target.limit:g}% of the shadow right" if target.metric == "iou" else target_name(target)


def _reaches(target: Target) -> str:
    return f"{'gets' if target.metric == 'iou' else 'reaches'} {_accuracy(target)}"


def target_name(target: Target) -> str:
    """A target as a column heading: `IoU ≥ 0.99`, `edge ≤ ½ px`, `RMSE ≤ 0.02`."""
    metric = METRICS[target.metric]
    limit = EDGE_NAMES[target.limit] if target.metric == "edge_px" else f"{target.limit:g}"
    return f"{metric.label} {'≥' if metric.better == 'higher' else '≤'} {limit}"


def cost_text(one: Candidate) -> str:
    """A candidate's cost: the frame time or, if it was not timed, the map size."""
    if one.ms is not None:
        return f"{value_of(one.mean, 'frame_ms')} ms"
    return f"map {one.mean.map_size}" if one.mean.map_size else "no map"


def cell_texts(cell: CostCell, scenes: int) -> tuple[str, str, str]:
    """Texts of a cell of the cost matrix: cost, configuration, and a note.

    If no candidate meets the target: a dash, nothing, and the best accuracy.
    """
    best = cell.cheapest
    if best is None and scenes > 1:
        return "–", "", f"at best in {cell.closest.scenes_met(cell.target)} of {scenes} scenes"
    if best is None:
        name, mean = cell.target.metric, cell.closest.mean
        if mean.value(name) is None:
            return "–", "", f"no {METRICS[name].label}"
        return "–", "", f"best {median_text(mean, name, cell.target.limit)}"
    note = "" if len(best.by_scene) == scenes else f"supports {len(best.by_scene)} of {scenes} scenes"
    return cost_text(best), best.mean.label, note


def accuracy_text(cell: CostCell, scenes: Mapping[str, str]) -> str:
    """What the cheapest candidate of a cell reaches; if scenes differ, in the worst: `IoU 0.9534 in street`.

    scenes: names by title. Empty if no candidate meets the target.
    """
    if cell.cheapest is None:
        return ""
    name, by_scene = cell.target.metric, cell.cheapest.by_scene
    texts = {
        title: f"{METRICS[name].label} {median_text(one, name, cell.target.limit)}" for title, one in by_scene.items()
    }
    worst = cell.cheapest.worst_by(name)
    return texts[worst] + (f" in {scenes[worst]}" if len(set(texts.values())) > 1 else "")


def _cost_phrase(one: Candidate) -> str:
    if one.ms is None:
        size = one.mean.map_size
        return f"`{one.mean.label}` is {'the smallest map that suffices' if size else 'sufficient, without a map'}"
    return f"`{one.mean.label}` is the cheapest real-time setting, {value_of(one.mean, 'frame_ms')} ms a frame"


def _ray_traced(found: Sequence[Candidate]) -> list[str]:
    """A sentence on the cost of ray tracing, if it was measured and timed in all scenes."""
    traced = [one for one in found if one.mean.technique == _RAY_TRACED and one.in_all_scenes and one.ms]
    on_cpu = next((one for one in traced if "where=gpu" not in one.mean.full_spec), None)
    return [] if on_cpu is None else [f"For scale: ray tracing on the CPU takes {cost_text(on_cpu)}."]


def _next_target(complete: Sequence[Candidate], main: Target, best: Candidate, where: str) -> list[str]:
    """A sentence on the cost of the next higher accuracy; none at the highest."""
    targets = _targets(complete)
    target = next(iter(targets[targets.index(main) + 1 :]), None)
    if target is None:
        return []
    share = f"{100 * target.limit:g}%" if target.metric == "iou" else ""
    reaches = f"gets {share} right" if share else _reaches(target)
    found = cheapest(complete, target)
    if found is None:
        return [f"{_NONE} {reaches}{where}."]
    if found is best:
        return [f"`{best.mean.label}` {reaches} too."]
    factor = f" (× {digits(found.ms / best.ms)})" if found.ms and best.ms else ""
    return [f"{share or _accuracy(target)} takes `{found.mean.label}`, {cost_text(found)}{factor}."]


def _where_supported(found: Sequence[Candidate], target: Target, best: Candidate | None) -> list[str]:
    """A sentence on the cheapest candidate that does not support all scenes, if it is cheaper than the best."""
    some = [one for one in found if not one.in_all_scenes]
    partial = cheapest(some, target)
    if partial is None or (best is not None and (best.ms is None or partial.ms is None or partial.ms >= best.ms)):
        return []
    met, of = len(partial.by_scene), counted(len(partial.by_scene) + len(partial.unsupported), "scene")
    cost = "" if partial.ms is None else f" for {cost_text(partial)}"
    return [f"`{partial.mean.label}` suffices{cost} in the {met} of {of} that it supports."]


def _closest_text(one: Candidate, target: Target, scenes: int) -> str:
    if scenes > 1:
        return f"`{one.mean.label}`, in {one.scenes_met(target)} of them"
    name = target.metric
    return f"`{one.mean.label}`, {METRICS[name].label} {median_text(one.mean, name, target.limit)}"
