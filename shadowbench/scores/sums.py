"""Sums, means and shares over sets of pixels."""

import math

import numpy as np
from numpy.typing import NDArray


def overlap(mask: NDArray[np.bool_], truth: NDArray[np.bool_]) -> float | None:
    """Intersection over union of two sets; None if both are empty."""
    return ratio(int(np.count_nonzero(mask & truth)), int(np.count_nonzero(mask | truth)))


def share(wrong: NDArray[np.bool_], region: NDArray[np.bool_]) -> float | None:
    """Share of a region that is `wrong`; None if it is empty."""
    return ratio(int(np.count_nonzero(wrong & region)), int(np.count_nonzero(region)))


def mean(values: NDArray[np.float32], where: NDArray[np.bool_]) -> float | None:
    """Mean over a set of pixels; None if it is empty."""
    return ratio(total(values, where), int(np.count_nonzero(where)))


def root_mean(squares: NDArray[np.float32], where: NDArray[np.bool_], variance: float) -> float | None:
    """Root of the mean of `squares` less a known variance, at least 0; None if the set is empty."""
    found = mean(squares, where)
    return None if found is None else math.sqrt(max(found - variance, 0.0))


def total(values: NDArray[np.float32], where: NDArray[np.bool_]) -> float:
    """Sum over a set of pixels."""
    # In float64: the last digits of a float32 sum depend on its order, and so on the processor.
    return float(values.sum(where=where, dtype=np.float64))


def ratio(part: float, whole: float) -> float | None:
    """A quotient; None for a denominator of 0."""
    return float(part / whole) if whole > 0 else None
