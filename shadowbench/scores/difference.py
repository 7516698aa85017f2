"""Signed visibility differences as colours over a grey image."""

import numpy as np
from numpy.typing import NDArray

FALSE_SHADOW, FALSE_LIGHT = (213, 94, 0), (0, 114, 178)  # Okabe & Ito 2008: vermillion and blue


def difference_over(grey: NDArray[np.floating], signed: NDArray[np.floating]) -> NDArray[np.uint8]:
    """(H, W, 3) uint8 sRGB: grey blended towards FALSE_SHADOW where `signed` is negative, FALSE_LIGHT elsewhere.

    grey: (H, W) levels from 0 to 255; signed: (H, W) in [-1, 1], of which the magnitude is the blend weight.
    """
    color = np.where(signed[..., np.newaxis] < 0, np.array(FALSE_SHADOW), np.array(FALSE_LIGHT))
    strength = np.abs(signed)[..., np.newaxis]
    mixed: NDArray[np.uint8] = np.rint(grey[..., np.newaxis] * (1 - strength) + color * strength).astype(np.uint8)
    return mixed


def weight(error: NDArray[np.floating], soft: bool) -> NDArray[np.floating]:
    """Signed blend weight of errors of visibility in [-1, 1]: of soft shadows the root, as their errors are small."""
    return np.sign(error) * np.sqrt(np.abs(error)) if soft else error
