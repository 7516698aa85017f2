"""Scores of masks in motion (stub, until the branch of the scores is merged)."""

from collections.abc import Mapping
from typing import Any, NamedTuple

from shadowbench.scores.comparison import Comparison, PreparedTruth
from shadowbench.scores.masks import Single
from shadowbench.scores.metrics import Metric


class Seen(NamedTuple):
    """Stub."""

    truth: Any


class Motion:
    """Stub: share of valid pixels that change though the truth does not."""

    def __init__(self) -> None:
        self._frames: list[Any] = []
        self._changes: list[float] = []

    def add(self, mask: Single, truth: PreparedTruth, seen: Seen) -> None:
        """The next frame."""
        if self._frames:
            before, was = self._frames[-1]
            still = was.valid & truth.valid & (was.visibility == truth.visibility)
            self._changes.append(float(((before < 0.5) != (mask < 0.5))[still].mean()) if still.any() else 0.0)
        self._frames = [(mask, truth)]

    def scores(self) -> dict[str, float | None]:
        """Values by name."""
        mean = sum(self._changes) / len(self._changes) if self._changes else None
        names = ("false_change", "pop", "pop_frame", "swim", "lag", "lag_bias")
        return {"flicker": mean, **dict.fromkeys(names)}

    def curves(self) -> dict[str, list[float]]:
        """Numbers by frame."""
        return {"flicker": [0.0, *self._changes]}


def _of_one_mask(comparison: Comparison) -> None:
    """One mask has no motion."""


MOTION: Mapping[str, Metric] = {
    name: Metric(name, _of_one_mask, "lower", "both", f"{name}.")
    for name in ("flicker", "false_change", "pop", "swim", "lag", "lag_bias")
}
