"""Strips of the cells that became worse: the truth beside the masks before and now."""

import re
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from shadowbench.measure.flips import ROW_METRICS
from shadowbench.measure.pictures import write_picture
from shadowbench.measure.rows import Record
from shadowbench.reports.annotated import annotated
from shadowbench.reports.check_summary import by_cell, cell_name, value_text
from shadowbench.reports.gallery import read_view
from shadowbench.reports.strips import read_truth
from shadowbench.results.baseline import Change, CheckResult
from shadowbench.results.folder import Run, identity, view_name
from shadowbench.scores.metrics import is_soft

_MOST = 8  # pictures
_TOLD = 3  # changes of a cell above its picture
_UNSAFE = re.compile(r"[^\w.+=-]+")  # not allowed in file names everywhere


def write_pictures(result: CheckResult, folder: Path) -> dict[str, Path]:
    """Write a strip of each of the worst cells that have a mask into a folder; the files by the rows' keys."""
    run, baseline = result.run, result.baseline
    if baseline is None:
        return {}
    old = {identity(row): row for row in baseline.rows}
    regressed = (change for change in result.findings.of("regressed") if change.what in ROW_METRICS)
    written: dict[str, Path] = {}
    for cell in by_cell(regressed):
        score, key = cell[0].score, cell[0].score["key"]
        picture = _strip(run, baseline, cell, old[identity(score)])
        if picture is not None:
            name = f"{len(written) + 1}.{score['scene']}.{score['spec']}.{score['map_size'] or ''}".removesuffix(".")
            written[key] = folder / f"{_UNSAFE.sub('_', name):.120}.png"
            write_picture(written[key], picture)
        if len(written) == _MOST:
            break
    return written


def _strip(run: Run, baseline: Run, cell: Sequence[Change], old: Record) -> NDArray[np.uint8] | None:
    """The truth, the mask before if the baseline has it, and the mask now; None without the truth or that mask."""
    worst, score = cell[0], cell[0].score
    truth = read_truth(run.folder / "truth" / f"{view_name(score)}.png", score["view_size"])
    after, before = (_mask(folder, row) for folder, row in ((run.folder, score), (baseline.folder, old)))
    if truth is None or after is None:
        return None
    now, then = (f"{worst.what} {value_text(value)}" for value in (worst.after, worst.before))
    masks: Mapping[str, NDArray[np.float32]] = {f"now: {now}": after}
    wrong = np.abs(after - truth.visibility)
    if before is not None:
        masks = {f"before: {then}": before, **masks}
        more = np.maximum(wrong - np.abs(before - truth.visibility), 0)
        wrong = more if more.any() else wrong
    values = [f"{one.what} was {value_text(one.before)}, is {value_text(one.after)}" for one in cell[:_TOLD]]
    title = "; ".join([f"{cell_name(score)}: {values[0]}", *values[1:]])
    title += "" if before is not None else "; the baseline has no mask of it (--update --masks keeps them)"
    return annotated(title, truth, masks, is_soft(score["metrics"]), wrong, "most became worse")


def _mask(folder: Path, row: Record) -> NDArray[np.float32] | None:
    file = folder / "masks" / f"{row['key']}.png"
    return read_view(file, row["view_size"]) if file.exists() else None
