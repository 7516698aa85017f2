"""What is scored: a mask file, an array, or screenshots."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from shadowbench.errors import InputError
from shadowbench.options import ViewSize
from shadowbench.scores.masks import LEVELS, open_png, quantise, read_mask

LARGEST = 4096  # most pixels along a side of a mask: a small PNG may hold many, and scoring takes 130 bytes for each

PICTURE = "{:03}.png"
"""Name of a frame's picture, by its index from 0."""
DARKEST = 1 / 64  # least difference of linear luminance between a lit and an ambient pixel for it to be scored

_PICTURE = "allowed: a PNG, grey or RGB"
_LUMINANCE = np.array([0.2126, 0.7152, 0.0722])  # of linear sRGB; ITU-R BT.709
_PLAIN = {"L": 255, "RGB": 255, "I;16": LEVELS, "I": LEVELS}
_REDUCED = {"P": "RGB", "RGBA": "RGB", "LA": "L", "1": "L"}  # without transparency


@dataclass(frozen=True, eq=False)
class ExternalMask:
    """Visibility drawn by another renderer: (H, W) float32, quantised; row 0 at the top.

    name: its name in messages. Of screenshots only: measurable: (H, W) bool, pixels lit strongly enough; picture: the
    shadowed screenshot.
    """

    name: str
    visibility: NDArray[np.float32]
    measurable: NDArray[np.bool_] | None = None
    picture: Path | None = None

    @property
    def size(self) -> ViewSize:
        """Of the mask, which is the view's size."""
        height, width = self.visibility.shape
        return ViewSize(width, height)


def mask_from_file(file: Path) -> ExternalMask:
    """Read a linear grey PNG of 8 or 16 bits, full = lit. Raises InputError for other or too large files."""
    _size_of(file)
    return ExternalMask(str(file), read_mask(file))


def visibility_of(values: ArrayLike, name: str) -> NDArray[np.floating | np.bool_]:
    """Visibility of an (H, W) array: bool or float unchanged, uint8 or uint16 divided by full scale = lit.

    Raises InputError for others. Values are not checked.
    """
    array = np.asarray(values)
    full = {np.dtype(np.uint8): 255, np.dtype(np.uint16): LEVELS}.get(array.dtype, 1)
    if array.dtype.kind not in "bf" and full == 1:
        raise InputError(f"{name}: found an array of {array.dtype}; allowed: float in [0, 1], bool, uint8, uint16")
    if full > 1 and array.max(initial=0) == 1:
        raise InputError(f"{name}: found {array.dtype} up to 1; allowed: up to {full}, which is lit")
    if array.ndim != 2 or array.size == 0:
        across = " × ".join(map(str, (*array.shape[1::-1], *array.shape[2:])))
        raise InputError(f"{name}: found {across} pixels; allowed: rows of columns, as the view has")
    return array if full == 1 else array.astype(np.float64) / full


def mask_from_array(values: ArrayLike, name: str = "mask") -> ExternalMask:
    """Mask of an (H, W) array: bool, float in [0, 1], uint8 or uint16, 1 or full scale = lit. Raises InputError."""
    try:
        return ExternalMask(name, quantise(visibility_of(values, name).astype(np.float64)))
    except ValueError as error:
        raise InputError(f"{name}: {error}; allowed: numbers in [0, 1]") from None


def from_screenshots(lit: Path, shadowed: Path, ambient: Path | None = None, *, linear: bool = False) -> ExternalMask:
    """Visibility (shadowed − ambient) / (lit − ambient) of PNG screenshots; ambient is 0 if absent.

    linear: whether they hold linear values, not sRGB-encoded ones. Computed on linear luminance. Where lit − ambient is
    below 1/64, visibility is 1 and not measurable. Raises InputError for files that are no PNG, too large,
    or of different sizes.
    """
    sizes = {file: _size_of(file) for file in (lit, shadowed, ambient) if file}
    for file, size in sizes.items():
        if size != sizes[lit]:
            found, allowed = (f"{one.width} × {one.height}" for one in (size, sizes[lit]))
            raise InputError(f"{file}: found {found} pixels; allowed: {allowed}, as {lit}")
    full, dimmed = read_luminance(lit, linear), read_luminance(shadowed, linear)
    floor = read_luminance(ambient, linear) if ambient else np.zeros_like(full)
    measurable = full - floor >= DARKEST
    share = np.divide(dimmed - floor, full - floor, out=np.ones_like(floor), where=measurable)
    visibility = quantise(np.clip(share, 0, 1))
    return ExternalMask(str(shadowed), visibility, measurable, shadowed)


def read_luminance(file: Path, linear: bool = False) -> NDArray[np.float64]:
    """(H, W) linear luminance in [0, 1] of a grey or colour PNG, decoded from sRGB unless linear; alpha is ignored."""
    with open_png(file, _PICTURE) as opened:
        image = opened.convert(_REDUCED[opened.mode]) if opened.mode in _REDUCED else opened
        if image.mode not in _PLAIN:
            raise InputError(f"{file}: found a PNG of mode {image.mode}; {_PICTURE}")
        levels = np.asarray(image) / _PLAIN[image.mode]
    values = levels if linear else decode_srgb(levels)
    luminance: NDArray[np.float64] = values @ _LUMINANCE if values.ndim == 3 else values
    return luminance


def decode_srgb(encoded: ArrayLike) -> NDArray[np.float64]:
    """Linear values in [0, 1] of sRGB-encoded values in [0, 1]; IEC 61966-2-1."""
    values = np.asarray(encoded, np.float64)
    return np.where(values <= 0.04045, values / 12.92, ((values + 0.055) / 1.055) ** 2.4)


def _size_of(file: Path) -> ViewSize:
    """Size of a PNG, from its header. Raises InputError if it is no PNG or too large."""
    allowed = f"allowed: a PNG of at most {LARGEST} × {LARGEST} pixels"
    with open_png(file, allowed) as image:
        size = ViewSize(*image.size)
    if max(size) > LARGEST:
        raise InputError(f"{file}: found {size.width} × {size.height} pixels; {allowed}")
    return size


def external_mask(
    mask: str | Path | ArrayLike | None,
    lit: str | Path | None = None,
    shadowed: str | Path | None = None,
    ambient: str | Path | None = None,
    linear: bool = False,
) -> ExternalMask:
    """A mask from a file or an array, or the visibility of screenshots. Raises InputError unless it is one of them."""
    options = {"MASK": mask, "--lit": lit, "--shadowed": shadowed, "--ambient": ambient, "--linear": linear or None}
    given = [name for name, value in options.items() if value is not None]
    if mask is not None and given == ["MASK"]:
        return mask_from_file(Path(mask)) if isinstance(mask, str | Path) else mask_from_array(mask)
    if mask is None and lit is not None and shadowed is not None:
        return from_screenshots(Path(lit), Path(shadowed), Path(ambient) if ambient else None, linear=linear)
    allowed = "MASK; or --lit and --shadowed, with or without --ambient and --linear"
    raise InputError(f"score: found {' and '.join(given) or 'no picture'}; allowed: {allowed}")
