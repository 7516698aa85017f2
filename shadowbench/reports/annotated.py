"""A strip of pictures for someone who was not there: the truth beside masks, with labels, and a place enlarged."""

import math
import textwrap
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from shadowbench.reports.strips import COLORS, ENLARGED, Truth, beside, column, worst_place

_LEAST, _MOST = 320, 512  # pixels of a picture's width
_FONT, _LINE, _MARGIN = 16, 22, 6  # pixels
TRUTH = "ray-traced truth"


def annotated(
    title: str,
    truth: Truth,
    masks: Mapping[str, NDArray[np.float32]],
    soft: bool,
    wrong: NDArray[np.floating],
    where: str = "most is wrong",
) -> NDArray[np.uint8]:
    """(H, W, 3) uint8 sRGB: the truth and masks side by side, labelled; below one place enlarged, and its difference.

    masks: (N, N) visibility by label; wrong: (N, N), of which the place has the largest sum; where: what that means.
    """
    place = worst_place(np.where(truth.undecided, 0, wrong))
    columns = []
    for label, mask in {TRUTH: truth.visibility, **masks}.items():
        picture = _fitted(column(truth, mask, soft, place), len(mask))
        columns.append((label, picture))
    width = columns[0][1].shape[1]
    height = max(len(_wrapped(label, width)) for label, _ in columns)
    labelled = [np.vstack([_text(label, width, height), picture]) for label, picture in columns]
    strip = beside(labelled)
    below = (
        f"Framed in orange: where {where}. Below it that place, enlarged {ENLARGED} times, and its difference from the "
        f"truth: {COLORS[soft]}."
    )
    lines = [_text(text, strip.shape[1], len(_wrapped(text, strip.shape[1]))) for text in (title, below)]
    return np.vstack([lines[0], strip, lines[1]])


def _fitted(picture: NDArray[np.uint8], size: int) -> NDArray[np.uint8]:
    """A column of pictures of `size` pixels a side, enlarged or reduced by a whole number so that text fits."""
    if size < _LEAST:
        times = math.ceil(_LEAST / size)
        return picture.repeat(times, axis=0).repeat(times, axis=1)
    return np.asarray(Image.fromarray(picture).reduce(math.ceil(size / _MOST)))


def _wrapped(text: str, width: int) -> list[str]:
    font = ImageFont.load_default(_FONT)
    return textwrap.wrap(text, max(8, int((width - 2 * _MARGIN) / font.getlength("n"))), break_on_hyphens=False)


def _text(text: str, width: int, lines: int) -> NDArray[np.uint8]:
    """Black text on white, (22 · lines + 12, width, 3) uint8."""
    image = Image.new("RGB", (width, lines * _LINE + 2 * _MARGIN), "white")
    draw, font = ImageDraw.Draw(image), ImageFont.load_default(_FONT)
    for at, line in enumerate(_wrapped(text, width)):
        draw.text((_MARGIN, _MARGIN + at * _LINE), line, "black", font)
    return np.asarray(image)
