"""The tables of `run` and `report` in the terminal: of each scene, over all scenes, and the verdict."""

from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from shadowbench.commands import console
from shadowbench.errors import counted, number

if TYPE_CHECKING:
    from shadowbench.results.configurations import Configuration, Section
    from shadowbench.results.curves import Curve
    from shadowbench.results.tables import SweepPositions
    from shadowbench.studies.run import StudyResult

_COSTS = ("cost", "ratio", "gpu_bytes")  # memory: five cascades need more than one map of their size
_PENUMBRA = ("bias_pen", "bleed", "false_dark", "noise", "banding", "width", "hardening")
# As they are shown.
_OF_HARD = ("error", "iou_soft", "ssim", "edge_px", "acne", "leak", "contact", "terminator", "flips", *_COSTS)
_OF_SOFT = ("error", "rmse_pen", "iou", "ssim", *_PENUMBRA, "flips", *_COSTS)
_HEADINGS = {  # of others it is the name
    "iou": "1 − IoU",
    "iou_soft": "IoU soft",
    "ssim": "SSIM",
    "rmse_pen": "RMSE pen",
    "ratio": "× ref",
    "gpu_bytes": "MiB",
}
_WIDE = 110  # characters; a narrower terminal gets the columns that matter most
_NARROW = ("error", "rmse_pen", "iou", "ssim", "cost", "ratio")
_OPTIONAL = ("terminator", "bleed", "false_dark", "width", "hardening", "flips", *_COSTS)  # shown where a row has them


def print_study(found: "StudyResult", folder: Path, quiet: bool) -> None:
    """One table per scene, one over all scenes, and the path of table.csv."""
    from shadowbench.results.configurations import by_kind, sections
    from shadowbench.results.law import law_on_record
    from shadowbench.results.ranking import mean_section

    made = [section for parts in sections([found.run.last], law_on_record()).values() for section in parts]
    times = "; times of a software renderer, not of a GPU" if found.info.software else "; times of this GPU"
    for section in made:
        costs = {
            "frame_ms": times if found.study.rounds else "",
            "predicted_ms": f"; ms predicted for {section.device}",
            "work_cost": "; work in millions of shader invocations and texture reads",
        }
        _print_section(section, costs.get(section.cost_name, ""), found.sweep_positions)
    kinds = by_kind(made) if found.run.last.frame["renderer"].nunique() == 1 else []  # no mean over renderers
    for kind in (kind for kind in kinds if len(kind) > 1):
        title = f"mean over the {len(kind)} {_kind_of(kind, kinds)}scenes, of what has a score in each"
        _print_configurations(title, mean_section(kind, title).configurations)
        console.print_text("")
    drawn = any(one.cells for section in made for one in section.configurations)
    _print_dropped(made, folder / "table.csv")
    if not quiet:
        beside = "; masks/ and pictures/ are beside it" if drawn else ""
        console.print_line(f"{folder / 'table.csv'}: {counted(len(found.run.rows), 'cell')}{beside}")


def _print_dropped(made: "Sequence[Section]", table: Path) -> None:
    """Say which columns a narrow terminal lacks."""
    width, names = console.out().width, dict[str, None]()
    for section in made:
        drawn = [one for one in section.configurations if one.cells]
        if drawn and width < _WIDE:
            shown = _columns(drawn, True)
            names |= dict.fromkeys(name for name in _columns(drawn, False) if name not in shown)
    if names:
        where = f"see {table}, or widen the terminal to {_WIDE}"
        console.print_line(f"columns left out at a width of {width} characters ({where}): {', '.join(names)}")


def _kind_of(kind: "Sequence[Section]", kinds: Sequence[object]) -> str:
    """The adjective of a kind of scenes, where there are several kinds."""
    return "" if len(kinds) == 1 else "soft " if kind[0].soft else "hard "


def _print_section(section: "Section", costs: str, swept: "SweepPositions") -> None:
    """A table with a line for each spec and map size; then unsuccessful cells, slopes, notes and bias sweeps."""
    from shadowbench.plugin.registry import preset_names
    from shadowbench.reports.words import bias_notes, phase_note, preset_note
    from shadowbench.results.curves import curves, slopes
    from shadowbench.results.times import time_notes

    found, error, lines = section.configurations, section.ranked_by.error_label, []
    for one in found:
        total = one.cells + len(one.refused)
        for status, count in Counter(one.refused).items():
            share = f"{count} of {total} cells " if total > 1 else ""
            lines.append(f"{one.name} {one.map_size or ''}: {share}{status}")
    for fit in slopes(section):
        slope = fit.slope.text("{:+.2f}".format) + (", one phase" if fit.phases == 1 else "")
        name = preset_names().get(fit.spec, fit.spec)
        lines.append(f"slope of log({error}) over log(size), {fit.sizes[0]} to {fit.sizes[-1]}: {slope}  {name}")
    if section.max_cells > 1:
        several = f"medians of up to {section.max_cells} cells (views × phases)"
        lines.append(f"{several}; in brackets the 95% interval of {error}")
    lines += filter(None, (phase_note(found), preset_note(found)))
    lines += [*bias_notes(found), *time_notes(section.reference, [one.rough for one in section.timed])]
    _print_configurations(f"{section.scene}, best first{' by RMSE' if section.soft else ''}{costs}", found)
    for line in lines:
        console.print_line(f"  {line}")
    console.print_text("")
    _print_curves(section, curves(found, swept))


