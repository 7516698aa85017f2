"""How far a mask is shifted against the truth, to a part of a pixel."""

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from shadowbench.engines.smoothing import Image, moved, smooth
from shadowbench.scores.comparison import Comparison

Shift = tuple[float, float]

_SMOOTHING = (4.0, 2.0, 1.0, 1.0)
"""Standard deviations in pixels of the steps of the search, from coarse to fine."""
_FEWEST = 64
"""Pixels at an edge below which no shift is looked for."""
_FARTHEST = 8.0
"""Pixels: a mask that seems to lie further off is another picture."""
_SMALLEST = 0.2
"""Pixels: what a mask of exact positions may be off by its filter."""
_CLEAR = 0.5
"""Share of the squared misfit that undoing the shift must leave at most; a bias leaves more."""
_ALIKE = 0.8
"""The correlation at edges that undoing it must lead to: what is like nothing is shifted by nothing."""


def shift_of(comparison: Comparison) -> Shift | None:
    """Columns to the right and rows down by which the whole mask lies beside the truth, in pixels; None for no shift.

    Least squares over the pixels around edges, after Lucas and Kanade 1981, from coarse to fine, against the truth's
    `area`. It is a shift only if undoing it takes away half of the squared misfit or more, and leads to what is much
    like the truth: a bias moves each shadow by a length of its own. Along edges that all run one way nothing can be
    seen, and that part is 0.
    """
    prepared = comparison.truth
    if np.count_nonzero(prepared.valid) < _FEWEST:  # one pixel has no gradient either
        return None
    weight = prepared.valid.astype(np.float32)
    shift = (0.0, 0.0)
    for sigma in _SMOOTHING:
        truth, mask = smooth(prepared.area, weight, sigma), smooth(comparison.visibility, weight, sigma)
        there = moved(truth, shift)
        rows, columns = (np.gradient(there, axis=axis) for axis in (0, 1))
        edges = _inside(prepared.valid, max(map(abs, shift)) + 2 * sigma) & (np.hypot(rows, columns) > 0.05 / sigma)
        if np.count_nonzero(edges) < _FEWEST:
            return None
        # A mask that lies s further is T(p − s): its difference to T is −∇T · s.
        slopes = np.stack([columns[edges], rows[edges]], axis=1).astype(np.float64)
        missing = there[edges] - mask[edges]
        step, *_ = np.linalg.lstsq(slopes.T @ slopes, slopes.T @ missing, rcond=1e-2)
        shift = shift[0] + float(step[0]), shift[1] + float(step[1])
        if max(map(abs, shift)) > _FARTHEST:
            return None
    there = moved(truth, shift)
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
    """Pixels whose surroundings are valid too: what a shift brings in from outside is no shadow of the truth."""
    size = 2 * int(np.ceil(margin)) + 1
    inside: NDArray[np.bool_] = ndimage.minimum_filter(valid, size, mode="constant", cval=1)
    return inside
