"""The tables of `run` and `report` in the terminal: of each scene, over all scenes, and the verdict."""

from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from shadowbench.commands import console

if TYPE_CHECKING:
    from shadowbench.results.configurations import Configuration, Section
    from shadowbench.results.curves import Curve
    from shadowbench.results.ranking import CostCell
    from shadowbench.results.tables import SweepPositions
    from shadowbench.studies.run import StudyResult


_COSTS = {"ms": "frame_ms", "× ref": "ratio", "MiB": "gpu_bytes"}  # five cascades need more than one map of their size
_COLUMNS = {  # of hard shadows; heading: value, or "error" for that by which they are ranked
    "1 − IoU": "error",
    "IoU soft": "iou_soft",
    "SSIM": "ssim",
    "edge px": "edge_px",
    "acne": "acne",
    "leak": "leak",
    "contact": "contact",
    "flips": "flips",
    **_COSTS,
}
_SOFT_COLUMNS = {
    "RMSE": "error",
    "RMSE pen": "rmse_pen",
    "1 − IoU": "iou",
    "SSIM": "ssim",
    "bias pen": "bias_pen",
    "bleed": "bleed",
    "false dark": "false_dark",
    "noise": "noise",
    "banding": "banding",
    "width": "width",
    "hardening": "hardening",
    "flips": "flips",
    **_COSTS,
}
_WIDE = 110  # characters; a narrower terminal gets the columns that matter most
_NARROW = ("error", "rmse_pen", "iou", "ssim", "frame_ms", "ratio")
_OPTIONAL = ("bleed", "false_dark", "width", "hardening", "flips", *_COSTS.values())  # shown where a row has them


def print_study(found: "StudyResult", folder: Path, quiet: bool) -> None:
    """One table per scene, one over all scenes, and the path of table.csv."""
    from shadowbench.errors import counted
    from shadowbench.results.configurations import by_kind, sections

    made = [section for parts in sections([found.run.last]).values() for section in parts]
    times = "; times of a software renderer, not of a GPU" if found.info.software else "; times of this GPU"
    for section in made:
        _print_section(section, times if found.study.rounds else "", found.sweep_positions)
    kinds = by_kind(made) if found.run.last.frame["renderer"].nunique() == 1 else []  # no mean over renderers
    for kind in kinds:
        _print_means(kind, "" if len(kinds) == 1 else "soft " if kind[0].soft else "hard ")
    drawn = [drawn for section in made if (drawn := [one for one in section.configurations if one.cells])]
    if drawn and console.out().width < _WIDE:
        _print_dropped(drawn, folder / "table.csv")
    if not quiet:
        beside = "; masks/ and pictures/ are beside it" if drawn else ""
        console.print_line(f"{folder / 'table.csv'}: {counted(len(found.run.rows), 'cell')}{beside}")


def _print_dropped(drawn: "list[list[Configuration]]", table: Path) -> None:
    """Say which columns a narrow terminal lacks."""
    names = [name for shown in drawn for name in _columns(shown, False) if name not in _columns(shown, True)]
    dropped, where = ", ".join(dict.fromkeys(names)), f"see {table}, or widen the terminal to {_WIDE}"
    console.print_line(f"columns left out at a width of {console.out().width} characters ({where}): {dropped}")