def _print_configurations(title: str, found: "Sequence[Configuration]") -> None:
    columns = _columns(found, console.out().width < _WIDE)
    lines = [
        (one.name, str(one.map_size or ""), *(_cell(one, key) for key in columns.values()))
        for one in found
        if one.cells
    ]
    if lines:
        console.print_table(title, ("spec", "map", *columns), lines, numbers=("map", *columns))
    else:
        console.print_text(title)


def _columns(found: "Sequence[Configuration]", narrow: bool) -> dict[str, str]:
    """The columns of a table, by heading: fewer on a narrow terminal, no optional one that is empty."""
    from shadowbench.reports.words import COST_HEADINGS
    from shadowbench.scores.metrics import plugged_in

    soft = any(one.soft for one in found)
    added = {one.name: one.label or one.name for one in plugged_in() if one.suits(soft)}
    cost = found[0].cost_name if found else "frame_ms"
    headings = {"error": "RMSE" if soft else "1 − IoU", "cost": COST_HEADINGS[cost]} | _HEADINGS | added
    lacking = {key for key in _OPTIONAL if all(_value(one, key) is None for one in found)}
    lacking |= set() if cost == "frame_ms" else {"ratio"}  # of measured times
    return {
        headings.get(key, key.replace("_", " ")): key
        for key in (*(_OF_SOFT if soft else _OF_HARD), *added)
        if key not in lacking and (not narrow or key in (*_NARROW, *added))
    }


def _print_curves(section: "Section", found: "list[Curve]") -> None:
    """Print a line for each factor of a bias sweep, in ascending order: acne falls, peter-panning rises, if hard."""
    if not found:
        return
    shares = () if section.soft else ("acne", "contact")
    rows = []
    for curve in found:
        for factor, one in curve.points:
            marks = {"default": factor == 1, "best": factor == curve.best}
            cells = [_cell(one, key) for key in (*shares, "error", "ssim")]
            marked = ", ".join(mark for mark, holds in marks.items() if holds)
            rows.append((one.spec, str(one.map_size or ""), f"{factor:g}", *cells, marked))
    numbers = ("map", "× bias", *shares, section.ranked_by.error_label, "SSIM")
    against = ": acne against contact (peter-panning)" if shares else ""
    title = f"{section.scene}, bias multiplied by a factor{against}"
    console.print_table(title, ("spec", *numbers, ""), rows, numbers=numbers, whole=("",))
    console.print_text("")


def _value(one: "Configuration", key: str) -> float | None:
    return one.cost if key == "cost" else one.value(key)


def _cell(one: "Configuration", key: str) -> str:
    """The error with its interval, else the median; 1 − IoU for `iou`."""
    value = _value(one, key)
    if key == "error":
        return one.error_text(number)
    if value is not None and key in ("iou", "gpu_bytes"):
        return number(1 - value) if key == "iou" else f"{value / 2**20:.1f}"
    return one.text(one.cost_name if key == "cost" else key, number)


def print_verdict(sections: "Sequence[Section]") -> None:
    """The cheapest setting for each accuracy in each scene of one run, then each technique's cost over its scenes."""
    from shadowbench.reports.verdict import cell_texts, real_time, target_name, verdict
    from shadowbench.reports.words import preset_note, sentence
    from shadowbench.results.configurations import by_kind
    from shadowbench.results.ranking import candidates, cost_row, targets_of

    kinds = by_kind(sections)
    if not any(map(candidates, kinds)):
        console.print_line(verdict(sections)[0])
        return
    scenes = [section.scene for section in sections]
    rows = []
    for section in sections:
        name = section.scene if scenes.count(section.scene) == 1 else section.title
        for cell in cost_row(real_time(candidates([section])), targets_of(section.ranked_by)):
            cost, setting, note = cell_texts(cell, 1)
            if cell.cheapest is None:
                setting = f"none, {note}"
            elif cell.ties:
                noise = " within the noise" if section.cost_name == "frame_ms" else ""
                setting += f", or {counted(len(cell.ties), 'other')}{noise}"
            rows.append((name, target_name(cell.target), cost, setting))
            name = ""
    if rows:
        heads = ("scene", "target", "cost", "cheapest real-time setting")
        console.print_table("", heads, rows, numbers=("cost",), whole=("target",))
    else:
        console.print_line("No real-time technique here has a score.")
    for kind in kinds:
        console.print_text("")
        _print_costs(kind, _kind_of(kind, kinds))
    if (presets := preset_note([one for section in sections for one in section.scored])) is not None:
        console.print_line(sentence(presets))


def _print_costs(sections: "Sequence[Section]", kind: str) -> None:
    """What each technique costs, and in how many scenes if not in all; – if no setting reaches the target."""
    from shadowbench.reports.verdict import cost_note, cost_text, target_name
    from shadowbench.results.ranking import candidates, cost_matrix, targets_of

    found, targets, scenes = candidates(sections), targets_of(sections[0].ranked_by), len(sections)
    costs = []
    for technique, cells in cost_matrix(found, targets).items():
        line = [technique]
        for best in (cell.cheapest for cell in cells):
            partial = "" if best is None or len(best.by_scene) == scenes else f", {len(best.by_scene)} of {scenes}"
            line.append("–" if best is None else f"{cost_text(best)}{partial}")
        costs.append(line)
    heads = [f"over {counted(scenes, f'{kind}scene')}", *map(target_name, targets)]
    console.print_table("", heads, costs, whole=heads)
    partial = f" n of {scenes}: over the n that it supports." if any(one.unsupported for one in found) else ""
    console.print_line(f"{cost_note(sections)}{partial}")
