"""Visibility masks: as 16-bit levels, so that scored and stored values are the same, and as shadow, light and edges."""

import hashlib
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from PIL import Image, ImageFile

from shadowbench.errors import InputError
from shadowbench.files import replace_file

Single = NDArray[np.float32]
Floats = NDArray[np.float64]
Mask = NDArray[np.bool_]

LEVELS = 65535
OVERSHOOT = 1e-6  # rounding in a shader may exceed [0, 1] by this much; more is an error

_FULL_SCALE = {"L": 255, "I;16": LEVELS}  # by Pillow's modes
NOWHERE = np.iinfo(np.int32).max
"""Squared distance to an empty set."""


def quantise(visibility: ArrayLike) -> NDArray[np.float32]:
    """Visibility (H, W) of any real dtype, rounded to the levels k/65535 of a 16-bit PNG: float32 in [0, 1].

    Values at most 1e-6 outside [0, 1] are clipped. Raises ValueError for NaN, infinity, values further outside, and
    other shapes.
    """
    return _from_levels(_levels(visibility), LEVELS)


def write_mask(path: str | Path, visibility: ArrayLike) -> None:
    """Write visibility (H, W) in [0, 1] as a linear 16-bit grey PNG, row 0 at the top, atomically.

    Raises as `quantise` does, and InputError if the folder cannot be written.
    """
    image = Image.fromarray(_levels(visibility))
    with replace_file(path) as temporary:
        image.save(temporary, format="PNG")


def read_mask(path: str | Path) -> NDArray[np.float32]:
    """Read visibility (H, W) float32 in [0, 1] from a linear grey PNG of 1 to 16 bits, full = lit, row 0 at the top.

    Or from one with a palette or of 8 bits in colour, if all is opaque grey. A mask of `write_mask` is restored bit
    for bit. Raises InputError for any other file.
    """
    allowed = "allowed: an opaque grey PNG of 1, 8 or 16 bits, or one of 8 in colour or with a palette, all of it grey"
    with open_png(path, allowed) as image:
        grey = _grey(image)
        if grey.mode not in _FULL_SCALE:
            raise InputError(f"{path}: found a PNG of mode {image.mode}; {allowed}")
        return _from_levels(np.asarray(grey), _FULL_SCALE[grey.mode])


@contextmanager
def open_png(path: str | Path, allowed: str) -> Iterator[ImageFile.ImageFile]:
    """Open a PNG. Raises InputError, ending with `allowed`, for any other file, also while it is decoded inside."""
    if not Path(path).is_file():  # reading a named pipe would block
        raise InputError(f"{path}: {'is not a file' if Path(path).exists() else 'no such file'}; {allowed}")
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", Image.DecompressionBombWarning)
            image = Image.open(path, formats=["PNG"])
        with image:
            yield image
    except Image.DecompressionBombError as error:
        raise InputError(f"{path}: found too many pixels; {allowed}") from error
    except (OSError, SyntaxError, ValueError) as error:
        raise InputError(f"{path}: cannot be read as an image; {allowed}") from error


def _grey(image: ImageFile.ImageFile) -> Image.Image:
    """One channel of an opaque image of up to 8 bits whose channels are equal; any other image unchanged.

    Of 16 bits in colour Pillow would read the high bytes only.
    """
    if image.mode not in ("1", "LA", "P", "RGB", "RGBA") or "16" in str(image.tile[0][3]):
        return image
    red, green, blue, *alpha = image.convert("RGBA").split()
    opaque = all(one.getextrema() == (255, 255) for one in alpha)
    same = all(np.array_equal(np.asarray(one), np.asarray(red)) for one in (green, blue))
    return red if same and opaque else image


def mask_sha256(visibility: ArrayLike) -> str:
    """Hex SHA-256 of the 16-bit levels of visibility (H, W): row-major, little-endian, no header."""
    return hashlib.sha256(np.ascontiguousarray(_levels(visibility), "<u2").data).hexdigest()


