"""Medians with their confidence intervals."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

_BOOTSTRAPS = 2000


@dataclass(frozen=True)
class Interval:
    """Median over views and phases, with its 95% bootstrap confidence interval and the range of the values.

    low, high: ends of the confidence interval; least, most: of the range. None for one value.
    """

    median: float
    low: float | None = None
    high: float | None = None
    least: float | None = None
    most: float | None = None

    def complement(self) -> "Interval":
        """Interval of 1 − x, which turns a similarity into an error."""
        ends = (None if end is None else 1 - end for end in (self.high, self.low, self.most, self.least))
        return Interval(1 - self.median, *ends)

    def text(self, digits: Callable[[float], str]) -> str:
        """Text such as `0.0123 [0.0110, 0.0140]`; digits: formats a number."""
        if self.low is None or self.high is None:
            return digits(self.median)
        return f"{digits(self.median)} [{digits(self.low)}, {digits(self.high)}]"


def interval(values: Sequence[float] | NDArray[np.float64]) -> Interval | None:
    """Median and bootstrap confidence interval (fixed seed) of the values that are not NaN; None if there are none."""
    array = np.asarray(values, dtype=float)
    array = array[~np.isnan(array)]
    if not len(array):
        return None
    if len(array) == 1:
        return Interval(float(array[0]))
    draws = np.random.default_rng(0).choice(array, (_BOOTSTRAPS, len(array)))
    low, high = np.percentile(np.median(draws, axis=1), [2.5, 97.5])
    return Interval(float(np.median(array)), float(low), float(high), float(array.min()), float(array.max()))
