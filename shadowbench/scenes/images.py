"""Texels of image files."""

import io
import warnings

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from shadowbench.errors import InputError
from shadowbench.strict import short

MOST_TEXELS = 1 << 26
"""Limit on the texels of an image, 8192²."""
FORMATS = ("PNG", "JPEG", "WEBP", "TGA", "BMP")


def read_image(data: bytes, where: str) -> NDArray[np.uint8]:
    """(H, W, 4) uint8 red, green, blue, alpha as the file has them, row 0 at the top; alpha is 255 without one.

    Raises InputError that begins with `where` for data that are no image of FORMATS, or more than MOST_TEXELS.
    """
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", Image.DecompressionBombWarning)  # its limit is not ours
            with Image.open(io.BytesIO(data), formats=FORMATS) as image:
                if image.width * image.height > MOST_TEXELS:
                    size = f"{image.width} × {image.height} texels"
                    raise InputError(f"{where}: {size}; allowed are at most {MOST_TEXELS}")
                texels: NDArray[np.uint8] = np.asarray(_of_bytes(image).convert("RGBA"))
                return texels
    except (OSError, ValueError, SyntaxError, Image.DecompressionBombError) as error:  # as Pillow's decoders fail
        raise InputError(f"{where}: not an image that can be read ({', '.join(FORMATS)}): {short(error)}") from error


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
