"""Subpixel shift of a mask against the truth."""

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from shadowbench.engines.smoothing import Image, shift_image, smooth
from shadowbench.scores.comparison import Comparison

Shift = tuple[float, float]

_SMOOTHING = (4.0, 2.0, 1.0, 1.0)
"""Standard deviations in pixels of the search steps, from coarse to fine."""
_FEWEST = 64
"""Edge pixels needed to estimate a shift."""
_FARTHEST = 8.0
"""Largest shift in pixels; a mask that seems shifted farther shows something else."""
_SMALLEST = 0.2
"""Smallest shift in pixels; a filter alone may seem to shift a mask by less."""
_CLEAR = 0.5
"""Largest share of the squared misfit left after undoing the shift; a bias leaves more."""
_ALIKE = 0.8
"""Least correlation at edges after undoing the shift."""


def estimate_shift(comparison: Comparison) -> Shift | None:
    """Shift of the whole mask against the truth, in columns to the right and rows down; None for no shift.

    Coarse-to-fine least squares over edge pixels (Lucas and Kanade 1981), against the truth's `area`. A shift is
    reported only if undoing it removes at least half of the squared misfit and makes the mask much like the truth; a
    bias, by contrast, displaces each shadow differently. The component along edges that are all parallel is 0.
    """
    prepared = comparison.truth
    if np.count_nonzero(prepared.valid) < _FEWEST:
        return None
    weight = prepared.valid.astype(np.float32)
    shift = (0.0, 0.0)
    for sigma in _SMOOTHING:
        truth, mask = smooth(prepared.area, weight, sigma), smooth(comparison.visibility, weight, sigma)
        there = shift_image(truth, shift)
        rows, columns = (np.gradient(there, axis=axis) for axis in (0, 1))
        edges = _inside(prepared.valid, max(map(abs, shift)) + 2 * sigma) & (np.hypot(rows, columns) > 0.05 / sigma)
        if np.count_nonzero(edges) < _FEWEST:
            return None
        # A mask shifted by s is T(p − s), which differs from T by −∇T · s.
        slopes = np.stack([columns[edges], rows[edges]], axis=1).astype(np.float64)
        missing = there[edges] - mask[edges]
        step, *_ = np.linalg.lstsq(slopes.T @ slopes, slopes.T @ missing, rcond=1e-2)
        shift = shift[0] + float(step[0]), shift[1] + float(step[1])
        if max(map(abs, shift)) > _FARTHEST:
            return None
    there = shift_image(truth, shift)
    undone = _misfit(mask, there, edges) <= _CLEAR * _misfit(mask, truth, edges)
    if max(map(abs, shift)) < _SMALLEST or not undone or not _alike(mask[edges], there[edges]):
        return None
    return round(shift[0], 3), round(shift[1], 3)


def _misfit(mask: Image, truth: Image, where: NDArray[np.bool_]) -> float:
    return float(np.square(mask - truth).sum(where=where, dtype=np.float64))


def _alike(mask: Image, truth: Image) -> bool:
    if min(np.ptp(mask), np.ptp(truth)) < 1e-3:
        return False
    return float(np.corrcoef(mask, truth)[0, 1]) >= _ALIKE


def _inside(valid: NDArray[np.bool_], margin: float) -> NDArray[np.bool_]:
    """Pixels whose neighbourhood is valid too, so that the shift brings in no invalid pixels."""
    size = 2 * int(np.ceil(margin)) + 1
    inside: NDArray[np.bool_] = ndimage.minimum_filter(valid, size, mode="constant", cval=1)
    return inside


def shift_text(shift: Shift) -> str:
    """A shift in words."""
    across, down = shift
    parts = [(across, "to the right", "to the left"), (down, "down", "up")]
    return " and ".join(
        f"{abs(value):.2f} px {forth if value > 0 else back}" for value, forth, back in parts if abs(value) >= 0.05
    )
