"""Metrics of soft shadows: functions of a Comparison, listed in `metrics`.

The truth of a soft shadow is sampled: its mean variance is taken off squared errors.
"""

import math

import numpy as np
from scipy import ndimage

from shadowbench.scores.comparison import Comparison
from shadowbench.scores.isolines import step_squared
from shadowbench.scores.prepared import PENUMBRA
from shadowbench.scores.sums import mean, root_mean, share
from shadowbench.scores.widths import FEWEST

FLAT_STEP = 0.1  # share of the truth's step, and of the mask's own nearby, below which a mask is flat
NEARBY_PX = 8  # along rows and columns, how far a flat step may be from the edge to the next
RESOLVED_STEP = 2.0  # standard errors above which a step of the truth is one


def rmse(comparison: Comparison) -> float | None:
    """Root mean square error over receivers, the truth's error taken off."""
    prepared = comparison.truth
    return root_mean(comparison.signed_error**2, prepared.valid, prepared.mean_variance)


def rmse_pen(comparison: Comparison) -> float | None:
    """Root mean square error over the penumbra, the truth's error taken off."""
    prepared = comparison.truth
    return root_mean(comparison.signed_error**2, prepared.penumbra, prepared.mean_variance_pen)


def bias_pen(comparison: Comparison) -> float | None:
    """Mean signed error over the penumbra."""
    return mean(comparison.signed_error, comparison.truth.penumbra)


def bleed(comparison: Comparison) -> float | None:
    """Mean visibility of the umbra."""
    return mean(comparison.visibility, comparison.truth.umbra)


def false_dark(comparison: Comparison) -> float | None:
    """Mean darkness (1 − visibility) of full light."""
    return mean(1 - comparison.visibility, comparison.truth.full_light)


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
    grey = (mask > PENUMBRA[0]) & (mask < PENUMBRA[1])
    step, true_step = step_squared(mask, prepared.valid), prepared.step_squared
    resolved = true_step > RESOLVED_STEP**2 * prepared.standard_error**2
    nearby = ndimage.maximum_filter(np.where(prepared.penumbra, step, 0), 2 * NEARBY_PX + 1, mode="nearest")
    flat = step < FLAT_STEP**2 * np.minimum(true_step, nearby)
    return share(grey & resolved & flat, prepared.penumbra)


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
