"""Scores of a sequence of masks against that of its truths: flicker, false change, pops, swimming edges, lag."""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from shadowbench.scores.comparison import Comparison, PreparedTruth
from shadowbench.scores.masks import Single
from shadowbench.scores.metrics import Metric


class Seen(NamedTuple):
    """The N points of surfaces that are followed through a frame: those kept from the frame before, then new ones.

    kept: (K,) int32, their places among the points of the frame before; pixel: (N,) int32 of the nearest pixel, row by
    row; right, below: (N,) int32 steps to the other pixels around the point, 0 if it is at a centre; read: (N,) bool,
    whether all these pixels are decided receivers of the point's surface. still: neither light nor geometry has moved.
    """

    kept: NDArray[np.int32]
    pixel: NDArray[np.int32]
    right: NDArray[np.int32]
    below: NDArray[np.int32]
    read: NDArray[np.bool_]
    still: bool


class Motion:
    """Scores of a sequence of masks, frame by frame; it keeps numbers of the points seen last, never a frame."""

    def add(self, mask: Single, truth: PreparedTruth, seen: Seen) -> None:
        """The next frame. Raises ValueError as `quantise` does, and for a shape other than the truth's."""
        raise NotImplementedError

    def scores(self) -> dict[str, float | None]:
        """Values of `MOTION` by name, and `pop_frame`, of the frames so far."""
        raise NotImplementedError

    def curves(self) -> dict[str, list[float]]:
        """Numbers by frame, 0 in the first: `flicker`, `pop` (px)."""
        raise NotImplementedError


def _of_one_mask(comparison: Comparison) -> None:
    """One mask has no motion."""


MOTION: Mapping[str, Metric] = {
    name: Metric(name, _of_one_mask, better, kind, help)
    for name, better, kind, help in (
        ("flicker", "lower", "both", ""),
        ("false_change", "lower", "both", ""),
        ("pop", "lower", "both", ""),
        ("swim", "lower", "both", ""),
        ("lag", "near 0", "both", ""),
        ("lag_bias", "near 0", "both", ""),
    )
}  # type: ignore[arg-type]
