"""The tables of `run` in the terminal: of each scene, and over all scenes."""

from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from shadowbench.commands import console
from shadowbench.errors import counted, number

if TYPE_CHECKING:
    from shadowbench.results.summary import Setting, Summary
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
_OPTIONAL = ("terminator", "bleed", "false_dark", "width", "hardening", "flips", *_COSTS)  # shown where a row has them


def print_study(study: "StudyResult", folder: Path, quiet: bool) -> None:
    """One table per scene, one over all scenes, and the path of table.csv."""
    from shadowbench.results.law import law_on_record
    from shadowbench.results.summary import by_kind, over_scenes, summaries

    run = study.run.last
    scenes = summaries(run, law_on_record())
    times = "; times of a software renderer, not of a GPU" if study.info.software else "; times of this GPU"
    for scene in scenes:
        costs = {
            "frame_ms": times if study.study.rounds else "",
            "predicted_ms": f"; ms predicted for {scene.device}",
            "work_cost": "; work in millions of shader invocations and texture reads",
        }
        _print_scene(scene, costs.get(scene.cost, ""))
    kinds = by_kind(scenes) if run.frame["renderer"].nunique() == 1 else []  # no mean over renderers
    for kind in (kind for kind in kinds if len(kind) > 1):
        title = f"mean over the {len(kind)} {_kind_of(kind, kinds)}scenes, of what has a score in each"
        mean = over_scenes(kind, title)
        _print_settings(title, mean, mean.shown)
        console.print_text("")
    if not quiet:
        drawn = any(scene.max_cells for scene in scenes)
        beside = "; masks/ and pictures/ are beside it" if drawn else ""
        console.print_line(f"{folder / 'table.csv'}: {counted(len(study.run.rows), 'cell')}{beside}")


def _kind_of(kind: "Sequence[Summary]", kinds: Sequence[object]) -> str:
    """The adjective of a kind of scenes, where there are several kinds."""
    return "" if len(kinds) == 1 else "soft " if kind[0].soft else "hard "


def _print_scene(scene: "Summary", costs: str) -> None:
    """A table with a line for each setting; then unsuccessful cells and notes."""
    from shadowbench.reports.texts import bias_notes, phase_note, preset_note
    from shadowbench.results.times import time_notes

    settings, error, lines = scene.lines, scene.ranked_by.error_label, []
    for one in settings:
        total = one.cells + len(one.refused)
        for status, count in Counter(one.refused).items():
            share = f"{count} of {total} cells " if total > 1 else ""
            lines.append(f"{one.name} {one.map_size or ''}: {share}{status}")
    if scene.max_cells > 1:
        several = f"medians of up to {scene.max_cells} cells (views × phases)"
        lines.append(f"{several}; in brackets the 95% interval of {error}")
    lines += filter(None, (phase_note(settings), preset_note(settings)))
    lines += [*bias_notes(settings), *time_notes(scene.reference, [one.rough for one in scene.timed])]
    _print_settings(f"{scene.scene}, best first{' by RMSE' if scene.soft else ''}{costs}", scene, settings)
    for line in lines:
        console.print_line(f"  {line}")
    console.print_text("")


def _print_settings(title: str, summary: "Summary", settings: "Sequence[Setting]") -> None:
    columns = _columns(summary, settings)
    lines = [
        (one.name, str(one.map_size or ""), *(_cell(summary, one, key) for key in columns.values()))
        for one in settings
        if one.cells
    ]
    if lines:
        console.print_table(title, ("spec", "map", *columns), lines, numbers=("map", *columns))
    else:
        console.print_text(title)


def _columns(summary: "Summary", settings: "Sequence[Setting]") -> dict[str, str]:
    """The columns of a table, by heading; no optional one that is empty."""
    from shadowbench.reports.texts import COST_HEADINGS
    from shadowbench.results.summary import known
    from shadowbench.scores.metrics import plugged_in

    added = {one.name: one.label or one.name for one in plugged_in() if one.suits(summary.soft)}
    headings = {"error": "RMSE" if summary.soft else "1 − IoU", "cost": COST_HEADINGS[summary.cost]}
    headings |= _HEADINGS | added
    lacking = {key for key in _OPTIONAL if not any(known(getattr(one, key)) for one in settings)}
    lacking |= set() if summary.cost == "frame_ms" else {"ratio"}  # of measured times
    return {
        headings.get(key, key.replace("_", " ")): key
        for key in (*(_OF_SOFT if summary.soft else _OF_HARD), *added)
        if key not in lacking
    }


def _cell(summary: "Summary", one: "Setting", key: str) -> str:
    """The error with its interval, else the median; 1 − IoU for `iou`."""
    from shadowbench.reports.texts import error_text, value_text

    if key == "error":
        return error_text(summary, one, number)
    value = getattr(one, key)
    if key in ("iou", "gpu_bytes") and value == value:  # not NaN
        return number(1 - value) if key == "iou" else f"{value / 2**20:.1f}"
    return "–" if value != value else value_text(one, summary.cost if key == "cost" else key, number)
