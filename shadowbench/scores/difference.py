"""Difference pictures: false shadow, false light and dark facets, each in a colour, over a grey image."""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from shadowbench.files import replace_file
from shadowbench.scores.comparison import Comparison

FALSE_SHADOW, FALSE_LIGHT = (213, 94, 0), (0, 114, 178)  # Okabe & Ito 2008: vermillion and blue
FACETS = (204, 121, 167)  # reddish purple
_LIT, _SHADOW, _UNSCORED = 235, 150, 255


def difference_over(grey: NDArray[np.floating], signed: NDArray[np.floating]) -> NDArray[np.uint8]:
    """(H, W, 3) uint8 sRGB: grey blended towards FALSE_SHADOW where `signed` is negative, FALSE_LIGHT elsewhere.

    grey: (H, W) levels from 0 to 255; signed: (H, W) in [-1, 1], of which the magnitude is the blend weight.
    """
    mixed: NDArray[np.uint8] = np.rint(grey).astype(np.uint8)[..., np.newaxis].repeat(3, axis=-1)
    wrong = signed != 0  # of few pixels
    color = np.where(signed[wrong, np.newaxis] < 0, np.array(FALSE_SHADOW), np.array(FALSE_LIGHT))
    strength = np.abs(signed[wrong])[:, np.newaxis]
    mixed[wrong] = np.rint(grey[wrong][:, np.newaxis] * (1 - strength) + color * strength)
    return mixed


def with_facets(
    picture: NDArray[np.uint8], facets: NDArray[np.bool_], visibility: NDArray[np.floating]
) -> NDArray[np.uint8]:
    """(H, W, 3) uint8 sRGB: the picture blended towards FACETS at some pixels, (H, W), by a mask's darkness."""
    if not facets.any():
        return picture
    strength = np.where(facets, 1 - visibility, 0)[..., np.newaxis]
    mixed: NDArray[np.uint8] = np.rint(picture * (1 - strength) + np.array(FACETS) * strength).astype(np.uint8)
    return mixed


def weight(error: NDArray[np.floating], soft: bool) -> NDArray[np.floating]:
    """Signed blend weight of errors of visibility in [-1, 1]: of soft shadows the root, as their errors are small."""
    return np.sign(error) * np.sqrt(np.abs(error)) if soft else error


def difference_picture(comparison: Comparison) -> NDArray[np.uint8]:
    """(H, W, 3) uint8 sRGB: the truth in greys, blended towards orange where the mask is darker, blue where lighter.

    The blend weight is the difference of visibility, of soft shadows its root; pixels that are not scored are white.
    Where smooth surfaces are in the shadow of their own triangles, the mask's darkness is purple, as is the truth's.
    """
    prepared = comparison.truth
    grey = np.where(prepared.valid, _SHADOW + (_LIT - _SHADOW) * prepared.visibility, _UNSCORED)
    error = np.where(prepared.valid, comparison.signed_error, 0)
    picture = difference_over(grey, weight(error, prepared.soft))
    return with_facets(picture, prepared.facet_shadow, comparison.visibility)


def write_difference(file: Path, picture: NDArray[np.uint8]) -> None:
    """Write a (H, W, 3) sRGB picture as PNG. Raises InputError if the folder cannot be written."""
    with replace_file(file) as temporary:
        Image.fromarray(picture).save(temporary, format="PNG", optimize=True)
