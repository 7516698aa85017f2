"""Visibility thresholded into shadow and lit pixels, for masks and truths alike."""

from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from shadowbench.scores.edges import edge_pixels
from shadowbench.scores.masks import quantise


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
