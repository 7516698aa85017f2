"""Detection of global faults of a mask: a shift, an sRGB encoding, or an umbra that is not 0."""

from collections.abc import Sequence
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
_ALL_BLURS = (*_BLURS, 1.0, 2.0, 4.0, 8.0, 11.0)
_CLEAR = 0.75
"""Largest misfit of another encoding, relative to that of the mask as it is, to be reported. Over the built-in scenes
at 256², with blurs and shifts, decoding left 1.13 and more of a linear mask's, 0.41 and less of an encoded one's."""
_RAISED = (0.05, 0.95)
"""Visibility in the umbra that is neither a shadow of 0 nor a missing shadow."""
_DARKEST = 5
"""Percentile of the umbra that must be raised to speak of ambient light."""
_FITS = 0.04
"""Largest misfit in the umbra, of the truth at the best blur and of the mask without its ambient light."""
_DEEP = 12  # px from the true edge


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


@dataclass(frozen=True, eq=False)
class RaisedUmbra:
    """An umbra that is nowhere dark. level: its median visibility; of: (H, W) of every pixel, None if unknown."""

    level: float
    of: Image | None

    def undone(self, visibility: Image) -> Image:
        """The visibility that would have been without."""
        if self.of is None:
            return visibility
        level = np.minimum(self.of, np.float32(_RAISED[1]))
        lowered: Image = np.clip((visibility - level) / (1 - level), 0, 1)
        return lowered


def ambient_umbra(comparison: Comparison) -> RaisedUmbra | None:
    """The umbra of screenshots with ambient light that was not taken off; None if some of it is dark, or all is lit.

    Ambient light a and light d · N·L leave a / (a + d · N·L) of visibility in the umbra: the same on each plane,
    whatever its colour. The pixels' level is known if the mask without that, or without one value, fits the truth.
    """
    truth, inside = comparison.truth, comparison.truth.shadow_interior
    deep = inside & (truth.squared_edge_distance >= _DEEP**2)  # which soft edges do not reach
    inside = deep if np.count_nonzero(deep) >= _FEWEST else inside
    if np.count_nonzero(inside) < _FEWEST:
        return None
    found, cosine = comparison.visibility[inside], truth.cosine[inside]
    umbra = round(float(np.median(found)), 3)
    if not _RAISED[0] < umbra < _RAISED[1] or np.percentile(found, _DARKEST) < umbra / 4:
        return None
    levels = [np.zeros_like(truth.cosine)]
    for percentile in (_DARKEST, 50):  # soft edges may reach most of a narrow umbra
        ratio = np.float32(np.percentile(found * cosine / np.maximum(1 - found, 1e-3), percentile))
        levels.append(ratio / np.maximum(ratio + truth.cosine, np.float32(1e-6)))
        levels.append(np.full_like(truth.cosine, np.percentile(found, percentile)))

    def misfit(level: Image, shift: Shift | None = None) -> float:
        lowered = RaisedUmbra(umbra, level).undone(comparison.visibility)
        return _misfit(lowered, truth.area, truth.valid, inside, shift, _ALL_BLURS)

    misfits = [misfit(level) for level in levels]
    if misfits[0] < _FITS:  # soft edges alone
        return None
    level = levels[1 + int(np.argmin(misfits[1:]))]
    raised = RaisedUmbra(umbra, level)
    shift = estimate_shift(Comparison(raised.undone(comparison.visibility), truth))
    return raised if misfit(level, shift) < _FITS else RaisedUmbra(umbra, None)


def _umbra(comparison: Comparison) -> float | None:
    """Median visibility in the interior of the true shadow; None if that is too small to tell."""
    inside = comparison.visibility[comparison.truth.shadow_interior]
    return float(np.median(inside)) if len(inside) >= _FEWEST else None


def _misfit(
    values: Image,
    area: Image,
    valid: NDArray[np.bool_],
    soft: NDArray[np.bool_],
    shift: Shift | None,
    blurs: Sequence[float] = _BLURS,
) -> float:
    truth, weight = area if shift is None else shift_image(area, shift), valid.astype(np.float32)
    blurred = (smooth(truth, weight, blur) if blur else truth for blur in blurs)
    return min(float(np.abs(values[soft] - image[soft]).mean(dtype=np.float64)) for image in blurred)
