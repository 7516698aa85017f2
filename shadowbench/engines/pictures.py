"""Masks from an engine's pictures, lit and shadowed; pictures that cannot be of the scene are refused."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter, minimum_filter

from shadowbench.engines.external_mask import decode_srgb
from shadowbench.measure.worker import CellFailed
from shadowbench.plugin.engine import Engine
from shadowbench.scores.masks import quantise
from shadowbench.truths.trace import Truth

BRIGHTER = 16.0
"""Ratio of two exposures: of 255 levels of sRGB, a pixel at 1/64 of full light has 34 in one, 137 in the other."""
_FULL = 0.98  # luminance from which a pixel may be cut off
DARKEST = 1 / 64  # least luminance, at the brightest exposure, at which a pixel is scored
_TOLERATED = 2e-3  # share of pixels that may be lighter with shadows
_ODD = 0.02  # share of pixels that may be shaded otherwise than they or those beside them are
_STEP = 0.01  # of N·L, which 8 bits round
_GRAZING = 0.1  # N·L below which rounding may turn a surface away
_ALIKE = 0.1  # relative difference from N·L up to which shading is Lambert's

Luminance = NDArray[np.float64]
Levels = Sequence[Luminance]
"""Linear luminance of a picture at exposures that grow by BRIGHTER, (N, N) each, row 0 at the top."""


def luminance(picture: NDArray[np.uint8 | np.float32], engine: type[Engine], size: int) -> Luminance:
    """(N, N) linear luminance of an engine's picture. Raises CellFailed for other shapes, NaN, and infinity."""
    if picture.shape[:2] != (size, size) or picture.ndim != 3 or picture.shape[2] not in (3, 4):
        raise CellFailed(f"drew {' × '.join(map(str, picture.shape))}; allowed: {size} × {size} × 3 or 4")
    values = picture[..., :3] / (255.0 if picture.dtype == np.uint8 else 1.0)
    if not np.isfinite(values).all():
        raise CellFailed("drew values that are not finite")
    linear = decode_srgb(values) if engine.encoding == "srgb" else values.astype(np.float64)
    return np.asarray(linear.mean(axis=-1))  # all surfaces and lights are white


def visibility(lit: Levels, shadowed: Levels) -> tuple[NDArray[np.float32], NDArray[np.bool_]]:
    """(N, N) visibility, the shadowed picture's share of the lit one, and (N, N) bool, where it can be measured.

    Taken at the brightest exposure at which a pixel is not cut off. Raises CellFailed for shadows that lighten.
    """
    full, part = lit[0], shadowed[0]
    for brighter, darkened in zip(lit[1:], shadowed[1:], strict=True):
        usable = brighter < _FULL
        full, part = np.where(usable, brighter, full), np.where(usable, darkened, part)
    lighter = (part > full + 2 / 255 + 0.02 * full).mean()
    if lighter > _TOLERATED:
        raise CellFailed(f"drew {lighter:.1%} of the pixels lighter with shadows than without")
    measurable = full >= DARKEST
    share = np.divide(part, full, out=np.ones_like(full), where=measurable)
    return quantise(np.clip(share, 0, 1)), measurable


def encode_srgb(linear: Luminance) -> NDArray[np.uint8]:
    """(N, N, 3) sRGB picture of linear luminance; IEC 61966-2-1."""
    values = np.clip(linear, 0, 1)
    encoded = np.where(values <= 0.0031308, values * 12.92, 1.055 * values ** (1 / 2.4) - 0.055)
    return np.repeat(np.round(encoded * 255).astype(np.uint8)[..., np.newaxis], 3, axis=-1)


def too_dark(lit: Luminance, truth: Truth) -> float:
    """Share of what faces the light that is too dark in a picture to be scored; 0 if nothing does."""
    inside = _facing(truth)
    return float((lit[inside] < DARKEST).mean()) if inside.any() else 0.0


def check_lit(lit: Levels, truth: Truth, directional: bool) -> None:
    """Raises CellFailed for pictures that are black where surfaces face the light or, under a sun, not shaded by N·L.

    A picture of another frame, upside down, or with a wrong encoding is one of these. A pixel may be shaded as one
    beside it is, as rasterisers differ at edges.
    """
    least, most = minimum_filter(truth.cosine, 3), maximum_filter(truth.cosine, 3)
    inside = _facing(truth)
    if not inside.any():
        return
    facing = inside & (least > _GRAZING)
    if facing.any() and (dark := (lit[-1][facing] <= 0).mean()) > _ODD:
        raise CellFailed(f"drew {dark:.1%} of what faces the light black, without shadows")
    if directional:
        light = lit[0][inside]
        level = float(np.median(light / truth.cosine[inside]))
        odd = (light < level * ((1 - _ALIKE) * least[inside] - _STEP)) | (
            light > level * ((1 + _ALIKE) * most[inside] + _STEP)
        )
        if level <= 0 or (share := odd.mean()) > _ODD:
            told = "no pixel" if level <= 0 else f"{1 - share:.1%} of the pixels"
            raise CellFailed(f"shaded {told} by N·L: another frame or encoding")


def _facing(truth: Truth) -> NDArray[np.bool_]:
    """Where surfaces face the light and the truth is decided."""
    return truth.receivers & ~truth.undecided & (truth.cosine > _GRAZING)
