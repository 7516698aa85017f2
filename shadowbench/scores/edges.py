"""Shadow edges and distances to them."""

import numpy as np
from numpy.typing import NDArray

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

    NOWHERE if `to` (H, W) is empty.
    """
    if not to.any():
        return np.full(to.shape, NOWHERE, np.int32)
    from shadowbench.scores import loops

    squared: NDArray[np.int32] = loops.squared_distance(to)
    return squared
