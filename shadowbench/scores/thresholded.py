"""Visibility thresholded into shadow and lit pixels, for masks and truths alike; shadow edges and distances to them."""

from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from shadowbench.scores.masks import quantise

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


class ThresholdedMask:
    """Quantised visibility (H, W) in [0, 1], and its shadow and lit pixels among the `valid` (H, W) ones.

    Derived arrays are computed on first use and kept. Raises ValueError as `quantise` does.
    """

    def __init__(self, visibility: ArrayLike, valid: NDArray[np.bool_]) -> None:
        self.visibility: NDArray[np.float32] = np.ascontiguousarray(quantise(visibility))  # for compiled loops
        self.valid = np.ascontiguousarray(valid)

    @property
    def shape(self) -> tuple[int, int]:
        """Height and width in pixels."""
        height, width = self.visibility.shape
        return height, width

    @cached_property
    def shadow(self) -> NDArray[np.bool_]:
        """Valid pixels with visibility < ½."""
        return self.valid & (self.visibility < 0.5)

    @cached_property
    def lit(self) -> NDArray[np.bool_]:
        """Valid pixels with visibility ≥ ½."""
        return self.valid & ~self.shadow

    @cached_property
    def edge(self) -> NDArray[np.bool_]:
        """Shadow pixels beside lit ones (see `edge_pixels`)."""
        return edge_pixels(self.shadow, self.lit)
