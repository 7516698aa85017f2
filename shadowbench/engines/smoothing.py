"""Images smoothed over valid pixels, and moved by parts of a pixel."""

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

Image = NDArray[np.float32]


def smooth(values: Image, weight: Image, sigma: float) -> Image:
    """Gaussian mean of (H, W) values, each as heavy as its weight; 0 where no weight is near. sigma in pixels."""
    total = ndimage.gaussian_filter(weight, sigma, mode="nearest")
    mean = ndimage.gaussian_filter(values * weight, sigma, mode="nearest")
    smoothed: Image = np.divide(mean, total, out=np.zeros_like(mean), where=total > 1e-3)
    return smoothed


def moved(image: Image, shift: tuple[float, float]) -> Image:
    """The image moved by columns to the right and rows down, in pixels, by cubic splines."""
    across, down = shift
    result: Image = ndimage.shift(image, (down, across), order=3, mode="nearest")
    return result
