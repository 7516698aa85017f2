"""Detection of a flipped, rotated or inverted mask by its correlation with the truth."""

import numpy as np
from numpy.typing import NDArray

from shadowbench.scores.prepared import PreparedTruth

TRANSFORMS = {
    "flipped vertically": (slice(None, None, -1), slice(None)),
    "flipped horizontally": (slice(None), slice(None, None, -1)),
    "rotated by 180°": (slice(None, None, -1), slice(None, None, -1)),
}
_CLEAR = 0.5
"""Least absolute correlation with the truth for a mask to be reported as flipped, rotated or inverted."""


def misorientation(visibility: NDArray[np.float32], prepared: PreparedTruth) -> str | None:
    """How the mask is flipped, rotated or inverted, such as "flipped vertically"; None if it is not.

    A mask is flipped or rotated if undoing that at least halves the gap of its correlation (Pearson 1895) with the
    truth to 1, and raises the correlation above ½; it is inverted if the best correlation is below −½. A poor mask is
    neither, since its errors correlate with no orientation of the truth. Constant masks and truths, and symmetries of
    the image, cannot be decided.
    """
    given = _correlation(visibility, prepared)
    found = {turn: _correlation(visibility[slices], prepared) for turn, slices in TRANSFORMS.items()}
    turn = max(found, key=lambda name: abs(found[name]))
    turned = abs(found[turn]) > _CLEAR and 1 - abs(found[turn]) < (1 - abs(given)) / 2
    inverted = (found[turn] if turned else given) < -_CLEAR
    faults = ([turn] if turned else []) + (["inverted"] if inverted else [])
    return " and ".join(faults) or None


def _correlation(visibility: NDArray[np.float32], prepared: PreparedTruth) -> float:
    """Pearson correlation over valid pixels; 0 if undefined."""
    mask = visibility[prepared.valid].astype(np.float64)
    truth = prepared.visibility[prepared.valid].astype(np.float64)
    if mask.size == 0:
        return 0.0
    mask -= mask.mean()
    truth -= truth.mean()
    scale = float(np.sqrt((mask @ mask) * (truth @ truth)))
    return float(mask @ truth) / scale if scale > 0 else 0.0
