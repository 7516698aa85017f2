"""Texels of image files."""

import io
import warnings
from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from shadowbench.errors import InputError
from shadowbench.strict import short

MOST_BYTES = 1 << 28
"""Limit in bytes on the image files of a mesh file that are kept for pictures."""
MOST_TEXELS = 1 << 26
"""Limit on the texels of an image, 8192²."""
FORMATS = ("PNG", "JPEG", "WEBP", "TGA", "BMP")


def read_image(data: bytes, where: str) -> NDArray[np.uint8]:
    """(H, W, 4) uint8 red, green, blue, alpha as the file has them, row 0 at the top; alpha is 255 without one.

    Raises InputError that begins with `where` for data that are no image of FORMATS, or more than MOST_TEXELS.
    """
    with opened_image(data, where) as image:
        texels: NDArray[np.uint8] = np.asarray(_of_bytes(image).convert("RGBA"))
    return texels


def _of_bytes(image: Image.Image) -> Image.Image:
    """An image in grey of 16 bits as one of 8 with alpha, since Pillow would clip it; any other unchanged."""
    if not image.mode.startswith("I"):
        return image
    grey, clear = np.asarray(image), image.info.get("transparency")  # of a PNG, the grey that is transparent
    bytes_of = [grey // 257, 255 * (grey != clear)]
    return Image.merge("LA", [Image.fromarray(values.astype(np.uint8)) for values in bytes_of])


def mask_of(texels: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """(H, W) of (H, W, 4): the alphas, or if none is below 255 the luminance (ITU-R BT.601's luma)."""
    if (texels[..., 3] < 255).any():
        return np.ascontiguousarray(texels[..., 3])
    luminance: NDArray[np.uint8] = np.rint(texels[..., :3] @ np.array([0.299, 0.587, 0.114])).astype(np.uint8)
    return luminance


def read_square(data: bytes, where: str, side: int, opaque: bool) -> NDArray[np.uint8]:
    """(side, side, 4) uint8 texels of an image, by a box filter: red, green, blue, multiplied by alpha, and that.

    opaque: whether its alpha is ignored. Raises InputError as `read_image` does.
    """
    with opened_image(data, where) as image:
        image.draft("RGB", (side, side))  # a JPEG is decoded at a size near the one that is asked for
        resized = _of_bytes(image).convert("RGB" if opaque else "RGBA").resize((side, side), Image.Resampling.BOX)
        texels: NDArray[np.uint8] = np.asarray(resized.convert("RGBA").convert("RGBa"))
    return texels


@contextmanager
def opened_image(data: bytes, where: str) -> Iterator[Image.Image]:
    """The image of a file, not decoded yet. Raises InputError as `read_image` does, in the block too."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", Image.DecompressionBombWarning)  # its limit is not ours
            with Image.open(io.BytesIO(data), formats=FORMATS) as image:
                if image.width * image.height > MOST_TEXELS:
                    found = f"{image.width} × {image.height} texels"
                    raise InputError(f"{where}: {found}; allowed are at most {MOST_TEXELS}")
                yield image
    except InputError:
        raise
    except (OSError, ValueError, SyntaxError, Image.DecompressionBombError) as error:  # as Pillow's decoders fail
        raise InputError(f"{where}: not an image that can be read ({', '.join(FORMATS)}): {short(error)}") from error
