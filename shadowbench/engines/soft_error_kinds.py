"""Kinds of error of a soft shadow, with the pixels that each is about."""

from collections.abc import Mapping

import numpy as np

from shadowbench.engines.error_kinds import ErrorKind
from shadowbench.scores.comparison import Comparison
from shadowbench.scores.soft_faults import soft_faults


def soft_error_kinds(comparison: Comparison, metrics: Mapping[str, float | None]) -> list[ErrorKind]:
    """Kinds of error of a soft shadow that stand out: in the penumbra, its width, umbra and full light.

    Causes first, then the largest sum of squared errors. `pixels` of a kind is the size of the region that it is a mean
    over. metrics: values of `score` for the same comparison, whose truth has a penumbra.
    """
    truth, across, drawn = comparison.truth, comparison.truth.crossings, comparison.penumbra_widths
    wider = None
    if metrics["width"] is not None and across is not None and drawn is not None:
        wider = float(np.median(np.log2(drawn / across.width)))
    kinds = []
    for fault in soft_faults(metrics, wider):
        pixels = int(np.count_nonzero(getattr(truth, fault.region)))
        squares = np.inf if fault.error is None else pixels * fault.error**2
        kinds.append((squares, ErrorKind(fault.name, pixels, fault.line)))
    return [kind for _, kind in sorted(kinds, key=lambda kind: -kind[0])]
