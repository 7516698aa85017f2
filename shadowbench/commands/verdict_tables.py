"""The verdict on a run in the terminal: what reaches which accuracy at the least cost, by scene and by technique."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

from shadowbench.commands import console

if TYPE_CHECKING:
    from shadowbench.reports.analysis import Section
    from shadowbench.reports.matrix import CostCell


def print_verdict(sections: "Sequence[Section]") -> None:
    """The cheapest setting for each IoU in each scene of one run, then each technique's cost over all its scenes."""
    from shadowbench.reports.matrix import IOU_TARGETS, candidates, cost_matrix, cost_row
    from shadowbench.reports.verdict import cost_note, real_time, target_name
    from shadowbench.reports.words import counted

    found = candidates(sections)
    if not found:
        console.print_line("Nothing here has a score.")
        return
    scenes = [section.scene for section in sections]
    rows = []
    for section in sections:
        own = real_time(candidates([section]))
        names = [section.scene if scenes.count(section.scene) == 1 else section.title, *[""] * len(IOU_TARGETS)]
        for name, cell in zip(names, cost_row(own, IOU_TARGETS), strict=False):
            rows.append((name, target_name(cell.target), *_cheapest(cell)))
    console.print_table("", ("scene", "target", "cost", "cheapest"), rows, numbers=("cost",), whole=("target",))
    console.out().print()
    heads = [f"over {counted(len(sections), 'scene')}", *map(target_name, IOU_TARGETS)]
    lines = cost_matrix(found, IOU_TARGETS)
    costs = [(technique, *(_cost(cell, len(sections)) for cell in cells)) for technique, cells in lines.items()]
    console.print_table("", heads, costs, whole=heads)
    partial = f" n of {len(sections)}: over the n that it supports." if any(one.unsupported for one in found) else ""
    console.print_line(f"{cost_note(sections)}{partial}")


def _cheapest(cell: "CostCell") -> tuple[str, str]:
    """The cost and the setting in one scene, and the number of other settings that cost the same."""
    from shadowbench.reports.verdict import cell_texts
    from shadowbench.reports.words import counted

    cost, label, note = cell_texts(cell, 1)
    if cell.cheapest is None:
        return cost, f"none, {note}"
    return cost, f"{label}, or {counted(len(cell.ties), 'other')}" if cell.ties else label


def _cost(cell: "CostCell", scenes: int) -> str:
    """What a technique costs, and in how many scenes if it does not support all; – if no setting reaches the target."""
    from shadowbench.reports.verdict import cost_text

    best = cell.cheapest
    if best is None:
        return "–"
    return cost_text(best) if len(best.by_scene) == scenes else f"{cost_text(best)}, {len(best.by_scene)} of {scenes}"
