"""Signed differences of visibility as colours over a grey picture."""

import numpy as np
from numpy.typing import NDArray

FALSE_SHADOW, FALSE_LIGHT = (213, 94, 0), (0, 114, 178)  # Okabe & Ito 2008: vermillion and blue


def difference_over(grey: NDArray[np.floating], signed: NDArray[np.floating]) -> NDArray[np.uint8]:
    """(H, W, 3) sRGB: (H, W) grey levels under FALSE_SHADOW where `signed` is below 0 and FALSE_LIGHT elsewhere.

    signed: (H, W), the mask's visibility less the truth's, in [-1, 1]; the colour is as strong as its magnitude.
    """
    color = np.where(signed[..., np.newaxis] < 0, np.array(FALSE_SHADOW), np.array(FALSE_LIGHT))
    strength = np.abs(signed)[..., np.newaxis]
    mixed: NDArray[np.uint8] = np.rint(grey[..., np.newaxis] * (1 - strength) + color * strength).astype(np.uint8)
    return mixed
