"""Shadow edges and distances to them."""

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

NOWHERE = np.iinfo(np.int32).max
"""Squared distance to an empty set."""


def edge_pixels(shadow: NDArray[np.bool_], lit: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """(H, W) bool: shadow pixels with a lit pixel among their four neighbours.

    Pixels in neither `shadow` nor `lit` (H, W) are not scored; their borders and the image's are no edges. Edge pixels
    lie on one side only, so that a straight edge shifted by k pixels is exactly k away.
    """
    beside_lit = np.zeros_like(lit)
    beside_lit[1:] |= lit[:-1]
    beside_lit[:-1] |= lit[1:]
    beside_lit[:, 1:] |= lit[:, :-1]
    beside_lit[:, :-1] |= lit[:, 1:]
    return np.logical_and(shadow, beside_lit, out=beside_lit)


def squared_distance(to: NDArray[np.bool_]) -> NDArray[np.int32]:
    """(H, W) int32 squared Euclidean distance in pixels from each pixel to the nearest one in `to`.

    NOWHERE if `to` (H, W) is empty, for which SciPy returns arbitrary finite values.
    """
    if not to.any():
        return np.full(to.shape, NOWHERE, np.int32)
    # Indices rather than distances, which SciPy computes in float64 with several times the memory.
    offset: NDArray[np.int32] = ndimage.distance_transform_edt(~to, return_distances=False, return_indices=True)
    height, width = to.shape
    offset[0] -= np.arange(height, dtype=np.int32)[:, np.newaxis]
    offset[1] -= np.arange(width, dtype=np.int32)
    np.multiply(offset, offset, out=offset)
    squared: NDArray[np.int32] = offset[0] + offset[1]
    return squared
