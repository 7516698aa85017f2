"""Sums, means and shares over sets of pixels."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

Single = NDArray[np.float32]
Floats = NDArray[np.float64]
Mask = NDArray[np.bool_]

_BAND = 16 * 8192  # pixels; NumPy adds up float32 values in float64 by 8192


def overlap(mask: Mask, truth: Mask) -> float | None:
    """Intersection over union of two sets; None if both are empty."""
    return ratio(int(np.count_nonzero(mask & truth)), int(np.count_nonzero(mask | truth)))


def share(wrong: Mask, region: Mask) -> float | None:
    """Share of a region that is `wrong`; None if it is empty."""
    return ratio(int(np.count_nonzero(wrong & region)), int(np.count_nonzero(region)))


def mean_of(function: Callable[..., Single], where: Mask, *images: Single) -> float | None:
    """Mean of a function of images over a set of pixels; None if it is empty."""
    return ratio(total_of(function, where, *images), int(np.count_nonzero(where)))


def total_of(function: Callable[..., Single], where: Mask, *images: Single) -> float:
    """Sum of a function of contiguous images over a set of pixels: NumPy's over the whole image, to the last bit.

    In bands, which stay in the processor's cache.
    """
    flat, counted, sum_ = [image.ravel() for image in images], where.ravel(), 0.0
    for first in range(0, where.size, _BAND):
        band = slice(first, first + _BAND)
        values = function(*(image[band] for image in flat))
        sum_ = values.sum(where=counted[band], dtype=np.float64, initial=sum_)
    return float(sum_)


def mean(values: Single, where: Mask) -> float | None:
    """Mean over a set of pixels; None if it is empty."""
    return ratio(total(values, where), int(np.count_nonzero(where)))


def total(values: Single, where: Mask) -> float:
    """Sum over a set of pixels."""
    # In float64: the last digits of a float32 sum depend on its order, and so on the processor.
    return float(values.sum(where=where, dtype=np.float64))


def ratio(part: float, whole: float) -> float | None:
    """A quotient; None for a denominator of 0."""
    return float(part / whole) if whole > 0 else None
