"""A mask and its truth, with intermediate results shared by several metrics."""

from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from shadowbench.scores.masks import ThresholdedMask, squared_distance
from shadowbench.scores.penumbrae import FEWEST
from shadowbench.scores.prepared import PreparedTruth
from shadowbench.scores.sums import mean

# The window, constants and border of scikit-image's `structural_similarity(gaussian_weights=True, sigma=1.5,
# use_sample_covariance=False, data_range=1)`, to which SSIM is equal if every pixel is valid.
RADIUS = 5  # int(3.5 sigma + ½)
C1, C2 = 0.01**2, 0.03**2
INSIDE = (slice(RADIUS, -RADIUS), slice(RADIUS, -RADIUS))
"""Pixels whose window lies inside the image; only these have a SSIM."""
_gaussian = np.exp(-0.5 * (np.arange(-RADIUS, RADIUS + 1) / 1.5) ** 2)
WEIGHTS = tuple(map(float, _gaussian / _gaussian.sum()))


class Comparison(ThresholdedMask):
    """A mask and the truth of its view: the argument of every metric.

    visibility: (H, W) in [0, 1], quantised here, so that a stored mask scores the same; values outside `prepared.valid`
    are ignored. Raises ValueError as `quantise` does, and for a shape other than that of `prepared`.
    """

    def __init__(self, visibility: ArrayLike, prepared: PreparedTruth) -> None:
        super().__init__(visibility, prepared.valid)
        self.truth = prepared
        if self.shape != prepared.shape:
            raise ValueError(f"visibility has shape {self.shape}; allowed: the truth's {prepared.shape}")

    @property
    def boundary(self) -> NDArray[np.bool_]:
        """Strip of shadow, as wide as the truth's, along the inside of its edge."""
        return self._around_edge[0]

    @cached_property
    def _around_edge(self) -> tuple[NDArray[np.bool_], NDArray[np.int32]]:
        """`boundary`, and squared distances from the truth's edge pixels to `edge`; the image of them is not kept."""
        squared = squared_distance(self.edge)
        return self.shadow & (squared < self.truth.boundary_width**2), squared[self.truth.edge]

    @cached_property
    def edge_distances(self) -> NDArray[np.float64] | None:
        """(E,) distances in pixels from the edge pixels of either mask to the other's edge; None if neither has one.

        The image's diagonal, once, if only one of them has an edge.
        """
        both = self.truth.squared_edge_distance[self.edge], self._around_edge[1]
        if not all(squared.size for squared in both):
            return np.array([self.truth.image_diagonal]) if any(squared.size for squared in both) else None
        pooled: NDArray[np.float64] = np.sqrt(np.concatenate(both), dtype=np.float64)
        return pooled

    @property
    def signed_error(self) -> NDArray[np.float32]:
        """(H, W) difference from the truth's visibility, above 0 where the mask is lighter; meaningful where valid."""
        error: NDArray[np.float32] = self.visibility - self.truth.visibility
        return error

    @cached_property
    def mean_ssim(self) -> tuple[float | None, float | None]:
        """Mean SSIM (Wang et al. 2004) over valid pixels INSIDE, and over those in the truth's edge zone."""
        from shadowbench.scores import loops

        truth = self.truth
        similarity = loops.ssim_map(self.visibility, truth.visibility, truth.valid, WEIGHTS, C1, C2)
        return mean(similarity, truth.valid[INSIDE]), mean(similarity, truth.edge_zone[INSIDE])

    @cached_property
    def penumbra_widths(self) -> NDArray[np.float64] | None:
        """(C,) widths of the mask's penumbrae at the truth's crossings, in metres; None if unknown."""
        across = self.truth.crossings
        return None if across is None else across.widths_of(self.visibility)

    @property
    def width_ratios(self) -> NDArray[np.float64] | None:
        """(C,) log₂ of the mask's over the truth's widths, above 0 where too wide; None if unknown or too few."""
        across, widths = self.truth.crossings, self.penumbra_widths
        if across is None or widths is None or len(widths) < FEWEST:
            return None
        ratios: NDArray[np.float64] = np.log2(widths / across.width)
        return ratios

    @property
    def width_bias(self) -> float | None:
        """Median of `width_ratios`; None where they are."""
        ratios = self.width_ratios
        return None if ratios is None else float(np.median(ratios))

    @cached_property
    def hardening(self) -> tuple[float, float] | None:
        """Slope and relative intercept of the mask's widths over the truth's (see `Crossings.hardening`)."""
        across, widths = self.truth.crossings, self.penumbra_widths
        return None if across is None or widths is None else across.hardening(widths)
