"""Whether a mask is upside down, mirrored or inverted: told from its correlation with the truth."""

import numpy as np
from numpy.typing import NDArray

from shadowbench.scores.prepared import PreparedTruth

TURNED = {
    "flipped vertically": (slice(None, None, -1), slice(None)),
    "flipped horizontally": (slice(None), slice(None, None, -1)),
    "rotated by 180°": (slice(None, None, -1), slice(None, None, -1)),
}
_CLEAR = 0.5
"""The correlation that a turned or inverted mask must reach before anything is said of it."""


def misorientation(visibility: NDArray[np.float32], prepared: PreparedTruth) -> str | None:
    """What is wrong with the mask as a whole, "flipped vertically" and the like; None where nothing is.

    A mask is turned if the turn at least halves what its correlation (Pearson 1895) with the truth lacks of 1, and
    brings it above ½; inverted if that of its best turn is below −½. A poor mask is neither: its errors correlate with
    no turn of the truth. Nothing can be said where truth or mask is all of one value, or of a turn that a symmetric
    picture does not show.
    """
    given = _correlation(visibility, prepared)
    found = {turn: _correlation(visibility[slices], prepared) for turn, slices in TURNED.items()}
    turn = max(found, key=lambda name: abs(found[name]))
    turned = abs(found[turn]) > _CLEAR and 1 - abs(found[turn]) < (1 - abs(given)) / 2
    inverted = (found[turn] if turned else given) < -_CLEAR
    faults = ([turn] if turned else []) + (["inverted"] if inverted else [])
    return " and ".join(faults) or None


def _correlation(visibility: NDArray[np.float32], prepared: PreparedTruth) -> float:
    """Over valid pixels; 0 where it is not defined."""
    mask = visibility[prepared.valid].astype(np.float64)
    truth = prepared.visibility[prepared.valid].astype(np.float64)
    if mask.size == 0:
        return 0.0
    mask -= mask.mean()
    truth -= truth.mean()
    scale = float(np.sqrt((mask @ mask) * (truth @ truth)))
    return float(mask @ truth) / scale if scale > 0 else 0.0
