"""SSIM over valid pixels only (Wang et al. 2004, "Image quality assessment").

Window, constants and border are those of scikit-image's
`structural_similarity(gaussian_weights=True, sigma=1.5, use_sample_covariance=False, data_range=1)`, to which it is
equal if every pixel is valid. Otherwise the weights of each window's valid pixels are rescaled to sum to 1, since
filling in the invalid ones with any value would change the score.
"""

import numpy as np
from numpy.typing import NDArray

SIGMA = 1.5
RADIUS = 5  # scikit-image's: int(3.5 sigma + ½)
C1 = 0.01**2
C2 = 0.03**2
INSIDE = (slice(RADIUS, -RADIUS), slice(RADIUS, -RADIUS))
"""Pixels whose window lies inside the image; only these are scored."""

_offsets = np.arange(-RADIUS, RADIUS + 1)
_gaussian = np.exp(-0.5 * (_offsets / SIGMA) ** 2)
_WEIGHTS = tuple(map(float, _gaussian / _gaussian.sum()))


def ssim_map(values: NDArray[np.float32], truth: NDArray[np.float32], valid: NDArray[np.bool_]) -> NDArray[np.float32]:
    """SSIM of `values` and `truth`, (H, W) float32 in [0, 1], over the `valid` (H, W) bool pixels around those INSIDE.

    Returns (H-10, W-10) float32 in [-1, 1], empty for an image smaller than a window; NaN for windows without a valid
    pixel, whose centres are invalid too.
    """
    from shadowbench.scores import loops

    similarity: NDArray[np.float32] = loops.ssim_map(values, truth, valid, _WEIGHTS, C1, C2)
    return similarity
