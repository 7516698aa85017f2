"""The tables of a study in the terminal: one per scene, one over all scenes, and the curves of a bias sweep."""

from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from shadowbench.commands import console

if TYPE_CHECKING:
    from shadowbench.studies.measure import StudyResult
    from shadowbench.studies.sweeps import Curve
    from shadowbench.studies.tables import Slope, SummaryRow

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
    from shadowbench.reports.words import counted, digits
    from shadowbench.studies.sweeps import curves
    from shadowbench.studies.tables import bias_notes, mean_over_scenes, reference_times, slopes, summary
    from shadowbench.studies.times import time_notes

    tables, references, fits = summary(found.frame), reference_times(found.frame), slopes(found.frame)
    times = "; times of a software renderer, not of a GPU" if found.info.software else "; times of this GPU"
    times = times if found.study.rounds else ""
    for scene, rows in tables.items():
        rough = [row.rough for row in rows if row.values["frame_ms"] is not None]
        notes = [*_notes(rows), *bias_notes(rows, digits), *time_notes(references[scene], rough)]
        ranked = ", best first by RMSE" if any(row.soft for row in rows) else ", best first"
        _print_scene(f"{scene}{ranked}{times}", rows, [fit for fit in fits if fit.scene == scene], notes)
        _print_curves(scene, curves(rows, found.sweep_positions))
    kinds = [
        {scene: rows for scene, rows in tables.items() if any(row.soft for row in rows) == soft}
        for soft in (False, True)
    ]
    if found.frame["renderer"].nunique() > 1:  # no mean over renderers
        kinds = [{}, {}]
    for kind, alike in zip(("hard ", "soft ") if all(kinds) else ("", ""), kinds, strict=True):
        scenes, means = mean_over_scenes(alike)
        if len(scenes) > 1:
            _print_scene(f"mean over the {len(scenes)} {kind}scenes in which every cell was drawn", means, [], [])
    drawn = [[row for row in rows if row.cells] for rows in tables.values()]
    if any(drawn) and console.out().width < _WIDE:
        names = [name for rows in drawn for name in _columns(rows, False) if name not in _columns(rows, True)]
        dropped = ", ".join(dict.fromkeys(names))
        where = f"see {folder / 'table.csv'}, or widen the terminal to {_WIDE}"
        console.print_line(f"columns left out at a width of {console.out().width} characters ({where}): {dropped}")
    if not quiet:
        beside = "; masks/ and pictures/ are beside it" if (found.frame["status"] == "ok").any() else ""
        console.print_line(f"{folder / 'table.csv'}: {counted(len(found.run.rows), 'cell')}{beside}")


def _print_scene(title: str, rows: "list[SummaryRow]", fits: "list[Slope]", notes: list[str]) -> None:
    """Print a table: a line for each spec and map size, best first; then unsuccessful cells, slopes and notes."""
    from shadowbench.techniques.registry import preset_names

    columns = _columns(rows, console.out().width < _WIDE)
    lines = [
        (row.label, str(row.map_size or ""), *(_cell(row, key) for key in columns.values()))
        for row in rows
        if row.cells
    ]
    if lines:
        console.print_table(title, ("spec", "map", *columns), lines, numbers=("map", *columns))
    else:
        console.out().print(title, markup=False)
    for row in rows:
        for status, count in Counter(row.refused).items():
            total = row.cells + len(row.refused)
            share = f"{count} of {total} cells " if total > 1 else ""
            console.print_line(f"  {row.label} {row.map_size or ''}: {share}{status}")
    for fit in fits:
        sizes = f"{fit.sizes[0]} to {fit.sizes[-1]}"
        slope = fit.slope.text("{:+.2f}".format) + (", one phase" if fit.phases == 1 else "")
        console.print_line(
            f"  slope of log({fit.error}) over log(size), {sizes}: {slope}  {preset_names().get(fit.spec, fit.spec)}"
        )
    for line in notes:
        console.print_line(f"  {line}")
    console.out().print()


def _notes(rows: "list[SummaryRow]") -> list[str]:
    """Notes on the number of cells behind the medians, and on maps scored in one phase only."""
    from shadowbench.studies.tables import phase_note

    cells = max(row.cells for row in rows)
    medians = (
        f"medians of up to {cells} cells (views × phases); in brackets the 95% interval of {_error_label(rows)}"
        if cells > 1
        else None
    )
    return [note for note in (medians, phase_note(rows)) if note is not None]


def _columns(rows: "Sequence[SummaryRow]", narrow: bool) -> dict[str, str]:
    """The columns of a table, by heading: fewer on a narrow terminal, no optional one that is empty."""
    lacking = {key for key in _OPTIONAL if all(row.values.get(key) is None for row in rows)}
    columns = _SOFT_COLUMNS if any(row.soft for row in rows) else _COLUMNS
    return {heading: key for heading, key in columns.items() if key not in lacking and (key in _NARROW or not narrow)}


def _error_label(rows: "Sequence[SummaryRow]") -> str:
    return next((row for row in rows if row.soft), rows[0]).ranked_by.error_label


def _print_curves(scene: str, found: "list[Curve]") -> None:
    """Print a line for each factor of a bias sweep, in ascending order: acne falls, peter-panning rises, if hard."""
    if not found:
        return
    shares = () if any(row.soft for curve in found for _, row in curve.rows) else ("acne", "contact")
    rows = []
    for curve in found:
        for factor, row in curve.rows:
            marks = [*(["default"] if factor == 1 else []), *(["best"] if factor == curve.best else [])]
            cells = [_cell(row, key) for key in (*shares, "error", "ssim")]
            rows.append((row.spec, str(row.map_size or ""), f"{factor:g}", *cells, ", ".join(marks)))
    numbers = ("map", "× bias", *shares, _error_label([row for _, row in found[0].rows]), "SSIM")
    against = ": acne against contact (peter-panning)" if shares else ""
    title = f"{scene}, bias multiplied by a factor{against}"
    console.print_table(title, ("spec", *numbers, ""), rows, numbers=numbers, whole=("",))
    console.out().print()


def _cell(row: "SummaryRow", key: str) -> str:
    """The error with its interval, else the median; 1 − IoU for `iou`."""
    value = row.values.get(key)
    if key == "error":
        return row.error_text(console.number)
    if value is not None and key in ("iou", "gpu_bytes"):
        return console.number(1 - value.median) if key == "iou" else f"{value.median / 2**20:.1f}"
    return row.text(key, console.number)