def _print_section(section: "Section", times: str, swept: "SweepPositions") -> None:
    """A table with a line for each spec and map size; then unsuccessful cells, slopes, notes and bias sweeps."""
    from shadowbench.plugin.registry import preset_names
    from shadowbench.reports.words import bias_notes, phase_note
    from shadowbench.results.curves import curves, slopes
    from shadowbench.results.times import time_notes

    _print_table(f"{section.scene}, best first{' by RMSE' if section.soft else ''}{times}", section.configurations)
    for one in section.configurations:
        for status, count in Counter(one.refused).items():
            total = one.cells + len(one.refused)
            share = f"{count} of {total} cells " if total > 1 else ""
            console.print_line(f"  {one.name} {one.map_size or ''}: {share}{status}")
    error = section.ranked_by.error_label
    for fit in slopes(section):
        sizes = f"{fit.sizes[0]} to {fit.sizes[-1]}"
        slope = fit.slope.text("{:+.2f}".format) + (", one phase" if fit.phases == 1 else "")
        console.print_line(
            f"  slope of log({error}) over log(size), {sizes}: {slope}  {preset_names().get(fit.spec, fit.spec)}"
        )
    cells = section.max_cells
    several = f"medians of up to {cells} cells (views × phases); in brackets the 95% interval of {error}"
    notes = [several if cells > 1 else None, phase_note(section.configurations), *bias_notes(section.configurations)]
    for line in [*notes, *time_notes(section.reference, [one.rough for one in section.timed])]:
        if line is not None:
            console.print_line(f"  {line}")
    console.out().print()
    _print_curves(section, curves(section.configurations, swept))


def _print_means(kind: "Sequence[Section]", what: str) -> None:
    """A table of means over scenes, of what has a score in each."""
    from shadowbench.results.ranking import mean_section

    if len(kind) > 1:
        title = f"mean over the {len(kind)} {what}scenes, of what has a score in each"
        _print_table(title, mean_section(kind, title).configurations)
        console.out().print()


def _print_table(title: str, found: "Sequence[Configuration]") -> None:
    columns = _columns(found, console.out().width < _WIDE)
    lines = [
        (one.name, str(one.map_size or ""), *(_cell(one, key) for key in columns.values()))
        for one in found
        if one.cells
    ]
    if lines:
        console.print_table(title, ("spec", "map", *columns), lines, numbers=("map", *columns))
    else:
        console.out().print(title, markup=False)


def _columns(found: "Sequence[Configuration]", narrow: bool) -> dict[str, str]:
    """The columns of a table, by heading: fewer on a narrow terminal, no optional one that is empty."""
    from shadowbench.scores.metrics import plugged_in

    lacking = {key for key in _OPTIONAL if all(one.values.get(key) is None for one in found)}
    soft = any(one.soft for one in found)
    added = {one.label or one.name: one.name for one in plugged_in() if one.suits(soft)}
    columns = (_SOFT_COLUMNS if soft else _COLUMNS) | added
    return {
        heading: key
        for heading, key in columns.items()
        if key not in lacking and (not narrow or key in (*_NARROW, *added.values()))
    }


def _print_curves(section: "Section", found: "list[Curve]") -> None:
    """Print a line for each factor of a bias sweep, in ascending order: acne falls, peter-panning rises, if hard."""
    if not found:
        return
    shares = () if section.soft else ("acne", "contact")
    rows = []
    for curve in found:
        for factor, one in curve.points:
            marks = [*(["default"] if factor == 1 else []), *(["best"] if factor == curve.best else [])]
            cells = [_cell(one, key) for key in (*shares, "error", "ssim")]
            rows.append((one.spec, str(one.map_size or ""), f"{factor:g}", *cells, ", ".join(marks)))
    numbers = ("map", "× bias", *shares, section.ranked_by.error_label, "SSIM")
    against = ": acne against contact (peter-panning)" if shares else ""
    title = f"{section.scene}, bias multiplied by a factor{against}"
    console.print_table(title, ("spec", *numbers, ""), rows, numbers=numbers, whole=("",))
    console.out().print()


def _cell(one: "Configuration", key: str) -> str:
    """The error with its interval, else the median; 1 − IoU for `iou`."""
    value = one.value(key)
    if key == "error":
        return one.error_text(console.number)
    if value is not None and key in ("iou", "gpu_bytes"):
        return console.number(1 - value) if key == "iou" else f"{value / 2**20:.1f}"
    return one.text(key, console.number)


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
    from shadowbench.errors import counted
    from shadowbench.reports.verdict import cost_note, target_name
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
    from shadowbench.errors import counted
    from shadowbench.reports.verdict import cell_texts

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
