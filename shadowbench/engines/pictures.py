"""What another renderer hands over: a mask, or screenshots from which visibility is derived in linear light."""

import shlex
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from shadowbench.errors import InputError
from shadowbench.scores.masks import LEVELS, open_png, quantise, read_mask

LARGEST = 4096
"""Pixels along a side of what is handed over: few bytes stand for many pixels, and scoring takes 130 bytes for each."""

DARKEST = 1 / 64
"""Linear light, of full scale, by which a lit pixel must be brighter than its ambient one to be scored."""
CLIPPED = 0.999
"""Linear luminance from which a picture may be cut off: what is brighter looks the same."""

_PICTURE = "allowed: a PNG, grey or RGB"
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
    """A linear grey PNG of 8 or 16 bits, full = lit; InputError if it is another file, not square or too large."""
    _side_of(file)
    return Handed(str(file), read_mask(file))


def mask_from_array(values: ArrayLike, name: str = "mask") -> Handed:
    """(N, N) of bool or float in [0, 1], uint8 of 255 or uint16 of 65535, 1 or full = lit; InputError otherwise."""
    array = np.asarray(values)
    full = {np.dtype(np.uint8): 255, np.dtype(np.uint16): LEVELS}.get(array.dtype, 1)
    if array.dtype.kind not in "bf" and full == 1:
        raise InputError(f"{name}: found an array of {array.dtype}; allowed: float in [0, 1], bool, uint8, uint16")
    if array.ndim != 2 or array.shape[0] != array.shape[1] or array.size == 0:
        raise InputError(f"{name}: found {_size(array.shape)} pixels; allowed: a square, as the view is")
    try:
        return Handed(name, quantise(array.astype(np.float64) / full))
    except ValueError as error:
        raise InputError(f"{name}: {error}; allowed: numbers in [0, 1]") from None


def from_screenshots(lit: Path, shadowed: Path, ambient: Path | None = None) -> Handed:
    """Visibility (shadowed − ambient) / (lit − ambient) of PNG screenshots, sRGB-encoded; ambient is 0 if absent.

    Colours are reduced to their luminance. Where lit − ambient is below 1/64 nothing can be told: 1, not measurable.
    InputError for files that are no PNG, not square, too large, or of different sizes.
    """
    files = [lit, shadowed, *([ambient] if ambient else [])]
    sides = [_side_of(file) for file in files]
    for file, side in zip(files, sides, strict=True):
        if side != sides[0]:
            raise InputError(f"{file}: found {side} × {side} pixels; allowed: {sides[0]} × {sides[0]}, as {lit}")
    pictures = [read_luminance(file) for file in files]
    floor = pictures[2] if ambient else np.zeros_like(pictures[0])
    range_of_light = pictures[0] - floor
    measurable = range_of_light >= DARKEST
    seen = np.divide(pictures[1] - floor, range_of_light, out=np.ones_like(floor), where=measurable)
    return Handed(str(shadowed), quantise(np.clip(seen, 0, 1)), measurable, pictures[0] >= CLIPPED, shadowed)


def read_luminance(file: Path) -> NDArray[np.float64]:
    """(H, W) linear luminance in [0, 1] of a PNG, grey or in colour, decoded from sRGB; transparency is left out."""
    with open_png(file, _PICTURE) as opened:
        image = opened.convert(_REDUCED[opened.mode]) if opened.mode in _REDUCED else opened
        if image.mode not in _PLAIN:
            raise InputError(f"{file}: found a PNG of mode {image.mode}; {_PICTURE}")
        levels = np.asarray(image) / _PLAIN[image.mode]
    linear = decode_srgb(levels)
    luminance: NDArray[np.float64] = linear @ _LUMINANCE if linear.ndim == 3 else linear
    return luminance


def decode_srgb(encoded: ArrayLike) -> NDArray[np.float64]:
    """Linear light in [0, 1] of sRGB-encoded values in [0, 1]; IEC 61966-2-1."""
    values = np.asarray(encoded, np.float64)
    return np.where(values <= 0.04045, values / 12.92, ((values + 0.055) / 1.055) ** 2.4)


def _side_of(file: Path) -> int:
    """Pixels along a side of a PNG, by its header; InputError if it is none, not square or too large."""
    allowed = f"allowed: a square PNG of at most {LARGEST} × {LARGEST} pixels"
    with open_png(file, allowed) as image:
        width, height = image.size
    if width != height or width > LARGEST:
        raise InputError(f"{file}: found {width} × {height} pixels; {allowed}")
    return width


def _size(shape: tuple[int, ...]) -> str:
    return " × ".join(str(side) for side in (shape[1], shape[0], *shape[2:])) if len(shape) > 1 else str(shape)


def handed_over(scene: str, mask: Path | None, lit: Path | None, shadowed: Path | None, ambient: Path | None) -> Handed:
    """A mask, or what screenshots show; InputError for both, neither or half of them, which says how to hand them over.

    scene: as the command `score` is given it.
    """
    if mask is not None and lit is shadowed is ambient is None:
        return mask_from_file(mask)
    if mask is None and lit is not None and shadowed is not None:
        return from_screenshots(lit, shadowed, ambient)
    if mask is lit is shadowed is ambient is None:
        command = f"shadowbench score {shlex.quote(scene)}"
        raise InputError(
            f"score: found neither a mask nor screenshots of {scene:.200}; allowed: {command} MASK.png, or "
            f"{command} --lit LIT.png --shadowed SHADOWED.png; shadowbench export says what to draw"
        )
    given = {"MASK": mask, "--lit": lit, "--shadowed": shadowed, "--ambient": ambient}
    found = " and ".join(key for key, value in given.items() if value is not None)
    raise InputError(f"score: found {found}; allowed: MASK, or --lit and --shadowed, with or without --ambient")
