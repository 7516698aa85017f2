"""What a mask as a whole seems to be: shifted, stored with the sRGB curve, or with a shadow that is not 0."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from shadowbench.engines.pictures import decode_srgb
from shadowbench.engines.shift import Shift, shift_of
from shadowbench.engines.smoothing import Image, moved, smooth
from shadowbench.scores.comparison import Comparison

_SOFT = (0.02, 0.98)
_FEWEST = 100
"""Soft pixels below which nothing is said: a hard mask is the same in both encodings."""
_BLURS = (0.0, 0.7, 1.4, 2.8, 5.6)
"""Standard deviations in pixels: a mask may be smoother than the truth, and we do not know by how much."""
_CLEAR = 0.75
"""Share of the misfit that another reading must leave at most. Over the built-in scenes at 256², with blurs and shifts,
decoding left 1.13 and more of a linear mask's, 0.41 and less of an encoded one's."""
_RAISED = (0.05, 0.95)
"""Visibility in the umbra that is no shadow of 0, and no missing shadow either."""


@dataclass(frozen=True)
class Reading:
    """A mask read in one way. `shift`: columns right and rows down, None for none; `umbra`: what it has in place of 0.

    `encoded` is None where too few values are soft to tell.
    """

    shift: Shift | None
    encoded: bool | None = None
    umbra: float | None = None


def reading_of(comparison: Comparison) -> Reading:
    """The reading of a mask that fits the truth best: as it is, decoded from sRGB, or with its umbra taken off.

    The misfit is the mean absolute difference of soft pixels to the truth's `area`, each reading shifted as it seems to
    be and at the blur that fits it best; as it is unless another reading leaves clearly less.
    """
    prepared, given = comparison.truth, comparison.visibility
    plain = Reading(shift_of(comparison))
    soft = prepared.valid & (given > _SOFT[0]) & (given < _SOFT[1])
    if np.count_nonzero(soft) < _FEWEST:
        return plain
    readings = [(Reading(plain.shift, False), given)]
    decoded = decode_srgb(given).astype(np.float32)
    readings.append((Reading(shift_of(Comparison(decoded, prepared)), True), decoded))
    umbra = _umbra(comparison)
    if umbra is not None and _RAISED[0] < umbra < _RAISED[1]:
        lowered = np.clip((given - np.float32(umbra)) / np.float32(1 - umbra), 0, 1)
        readings.append((Reading(shift_of(Comparison(lowered, prepared)), False, round(umbra, 3)), lowered))
    misfits = [_misfit(values, prepared.area, prepared.valid, soft, reading.shift) for reading, values in readings]
    best = int(np.argmin(misfits))
    return readings[best if misfits[best] < _CLEAR * misfits[0] else 0][0]


def _umbra(comparison: Comparison) -> float | None:
    """The median visibility well inside the truth's shadow; None where that is too small to tell."""
    inside = comparison.visibility[comparison.truth.shadow_interior]
    return float(np.median(inside)) if len(inside) >= _FEWEST else None


def _misfit(
    values: Image, area: Image, valid: NDArray[np.bool_], soft: NDArray[np.bool_], shift: Shift | None
) -> float:
    truth, weight = area if shift is None else moved(area, shift), valid.astype(np.float32)
    blurred = (smooth(truth, weight, blur) if blur else truth for blur in _BLURS)
    return min(float(np.abs(values[soft] - one[soft]).mean(dtype=np.float64)) for one in blurred)
