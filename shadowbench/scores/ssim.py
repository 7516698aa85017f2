"""SSIM over valid pixels only (Wang et al. 2004, "Image quality assessment").

Window, constants and border are those of scikit-image's
`structural_similarity(gaussian_weights=True, sigma=1.5, use_sample_covariance=False, data_range=1)`, to which it is
equal if every pixel is valid. Otherwise the weights of each window's valid pixels are rescaled to sum to 1, since
filling in the invalid ones with any value would change the score.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

SIGMA = 1.5
RADIUS = 5  # scikit-image's: int(3.5 sigma + ½)
C1 = 0.01**2
C2 = 0.03**2
INSIDE = (slice(RADIUS, -RADIUS), slice(RADIUS, -RADIUS))
"""Pixels whose window lies inside the image; only these are scored."""

_offsets = np.arange(-RADIUS, RADIUS + 1)
_KERNEL = np.exp(-0.5 * (_offsets / SIGMA) ** 2)
_KERNEL /= _KERNEL.sum()

# Float64, because a variance is a difference of nearly equal numbers and C2 is small: float32 would be off by 1e-4
# in a flat region. In bands of rows, to save memory and stay in the processor's cache.
_BAND = 128


@dataclass(frozen=True, eq=False)
class WindowMoments:
    """Gaussian-weighted moments of an image in the windows of the pixels INSIDE; each (H-10, W-10) float64."""

    weight: NDArray[np.float64]  # total weight of the window's valid pixels, in [0, 1]
    mean: NDArray[np.float64]
    variance: NDArray[np.float64]


def window_moments(values: NDArray[np.float32], valid: NDArray[np.bool_]) -> WindowMoments:
    """Mean and variance of `values` (H, W) float32 in [0, 1] over the `valid` (H, W) bool pixels of each window.

    In a window without valid pixels the weight is 0 and the moments are NaN.
    """
    weight, mean, variance = (np.empty(_inside(valid.shape)) for _ in range(3))
    for rows, window_rows in _bands(valid.shape[0]):
        counted = valid[window_rows].astype(np.float64)
        weighted = np.multiply(values[window_rows], counted)
        with np.errstate(invalid="ignore"):  # 0/0 in windows without a valid pixel
            weight[rows] = _window_sum(counted)
            mean[rows] = _window_sum(weighted) / weight[rows]
            variance[rows] = _window_sum(np.multiply(weighted, weighted, out=counted)) / weight[rows] - mean[rows] ** 2
    return WindowMoments(weight, mean, variance)


def ssim_map(
    values: NDArray[np.float32], truth: NDArray[np.float32], valid: NDArray[np.bool_], moments: WindowMoments
) -> NDArray[np.float32]:
    """SSIM of `values` and `truth`, (H, W) float32 in [0, 1], at the pixels INSIDE; `moments` are those of the truth.

    Returns (H-10, W-10) float32 in [-1, 1], empty for an image smaller than a window; NaN for windows without a valid
    pixel, whose centres are invalid too.
    """
    similarity = np.empty(_inside(valid.shape), np.float32)
    for rows, window_rows in _bands(valid.shape[0]):
        weight, mean_t, variance_t = moments.weight[rows], moments.mean[rows], moments.variance[rows]
        weighted = np.multiply(values[window_rows], valid[window_rows], dtype=np.float64)
        with np.errstate(invalid="ignore"):
            mean = _window_sum(weighted) / weight
            variance = _window_sum(weighted * weighted) / weight - mean**2
            covariance = _window_sum(np.multiply(weighted, truth[window_rows], out=weighted)) / weight - mean * mean_t
            luminance = (2 * mean * mean_t + C1) / (mean**2 + mean_t**2 + C1)
            similarity[rows] = luminance * (2 * covariance + C2) / (variance + variance_t + C2)
    return similarity


def _inside(shape: tuple[int, ...]) -> tuple[int, ...]:
    return tuple(max(length - 2 * RADIUS, 0) for length in shape)


def _bands(height: int) -> Iterator[tuple[slice, slice]]:
    """Slices of rows INSIDE, and of the image rows that their windows cover."""
    for first in range(0, height - 2 * RADIUS, _BAND):
        last = min(first + _BAND, height - 2 * RADIUS)
        yield slice(first, last), slice(first, last + 2 * RADIUS)


def _window_sum(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """(h-10, w-10) Gaussian-weighted sums over the windows inside a (h, w) image."""
    columns = ndimage.correlate1d(values, _KERNEL, axis=0)[RADIUS:-RADIUS]
    summed: NDArray[np.float64] = ndimage.correlate1d(columns, _KERNEL, axis=1)[:, RADIUS:-RADIUS]
    return summed
