"""Difference pictures of the cells that became worse, before beside after."""

import re
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from shadowbench.measure.flips import ROW_METRICS
from shadowbench.measure.pictures import write_picture
from shadowbench.measure.rows import Record
from shadowbench.reports.gallery import difference, read_facets, read_view
from shadowbench.results.baseline import CheckResult
from shadowbench.results.folder import Run, identity, view_name
from shadowbench.scores.difference import with_legend
from shadowbench.scores.metrics import is_soft

_MOST = 8  # pictures
_UNSAFE = re.compile(r"[^\w.+=-]+")  # not allowed in file names everywhere
_GAP = 8  # white pixels between before and after


def write_pictures(result: CheckResult) -> list[tuple[Path, bool]]:
    """Write difference pictures of the worst cells that have masks into the run's folder `check`.

    Returns each file, and whether it shows the baseline's difference beside the new one.
    """
    run, baseline = result.run, result.baseline
    if baseline is None:
        return []
    folder = run.folder / "check"
    for stale in folder.glob("*.png"):
        stale.unlink()
    before = {identity(row): row for row in baseline.rows}
    regressed = (change for change in result.findings.of("regressed") if change.what in ROW_METRICS)
    written: list[tuple[Path, bool]] = []
    for score in {id(change.score): change.score for change in regressed}.values():
        picture = _difference(run, score, run)
        if picture is None:
            continue
        old = _difference(baseline, before[identity(score)], run)
        beside = old is not None and old.shape == picture.shape
        if old is not None and beside:
            picture = np.hstack([old, np.full((len(picture), _GAP, 3), 255, np.uint8), picture])
        named = f"{len(written) + 1}.{score['scene']}.{score['spec']}.{score['map_size'] or ''}".removesuffix(".")
        file = folder / f"{_UNSAFE.sub('_', named):.120}.png"
        folder.mkdir(exist_ok=True)
        write_picture(file, with_legend(picture) if is_soft(score["metrics"]) else picture)
        written.append((file, beside))
        if len(written) == _MOST:
            break
    return written


def _difference(run: Run, score: Record, traced: Run) -> NDArray[np.uint8] | None:
    """Difference picture of a cell's mask and the truth in a run folder; None if a file is missing."""
    view = view_name(score)
    truth = traced.folder / "truth" / f"{view}.png"
    files = run.folder / "masks" / f"{score['key']}.png", truth, truth.with_suffix(".undecided.png")
    if not all(file.exists() for file in files):
        return None
    mask, visibility, undecided = (read_view(file, score["view_size"]) for file in files)
    facets = read_facets(truth, score["view_size"])
    return difference(mask, visibility, undecided >= 0.5, is_soft(score["metrics"]), facets)
