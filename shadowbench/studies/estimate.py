"""How long a study will take, by a model."""

from shadowbench.measure.cells import Cell
from shadowbench.measure.flips import size_after
from shadowbench.studies.study import Study

_PIXEL_S = 12e-9  # seconds of a drawn pixel or texel, on two cores without a GPU
_DRAWN = 4  # frames that take as long as drawing and scoring a cell
_TIMED = 4 / 3  # frames of a round, with the passes


def cell_seconds(study: Study, cell: Cell) -> float:
    """Approximate seconds of drawing, scoring and timing a cell on two cores without a GPU."""
    pixels, stepped = _pixels(study, cell), size_after(study.step, study.view_size) ** 2
    timed = _TIMED * study.rounds * pixels if cell.phase == 0 else 0.0
    return _PIXEL_S * (_DRAWN * (pixels + stepped) + timed)


def _pixels(study: Study, cell: Cell) -> int:
    return study.view_size**2 + (cell.spec.map_size or 0) ** 2


def duration(seconds: float) -> str:
    """Text of a rough duration: `40 s`, `12 min`, `2.5 h`."""
    if seconds < 90:
        return f"{max(seconds, 1):.0f} s"
    return f"{seconds / 60:.0f} min" if seconds < 5400 else f"{seconds / 3600:.1f} h"
