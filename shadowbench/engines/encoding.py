"""Detection of global faults of a mask: a shift, an sRGB encoding, or an umbra that is not 0."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from shadowbench.engines.external_mask import decode_srgb
from shadowbench.engines.shift import Shift, estimate_shift
from shadowbench.engines.smoothing import Image, shift_image, smooth
from shadowbench.scores.comparison import Comparison
from shadowbench.scores.prepared import PENUMBRA

_FEWEST = 100
"""Soft pixels needed for a decision: a hard mask is the same in both encodings."""
_BLURS = (0.0, 0.7, 1.4, 2.8, 5.6)
"""Standard deviations in pixels: a mask may be smoother than the truth by an unknown amount."""
_CLEAR = 0.75
"""Largest misfit of another encoding, relative to that of the mask as it is, to be reported. Over the built-in scenes
at 256², with blurs and shifts, decoding left 1.13 and more of a linear mask's, 0.41 and less of an encoded one's."""
_RAISED = (0.05, 0.95)
"""Visibility in the umbra that is neither a shadow of 0 nor a missing shadow."""


@dataclass(frozen=True)
class MaskEncoding:
    """Global faults of a mask.

    shift: columns to the right and rows down, None for no shift; srgb_encoded: None if too few pixels are soft to
    decide; umbra: visibility of the mask's umbra if that is not 0.
    """

    shift: Shift | None
    srgb_encoded: bool | None = None
    umbra: float | None = None


def detect_encoding(comparison: Comparison) -> MaskEncoding:
    """The encoding under which a mask fits the truth best: linear, sRGB-encoded, or linear with a raised umbra.

    The misfit is the mean absolute difference of soft pixels from the truth's `area`, with the mask's shift undone and
    at the best blur. Linear unless another encoding fits clearly better.
    """
    prepared, given = comparison.truth, comparison.visibility
    as_is = MaskEncoding(estimate_shift(comparison))
    soft = prepared.valid & (given > PENUMBRA[0]) & (given < PENUMBRA[1])
    if np.count_nonzero(soft) < _FEWEST:
        return as_is
    candidates = [(MaskEncoding(as_is.shift, False), given)]
    decoded = decode_srgb(given).astype(np.float32)
    candidates.append((MaskEncoding(estimate_shift(Comparison(decoded, prepared)), True), decoded))
    umbra = _umbra(comparison)
    if umbra is not None and _RAISED[0] < umbra < _RAISED[1]:
        lowered = np.clip((given - np.float32(umbra)) / np.float32(1 - umbra), 0, 1)
        candidates.append(
            (MaskEncoding(estimate_shift(Comparison(lowered, prepared)), False, round(umbra, 3)), lowered)
        )
    misfits = [_misfit(values, prepared.area, prepared.valid, soft, encoding.shift) for encoding, values in candidates]
    best = int(np.argmin(misfits))
    return candidates[best if misfits[best] < _CLEAR * misfits[0] else 0][0]


def _umbra(comparison: Comparison) -> float | None:
    """Median visibility in the interior of the true shadow; None if that is too small to tell."""
    inside = comparison.visibility[comparison.truth.shadow_interior]
    return float(np.median(inside)) if len(inside) >= _FEWEST else None


def _misfit(
    values: Image, area: Image, valid: NDArray[np.bool_], soft: NDArray[np.bool_], shift: Shift | None
) -> float:
    truth, weight = area if shift is None else shift_image(area, shift), valid.astype(np.float32)
    blurred = (smooth(truth, weight, blur) if blur else truth for blur in _BLURS)
    return min(float(np.abs(values[soft] - image[soft]).mean(dtype=np.float64)) for image in blurred)
