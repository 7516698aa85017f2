"""Difference picture: false shadow in one colour, false light in another."""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from shadowbench.files import replace_file
from shadowbench.scores.comparison import Comparison
from shadowbench.scores.difference import difference_over

_LIT, _SHADOW, _UNSCORED = 235, 150, 255


def difference_picture(comparison: Comparison) -> NDArray[np.uint8]:
    """(N, N, 3) uint8 sRGB: the truth in greys, blended towards orange where the mask is darker, blue where lighter.

    The blend weight is the difference of visibility; pixels that are not scored are white.
    """
    prepared = comparison.truth
    grey = np.where(prepared.valid, _SHADOW + (_LIT - _SHADOW) * prepared.visibility, _UNSCORED)
    return difference_over(grey, np.where(prepared.valid, comparison.visibility - prepared.visibility, 0))


def write_difference(file: Path, picture: NDArray[np.uint8]) -> None:
    """Write a (N, N, 3) sRGB picture as PNG. Raises InputError if the folder cannot be written."""
    with replace_file(file) as temporary:
        Image.fromarray(picture).save(temporary, format="PNG", optimize=True)
