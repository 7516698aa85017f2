"""Metrics of soft shadows: functions of a Comparison, listed in `metrics`.

The truth of a soft shadow is sampled: its mean variance is taken off squared errors.
"""

import math

import numpy as np
from numpy.typing import NDArray

from shadowbench.scores.comparison import Comparison
from shadowbench.scores.isolines import step_squared
from shadowbench.scores.prepared import PENUMBRA
from shadowbench.scores.sums import mean, mean_of, share
from shadowbench.scores.widths import FEWEST

FLAT_STEP = 0.1  # share of the truth's step, and of the mask's own nearby, below which a mask is flat
NEARBY_PX = 8  # along rows and columns, how far a flat step may be from the edge to the next


def rmse(comparison: Comparison) -> float | None:
    """Root mean square error over receivers, the truth's error taken off."""
    return _rmse(comparison, comparison.truth.valid, comparison.truth.mean_variance)


def rmse_pen(comparison: Comparison) -> float | None:
    """Root mean square error over the penumbra, the truth's error taken off."""
    return _rmse(comparison, comparison.truth.penumbra, comparison.truth.mean_variance_pen)


def _rmse(comparison: Comparison, where: NDArray[np.bool_], variance: float) -> float | None:
    """Root of the mean squared error over a set of pixels less a known variance, at least 0; None if it is empty."""
    images = comparison.visibility, comparison.truth.visibility
    squared = mean_of(lambda mask, truth: (mask - truth) ** 2, where, *images)
    return None if squared is None else math.sqrt(max(squared - variance, 0.0))


def bias_pen(comparison: Comparison) -> float | None:
    """Mean signed error over the penumbra."""
    truth = comparison.truth
    return mean_of(np.subtract, truth.penumbra, comparison.visibility, truth.visibility)


def bleed(comparison: Comparison) -> float | None:
    """Mean visibility of the umbra."""
    return mean(comparison.visibility, comparison.truth.umbra)


def false_dark(comparison: Comparison) -> float | None:
    """Mean darkness (1 − visibility) of full light."""
    return mean_of(lambda mask: 1 - mask, comparison.truth.full_light, comparison.visibility)


def noise(comparison: Comparison) -> float | None:
    """Root mean square variation of the error along the truth's isolines, the truth's error taken off."""
    prepared = comparison.truth
    if not prepared.soft:
        return None
    variance = prepared.isolines.variance(comparison.signed_error, prepared.valid, prepared.variance)
    return None if variance is None else math.sqrt(max(variance, 0.0))


def banding(comparison: Comparison) -> float | None:
    """Share of the penumbra in which the mask is grey and flat, and neither the truth nor the mask nearby is.

    The mask's own step tells a staircase from a smooth ramp that is much wider than the truth's: that is nowhere as
    steep as the truth, but everywhere about as steep as nearby. (A Gaussian blur of an edge is an eighth as steep at
    visibility 0.02 as at its middle.)
    """
    prepared, mask = comparison.truth, comparison.visibility
    if not prepared.soft:
        return None
    from shadowbench.scores import loops

    step, true_step = step_squared(mask, prepared.valid), prepared.step_squared
    steepest = loops.greatest(np.where(prepared.penumbra, step, 0), NEARBY_PX)
    np.minimum(true_step, steepest, out=steepest)
    flat = step < np.multiply(steepest, np.float32(FLAT_STEP**2), out=steepest)
    grey = (mask > PENUMBRA[0]) & (mask < PENUMBRA[1])
    return share(grey & prepared.resolved & flat, prepared.penumbra)


def width(comparison: Comparison) -> float | None:
    """Median absolute log₂ of the ratio of the mask's widths of penumbrae to the truth's."""
    across, widths = comparison.truth.crossings, comparison.penumbra_widths
    if across is None or widths is None or len(widths) < FEWEST:
        return None
    return float(np.median(np.abs(np.log2(widths / across.width))))


def hardening(comparison: Comparison) -> float | None:
    """Slope of the mask's widths of penumbrae over the truth's; Theil 1950, Sen 1968."""
    fit = comparison.hardening
    return None if fit is None else fit[0]


def hardening_intercept(comparison: Comparison) -> float | None:
    """Intercept of the line whose slope is `hardening`, as a share of the truth's median width."""
    fit = comparison.hardening
    return None if fit is None else fit[1]
