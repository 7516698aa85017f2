"""Difference picture: false shadow in one colour, false light in another."""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from shadowbench.engines.legend import with_legend
from shadowbench.files import replace_file
from shadowbench.scores.comparison import Comparison
from shadowbench.scores.difference import difference_over, weight

_LIT, _SHADOW, _UNSCORED = 235, 150, 255


def difference_picture(comparison: Comparison) -> NDArray[np.uint8]:
    """(H, N, 3) uint8 sRGB: the truth in greys, blended towards orange where the mask is darker, blue where lighter.

    The blend weight is the difference of visibility; pixels that are not scored are white. Of soft shadows the weight
    is the root of the difference, and the picture has a legend below it, so that H > N.
    """
    prepared = comparison.truth
    grey = np.where(prepared.valid, _SHADOW + (_LIT - _SHADOW) * prepared.visibility, _UNSCORED)
    error = np.where(prepared.valid, comparison.signed_error, 0)
    picture = difference_over(grey, weight(error, prepared.soft))
    return with_legend(picture) if prepared.soft else picture


def write_difference(file: Path, picture: NDArray[np.uint8]) -> None:
    """Write a (H, W, 3) sRGB picture as PNG. Raises InputError if the folder cannot be written."""
    with replace_file(file) as temporary:
        Image.fromarray(picture).save(temporary, format="PNG", optimize=True)
