"""Signed visibility differences as colours over a grey image."""

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

FALSE_SHADOW, FALSE_LIGHT = (213, 94, 0), (0, 114, 178)  # Okabe & Ito 2008: vermillion and blue
_TICKS = (-1.0, -0.25, -0.04, 0.0, 0.04, 0.25, 1.0)  # of the legend; the middle of a half only where there is room
_ROOM = 180  # pixels of width
_BAR, _FONT = 8, 10  # pixels
_GREY = 200.0


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
