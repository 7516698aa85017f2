"""The answer in a sentence or two: what reaches which accuracy at which cost, from rows, and how far to trust it."""

from collections.abc import Sequence

from shadowbench.reports.analysis import Section
from shadowbench.reports.matrix import IOU_TARGETS, Candidate, Cell, Target, candidates, cheapest, equals, nearest
from shadowbench.reports.words import EDGE_NAMES, RAY_TRACED, counted, digits, sentence, times_are, value_of

_MAIN = Target(0.99)


def verdict(sections: Sequence[Section]) -> list[str]:
    """Sentences, `…` being specs: of one scene, or of every scene of a run."""
    found = [one for one in candidates(sections) if (one.whole.value("iou") or 0.0) > 0]
    where = "" if len(sections) == 1 else f" in all {len(sections)} scenes"
    whole = [one for one in found if one.everywhere]
    if not found:
        return ["Nothing here has a score."]
    main = _main_target(whole)
    if main is None:
        lines = [f"Nothing measured gets {right(IOU_TARGETS[0])}{where}."]
        lines.append(f"Closest: {_closest(nearest(found, IOU_TARGETS[0]), len(sections))}.")
        return [*lines, *_where_supported(found, IOU_TARGETS[0], None)]
    best = cheapest(whole, main)
    assert best is not None
    line = f"{right(main)}{where}: {_price(best)}"
    ties = [one for one in equals(whole, best, main) if one.whole.technique != best.whole.technique]
    if ties:
        line += f"; as cheap within the noise: {', '.join(f'`{one.whole.label}`' for one in ties[:2])}"
    if best.whole.technique == RAY_TRACED:
        line += _without_rays(whole, main)
    return [f"{line}.", *_harder(whole, main, best), *_where_supported(found, main, best)]


def best_of(found: Sequence[Candidate]) -> Candidate | None:
    """What the verdict names first; the most accurate where no target is reached, None where nothing has a score."""
    whole = [one for one in found if one.everywhere]
    main = _main_target(whole)
    return next(iter(found), None) if main is None else cheapest(whole, main)


def cost_note(sections: Sequence[Section]) -> str:
    """What a cost is: of times how far to trust them."""
    run = sections[0].run
    if not any(section.timed for section in sections):
        return "Nothing here was timed: in place of a cost the smallest map that does."
    mean = "mean frame time of shadows over these scenes" if len(sections) > 1 else "frame time of shadows"
    return f"Cost: {mean}. {sentence(times_are(run))} ~ marks a rough time."


def _main_target(whole: Sequence[Candidate]) -> Target | None:
    """The target that a verdict begins with: IoU 0.99, or where nothing reaches it 0.95."""
    return next((target for target in (_MAIN, IOU_TARGETS[0]) if cheapest(whole, target) is not None), None)


def right(target: Target) -> str:
    """An IoU as people say it."""
    return f"{100 * target.limit:g}% of the shadow right"


def target_name(target: Target) -> str:
    """An accuracy as the head of a column."""
    return f"edge ≤ {EDGE_NAMES[target.limit]}" if target.edges else f"IoU ≥ {target.limit:g}"


def cost_text(one: Candidate) -> str:
    """What it costs: milliseconds a frame, or, of what was not timed, the map that it takes."""
    if one.ms is not None:
        return f"{value_of(one.whole, 'frame_ms')} ms"
    return f"map {one.whole.map_size}" if one.whole.map_size else "no map"


def cell_texts(cell: Cell, scenes: int) -> tuple[str, str, str]:
    """Cost, the configuration that it is of, and a note; of what is out of reach a dash, and the best there is."""
    best = cell.cheapest
    if best is None and scenes > 1:
        return "–", "", f"at best in {cell.nearest.met(cell.target)} of {scenes} scenes"
    if best is None:
        iou, edge = cell.nearest.whole.value("iou"), cell.nearest.whole.value("edge_px")
        if cell.target.edges:
            return "–", "", "no edge" if edge is None else f"best {digits(edge)} px"
        return "–", "", "no IoU" if iou is None else f"best {iou:.4g}"
    note = "" if len(best.held) == scenes else f"in the {len(best.held)} of {scenes} scenes that it supports"
    return cost_text(best), best.whole.label, note


def _price(one: Candidate) -> str:
    if one.ms is None:
        size = one.whole.map_size
        return f"`{one.whole.label}` is {'the smallest map that does' if size else 'enough, without a map'}"
    return f"`{one.whole.label}` is the cheapest, {value_of(one.whole, 'frame_ms')} ms a frame"


def _without_rays(whole: Sequence[Candidate], target: Target) -> str:
    other = cheapest([one for one in whole if one.whole.technique != RAY_TRACED], target)
    return (
        "; nothing else does" if other is None else f"; without ray tracing `{other.whole.label}`, {cost_text(other)}"
    )


def _harder(whole: Sequence[Candidate], main: Target, best: Candidate) -> list[str]:
    """What the next target costs over the main one."""
    target = next((one for one in IOU_TARGETS if one.limit > main.limit), None)
    if target is None:
        return []
    found = cheapest(whole, target)
    if found is None:
        return [f"Nothing gets {100 * target.limit:g}% right."]
    if found is best:
        return [f"`{best.whole.label}` gets {100 * target.limit:g}% right too."]
    factor = f" (× {digits(found.ms / best.ms)})" if found.ms and best.ms else ""
    return [f"{100 * target.limit:g}% takes `{found.whole.label}`, {cost_text(found)}{factor}."]


def _where_supported(found: Sequence[Candidate], target: Target, best: Candidate | None) -> list[str]:
    """What is cheaper, or does at all, in those scenes that its technique answers."""
    some = [one for one in found if not one.everywhere]
    partial = cheapest(some, target)
    if partial is None or (best is not None and (best.ms is None or partial.ms is None or partial.ms >= best.ms)):
        return []
    held, of = len(partial.held), counted(len(partial.held) + len(partial.unsupported), "scene")
    return [f"`{partial.whole.label}` does for {cost_text(partial)} in the {held} of {of} that it supports."]


def _closest(one: Candidate, scenes: int) -> str:
    if scenes > 1:
        return f"`{one.whole.label}`, in {one.met(IOU_TARGETS[0])} of them"
    return f"`{one.whole.label}`, {100 * (one.whole.value('iou') or 0.0):.3g}% right"
