"""Scores of masks in motion (stub, until the branch of the scores is merged)."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from shadowbench.scores.comparison import Comparison
from shadowbench.scores.metrics import Metric


def _of_one_mask(comparison: Comparison) -> None:
    """One mask does not move."""


MOTION: Mapping[str, Metric] = {
    name: Metric(name, _of_one_mask, "lower", "both", f"{name}.")
    for name in ("flicker", "false_change", "pop", "swim", "lag")
}


def motion_scores(frames: Sequence[tuple[NDArray[np.float32], Any]]) -> dict[str, Any]:
    """Stub: share of valid pixels that change though the truth does not."""
    changes = []
    before = frames[0]
    for index in range(1, len(frames)):
        now = frames[index]
        still = before[1].receivers & now[1].receivers & (before[1].visibility == now[1].visibility)
        changes.append(float(((before[0] < 0.5) != (now[0] < 0.5))[still].mean()) if still.any() else None)
        before = now
    known = [one for one in changes if one is not None]
    mean = sum(known) / len(known) if known else None
    values = dict.fromkeys(("false_change", "pop", "pop_frame", "swim", "lag")) | {"flicker": mean}
    return values | {"by_frame": {"flicker": [None, *changes]}}
