"""Whether a mask was stored with the sRGB curve, which makes its half-shadows too light."""

import numpy as np
from numpy.typing import NDArray

from shadowbench.engines.pictures import decode_srgb
from shadowbench.engines.smoothing import moved, smooth
from shadowbench.scores.comparison import Comparison

_SOFT = (0.02, 0.98)
_FEWEST = 100
"""Soft pixels below which nothing is said: a hard mask is the same in both encodings."""
_BLURS = (0.0, 0.7, 1.4, 2.8, 5.6)
"""Standard deviations in pixels: a mask may be smoother than the truth, and we do not know by how much."""
_CLEAR = 0.75
"""Share of the misfit that decoding must leave at most. Linear masks, poor ones too, were found at 0.88 and above."""


def seems_encoded(comparison: Comparison, shift: tuple[float, float] | None = None) -> bool | None:
    """Whether the mask fits the truth much better once it is decoded from sRGB; None where too few values are soft.

    The misfit is the mean absolute difference of soft pixels to the truth's `area`, at the blur that fits best; where
    the mask is shifted (columns right, rows down), so is the truth.
    """
    reference = comparison.reference
    soft = reference.valid & (comparison.visibility > _SOFT[0]) & (comparison.visibility < _SOFT[1])
    if np.count_nonzero(soft) < _FEWEST:
        return None
    area = reference.area if shift is None else moved(reference.area, shift)
    weight = reference.valid.astype(np.float32)
    truths = [(smooth(area, weight, blur) if blur else area)[soft] for blur in _BLURS]
    given = comparison.visibility[soft]
    return _misfit(decode_srgb(given), truths) < _CLEAR * _misfit(given, truths)


def _misfit(values: NDArray[np.floating], truths: list[NDArray[np.float32]]) -> float:
    return min(float(np.abs(values - truth).mean(dtype=np.float64)) for truth in truths)
