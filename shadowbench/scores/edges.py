"""Where a mask's shadow ends, and how far that is from anywhere."""

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

NOWHERE = np.iinfo(np.int32).max
"""The squared distance to an empty set."""


def edge_pixels(shadow: NDArray[np.bool_], lit: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Find the shadow's outermost pixels: those with a lit one among their four neighbours. (H, W) bool.

    A pixel that is in neither of `shadow` and `lit` (H, W) is not scored: its border is no edge, nor is the
    image's. Taking one side only makes a straight edge that moved by k pixels lie exactly k away.
    """
    beside_lit = np.zeros_like(lit)
    beside_lit[1:] |= lit[:-1]
    beside_lit[:-1] |= lit[1:]
    beside_lit[:, 1:] |= lit[:, :-1]
    beside_lit[:, :-1] |= lit[:, 1:]
    return np.logical_and(shadow, beside_lit, out=beside_lit)


def squared_distance(to: NDArray[np.bool_]) -> NDArray[np.int32]:
    """Measure from each pixel to the nearest one in `to`: squared Euclidean distance in pixels. (H, W) int32.

    NOWHERE everywhere if `to` (H, W) is empty (SciPy would return finite nonsense).
    """
    if not to.any():
        return np.full(to.shape, NOWHERE, np.int32)
    # The nearest pixel's index, not its distance: SciPy makes that in float64, at several times the memory.
    offset: NDArray[np.int32] = ndimage.distance_transform_edt(~to, return_distances=False, return_indices=True)
    height, width = to.shape
    offset[0] -= np.arange(height, dtype=np.int32)[:, np.newaxis]
    offset[1] -= np.arange(width, dtype=np.int32)
    np.multiply(offset, offset, out=offset)
    squared: NDArray[np.int32] = offset[0] + offset[1]
    return squared
