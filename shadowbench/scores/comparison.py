"""One mask beside its truth: what several metrics need of the mask, found once."""

from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from shadowbench.scores.prepared import PreparedTruth
from shadowbench.scores.split import Split
from shadowbench.scores.ssim import ssim_map


class Comparison(Split):
    """A mask and the truth of its view; the one argument of a metric.

    visibility: (H, W) in [0, 1], quantised here, so that scoring what was stored gives the same numbers; ValueError
    as `quantise` raises it, or if its shape is not that of `prepared`. Its values outside `prepared.valid` are in
    no set and no sum.
    """

    def __init__(self, visibility: ArrayLike, prepared: PreparedTruth) -> None:
        super().__init__(visibility, prepared.valid)
        self.truth = prepared
        if self.shape != prepared.shape:
            raise ValueError(f"visibility has shape {self.shape}; allowed: the truth's {prepared.shape}")

    @cached_property
    def edge_distances(self) -> NDArray[np.float64] | None:
        """Distance in pixels from each edge pixel of either mask to the other's edge; None if neither has one.

        If only one of them has an edge: the image's diagonal, once.
        """
        prepared = self.truth
        mask_to_truth = prepared.squared_edge_distance[self.edge]
        truth_to_mask = self.squared_edge_distance[prepared.edge]
        if mask_to_truth.size == 0 and truth_to_mask.size == 0:
            return None
        if mask_to_truth.size == 0 or truth_to_mask.size == 0:
            return np.array([prepared.image_diagonal])
        pooled: NDArray[np.float64] = np.sqrt(np.concatenate([mask_to_truth, truth_to_mask]), dtype=np.float64)
        return pooled

    @cached_property
    def error(self) -> NDArray[np.float32]:
        """Absolute difference to the truth's visibility; meant for valid pixels."""
        error: NDArray[np.float32] = np.abs(self.visibility - self.truth.visibility)
        return error

    @cached_property
    def ssim_map(self) -> NDArray[np.float32]:
        """SSIM at the centres that have a whole window (see `ssim`)."""
        prepared = self.truth
        return ssim_map(self.visibility, prepared.visibility, prepared.valid, prepared.ssim_moments)
