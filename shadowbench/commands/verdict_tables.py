"""The verdict on a run in the terminal: what reaches which accuracy at the least cost, by scene and by technique."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

from shadowbench.commands import console

if TYPE_CHECKING:
    from shadowbench.results.configurations import Section
    from shadowbench.results.ranking import CostCell


def print_verdict(sections: "Sequence[Section]") -> None:
    """The cheapest setting for each accuracy in each scene of one run, then each technique's cost over its scenes."""
    from shadowbench.reports.verdict import real_time, target_name, verdict
    from shadowbench.results.configurations import by_kind
    from shadowbench.results.ranking import candidates, cost_row, targets_of

    kinds = by_kind(sections)
    if not any(map(candidates, kinds)):
        console.print_line(verdict(sections)[0])
        return
    scenes = [section.scene for section in sections]
    rows = []
    for section in sections:
        own = real_time(candidates([section]))
        targets = targets_of(section.ranked_by)
        names = [section.scene if scenes.count(section.scene) == 1 else section.title, *[""] * len(targets)]
        for name, cell in zip(names, cost_row(own, targets), strict=False):
            rows.append((name, target_name(cell.target), *_cheapest(cell)))
    if rows:
        console.print_table(
            "", ("scene", "target", "cost", "cheapest real-time setting"), rows, numbers=("cost",), whole=("target",)
        )
    else:
        console.print_line("No real-time technique here has a score.")
    for kind in kinds:
        console.out().print()
        _print_costs(kind, "" if len(kinds) == 1 else "soft " if kind[0].soft else "hard ")


def _print_costs(sections: "Sequence[Section]", kind: str) -> None:
    from shadowbench.reports.verdict import cost_note, target_name
    from shadowbench.reports.words import counted
    from shadowbench.results.ranking import candidates, cost_matrix, targets_of

    found, targets = candidates(sections), targets_of(sections[0].ranked_by)
    heads = [f"over {counted(len(sections), f'{kind}scene')}", *map(target_name, targets)]
    lines = cost_matrix(found, targets)
    costs = [(technique, *(_cost(cell, len(sections)) for cell in cells)) for technique, cells in lines.items()]
    console.print_table("", heads, costs, whole=heads)
    partial = f" n of {len(sections)}: over the n that it supports." if any(one.unsupported for one in found) else ""
    console.print_line(f"{cost_note(sections)}{partial}")


def _cheapest(cell: "CostCell") -> tuple[str, str]:
    """The cost and the setting in one scene, and the number of others whose times do not tell them apart."""
    from shadowbench.reports.verdict import cell_texts
    from shadowbench.reports.words import counted

    cost, label, note = cell_texts(cell, 1)
    if cell.cheapest is None:
        return cost, f"none, {note}"
    return cost, f"{label}, or {counted(len(cell.ties), 'other')} within the noise" if cell.ties else label


def _cost(cell: "CostCell", scenes: int) -> str:
    """What a technique costs, and in how many scenes if it does not support all; – if no setting reaches the target."""
    from shadowbench.reports.verdict import cost_text

    best = cell.cheapest
    if best is None:
        return "–"
    return cost_text(best) if len(best.by_scene) == scenes else f"{cost_text(best)}, {len(best.by_scene)} of {scenes}"
