"""What another renderer hands over: a mask, or screenshots from which visibility is derived in linear light."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray
from PIL import Image

from shadowbench.errors import InputError
from shadowbench.scores.masks import LEVELS, quantise, read_mask

DARKEST = 1 / 64
"""Linear light, of full scale, by which a lit pixel must be brighter than its ambient one to be scored."""
CLIPPED = 0.999
"""Linear luminance from which a picture may be cut off: what is brighter looks the same."""

_LUMINANCE = np.array([0.2126, 0.7152, 0.0722])  # of linear sRGB; ITU-R BT.709
_PLAIN = {"L": 255, "RGB": 255, "I;16": LEVELS, "I": LEVELS}
_REDUCED = {"P": "RGB", "RGBA": "RGB", "LA": "L", "1": "L"}  # without transparency


@dataclass(frozen=True, eq=False)
class Handed:
    """Visibility (N, N) float32, quantised, as it was handed over; row 0 at the top.

    name: what people call it. measurable: (N, N) bool, where light is enough to tell; None for a mask, everywhere.
    clipped: (N, N) bool, where the lit picture may be cut off; None for a mask. picture: the shadowed screenshot.
    """

    name: str
    visibility: NDArray[np.float32]
    measurable: NDArray[np.bool_] | None = None
    clipped: NDArray[np.bool_] | None = None
    picture: Path | None = None

    @property
    def size(self) -> int:
        """Pixels along a side: the view's size."""
        return len(self.visibility)


def mask_from_file(file: Path) -> Handed:
    """A linear grey PNG of 8 or 16 bits, full = lit; InputError if it is another file, or not square."""
    visibility = read_mask(file)
    _check_square(str(file), visibility.shape)
    return Handed(str(file), visibility)


def mask_from_array(values: ArrayLike, name: str = "mask") -> Handed:
    """(N, N) of bool or float in [0, 1], uint8 of 255 or uint16 of 65535, 1 or full = lit; InputError otherwise."""
    array = np.asarray(values)
    full = {np.dtype(np.uint8): 255, np.dtype(np.uint16): LEVELS}.get(array.dtype, 1)
    if array.dtype.kind not in "bf" and full == 1:
        raise InputError(f"{name}: found an array of {array.dtype}; allowed: float in [0, 1], bool, uint8, uint16")
    _check_square(name, array.shape)
    try:
        return Handed(name, quantise(array.astype(np.float64) / full))
    except ValueError as error:
        raise InputError(f"{name}: {error}; allowed: numbers in [0, 1]") from None


def from_screenshots(lit: Path, shadowed: Path, ambient: Path | None = None) -> Handed:
    """Visibility (shadowed − ambient) / (lit − ambient) of PNG screenshots, sRGB-encoded; ambient is 0 if absent.

    Colours are reduced to their luminance. Where lit − ambient is below 1/64 nothing can be told: 1, not measurable.
    InputError for files that are no PNG, not square, or of different sizes.
    """
    files = [lit, shadowed, *([ambient] if ambient else [])]
    pictures = [read_luminance(file) for file in files]
    _check_square(str(lit), pictures[0].shape)
    for file, picture in zip(files, pictures, strict=True):
        if picture.shape != pictures[0].shape:
            raise InputError(
                f"{file}: found {_size(picture.shape)} pixels; allowed: {_size(pictures[0].shape)}, as {lit}"
            )
    floor = pictures[2] if ambient else np.zeros_like(pictures[0])
    range_of_light = pictures[0] - floor
    measurable = range_of_light >= DARKEST
    seen = np.divide(pictures[1] - floor, range_of_light, out=np.ones_like(floor), where=measurable)
    return Handed(str(shadowed), quantise(np.clip(seen, 0, 1)), measurable, pictures[0] >= CLIPPED, shadowed)


def read_luminance(file: Path) -> NDArray[np.float64]:
    """(H, W) linear luminance in [0, 1] of a PNG, grey or in colour, decoded from sRGB; transparency is left out."""
    allowed = "allowed: a PNG, grey or RGB"
    try:
        with Image.open(file, formats=["PNG"]) as opened:
            image = opened.convert(_REDUCED[opened.mode]) if opened.mode in _REDUCED else opened
            if image.mode not in _PLAIN:
                raise InputError(f"{file}: found a PNG of mode {image.mode}; {allowed}")
            levels = np.asarray(image) / _PLAIN[image.mode]
    except FileNotFoundError:
        raise InputError(f"{file}: no such file; {allowed}") from None
    except (OSError, SyntaxError, ValueError, Image.DecompressionBombError):
        raise InputError(f"{file}: cannot be read as an image; {allowed}") from None
    linear = decode_srgb(levels)
    luminance: NDArray[np.float64] = linear @ _LUMINANCE if linear.ndim == 3 else linear
    return luminance


def decode_srgb(encoded: ArrayLike) -> NDArray[np.float64]:
    """Linear light in [0, 1] of sRGB-encoded values in [0, 1]; IEC 61966-2-1."""
    values = np.asarray(encoded, np.float64)
    return np.where(values <= 0.04045, values / 12.92, ((values + 0.055) / 1.055) ** 2.4)


def _check_square(name: str, shape: tuple[int, ...]) -> None:
    if len(shape) != 2 or shape[0] != shape[1] or shape[0] == 0:
        raise InputError(f"{name}: found {_size(shape)} pixels; allowed: a square, as the view is")


def _size(shape: tuple[int, ...]) -> str:
    return " × ".join(str(side) for side in (shape[1], shape[0], *shape[2:])) if len(shape) > 1 else str(shape)
