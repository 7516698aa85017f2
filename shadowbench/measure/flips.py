"""Temporal stability: pixels that flip between lit and shadowed from frame to frame while the truth does not."""

import itertools
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter, minimum_filter

from shadowbench.truths.trace import Truth

EDGE = 2  # pixels around a true edge in which flips are counted


def flips(masks: Sequence[NDArray[np.float32]], truths: Sequence[Truth]) -> float | None:
    """Largest share, over pairs of frames, of edge pixels that flip between lit and shadowed while the truth does not.

    masks: (N, N) visibility of each frame. Edge pixels are decided receivers within EDGE pixels of a true edge in both
    frames; None if there are none. A share of all receivers would depend on the length of the edges.
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
