"""Gaussian smoothing over valid pixels, and subpixel shifts of images."""

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

Image = NDArray[np.float32]


def smooth(values: Image, weight: Image, sigma: float) -> Image:
    """Weighted Gaussian mean of (H, W) values; 0 where the weights vanish nearby. sigma in pixels."""
    total = ndimage.gaussian_filter(weight, sigma, mode="nearest")
    mean = ndimage.gaussian_filter(values * weight, sigma, mode="nearest")
    smoothed: Image = np.divide(mean, total, out=np.zeros_like(mean), where=total > 1e-3)
    return smoothed


def shift_image(image: Image, shift: tuple[float, float]) -> Image:
    """Image shifted by columns to the right and rows down, in pixels, with cubic splines."""
    across, down = shift
    result: Image = ndimage.shift(image, (down, across), order=3, mode="nearest")
    return result