def _levels(visibility: ArrayLike) -> NDArray[np.uint16]:
    values = np.asarray(visibility)
    if values.ndim != 2 or values.size == 0:
        raise ValueError(f"visibility has shape {values.shape}; allowed: (height, width), neither of them 0")
    if values.dtype not in (np.float32, np.float64):
        values = values.astype(np.float32)
    low, high = values.min(), values.max()
    if not (low >= -OVERSHOOT and high <= 1 + OVERSHOOT):  # written so that NaN fails too
        broken = values.size - np.count_nonzero(np.isfinite(values))
        if broken:
            raise ValueError(f"visibility is NaN or infinite in {broken} of {values.size} pixels")
        outside = np.count_nonzero((values < -OVERSHOOT) | (values > 1 + OVERSHOOT))
        raise ValueError(
            f"visibility is outside [0, 1] in {outside} of {values.size} pixels (found {low:.6g} to {high:.6g})"
        )
    scaled = values * values.dtype.type(LEVELS)
    levels: NDArray[np.uint16] = np.rint(scaled, out=scaled).astype(np.uint16)  # OVERSHOOT is far below half a level
    return levels


def _from_levels(levels: NDArray[np.integer], full: int) -> NDArray[np.float32]:
    # 255 divides 65535, so an 8-bit mask lies on the 16-bit levels and quantising it changes nothing.
    visibility: NDArray[np.float32] = np.divide(levels, np.float32(full), dtype=np.float32)
    return visibility


class ThresholdedMask:
    """Quantised visibility (H, W) in [0, 1], and its shadow and lit pixels among the `valid` (H, W) ones.

    Derived arrays are computed on first use and kept. Raises ValueError as `quantise` does.
    """

    def __init__(self, visibility: ArrayLike, valid: NDArray[np.bool_]) -> None:
        self.visibility: NDArray[np.float32] = np.ascontiguousarray(quantise(visibility))  # for compiled loops
        self.valid = np.ascontiguousarray(valid)

    @property
    def shape(self) -> tuple[int, int]:
        """Height and width in pixels."""
        height, width = self.visibility.shape
        return height, width

    @cached_property
    def shadow(self) -> NDArray[np.bool_]:
        """Valid pixels with visibility < ½."""
        return self.valid & (self.visibility < 0.5)

    @cached_property
    def lit(self) -> NDArray[np.bool_]:
        """Valid pixels with visibility ≥ ½."""
        return self.valid & ~self.shadow

    @cached_property
    def edge(self) -> NDArray[np.bool_]:
        """Shadow pixels with a lit pixel among their four neighbours.

        The borders of invalid pixels and of the image are no edges. Edge pixels lie on one side only, so that a
        straight edge shifted by k pixels is exactly k away.
        """
        lit, beside_lit = self.lit, np.zeros_like(self.lit)
        beside_lit[1:] |= lit[:-1]
        beside_lit[:-1] |= lit[1:]
        beside_lit[:, 1:] |= lit[:, :-1]
        beside_lit[:, :-1] |= lit[:, 1:]
        return np.logical_and(self.shadow, beside_lit, out=beside_lit)

    @cached_property
    def squared_edge_distance(self) -> NDArray[np.int32]:
        """Squared distance to `edge` in pixels; NOWHERE if there is no edge."""
        return squared_distance(self.edge)


def squared_distance(to: NDArray[np.bool_]) -> NDArray[np.int32]:
    """(H, W) int32 squared Euclidean distance in pixels from each pixel to the nearest in `to`, NOWHERE if empty."""
    if not to.any():
        return np.full(to.shape, NOWHERE, np.int32)
    from shadowbench.scores import loops

    squared: NDArray[np.int32] = loops.squared_distance(to)
    return squared


def greatest(values: NDArray[Any], reach: int) -> NDArray[Any]:
    """(H, W) maximum of values (H, W) within `reach` pixels along rows and columns, in a square.

    Along an axis, windows of twice the width are made of two, until one more overlap makes those of 2 · reach + 1.
    """
    for axis in (0, 1):
        windows, width = np.moveaxis(values, axis, 0), 1
        length = len(windows)
        windows = np.pad(windows, [(reach, reach), (0, 0)], mode="edge")
        while 2 * width <= 2 * reach + 1:
            windows = np.maximum(windows[:-width], windows[width:])
            width *= 2
        rest = 2 * reach + 1 - width
        values = np.moveaxis(np.maximum(windows[:length], windows[rest : rest + length]), 0, axis)
    return np.ascontiguousarray(values)
