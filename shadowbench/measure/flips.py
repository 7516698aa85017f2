"""Pixels that change sides from frame to frame where the truth does not: shadows that crawl or swim."""

import itertools
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter, minimum_filter

from shadowbench.truths.trace import Truth

EDGE = 2  # pixels around a true edge in which flips are looked for


def flips(masks: Sequence[NDArray[np.float32]], truths: Sequence[Truth]) -> float | None:
    """The largest share of edge receivers, over pairs of frames, that change sides where the truth stays.

    masks: (N, N) visibility of each frame. Pixels count that receive, are decided and lie within EDGE pixels of a true
    edge in both frames; None without any. Of all receivers the share would tell how long the edges are.
    """
    shares = []
    for (before, was), (after, now) in itertools.pairwise(zip(masks, truths, strict=True)):
        steady = was.receivers & now.receivers & ~was.undecided & ~now.undecided & (was.visibility == now.visibility)
        steady &= _near_edge(was) & _near_edge(now)
        if steady.any():
            shares.append(float(((before < 0.5) != (after < 0.5))[steady].mean()))
    return max(shares, default=None)


def _near_edge(truth: Truth) -> NDArray[np.bool_]:
    width = 2 * EDGE + 1
    near: NDArray[np.bool_] = maximum_filter(truth.visibility, width) != minimum_filter(truth.visibility, width)
    return near
