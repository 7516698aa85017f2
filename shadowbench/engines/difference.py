"""Difference picture: false shadow in one colour, false light in another; its legend for soft shadows."""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from shadowbench.files import replace_file
from shadowbench.scores.comparison import Comparison
from shadowbench.scores.difference import difference_over, weight

_TICKS = (-1.0, -0.25, -0.04, 0.0, 0.04, 0.25, 1.0)  # every third where there is little room
_ROOM = 180  # pixels of width
_BAR, _FONT = 8, 10  # pixels
_GREY = 200.0


def with_legend(picture: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """A (H, W, 3) difference picture of soft shadows, with the scale of its colours below it."""
    width = picture.shape[1]
    scale = difference_over(np.full((_BAR, width), _GREY), np.broadcast_to(np.linspace(-1, 1, width), (_BAR, width)))
    lines = 2 if width >= _ROOM else 1
    image = Image.new("RGB", (width, _BAR + lines * (_FONT + 4)), "white")
    image.paste(Image.fromarray(scale), (0, 0))
    draw, font = ImageDraw.Draw(image), ImageFont.load_default(_FONT)
    for tick in _TICKS if width >= _ROOM else _TICKS[::3]:
        x = (1 + float(weight(np.array(tick), soft=True))) / 2 * (width - 1)
        anchor = "la" if tick == -1 else "ra" if tick == 1 else "ma"
        draw.text((x, _BAR + 2), f"{tick:+g}" if tick else "0", "black", font, anchor)
    if width >= _ROOM:
        for x, anchor, text in (
            (0, "la", "too dark"),
            (width / 2, "ma", "mask - truth"),
            (width - 1, "ra", "too light"),
        ):
            draw.text((x, _BAR + _FONT + 4), text, "black", font, anchor)
    return np.vstack([picture, np.asarray(image)])


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
