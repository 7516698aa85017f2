"""Scoring a mask of any renderer against a truth; needs no GL."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from shadowbench.scores.masks import mask_sha256
from shadowbench.scores.metrics import score
from shadowbench.scores.prepared import PreparedTruth
from shadowbench.truths.trace import Truth


def prepare_truth(truth: Truth) -> PreparedTruth:
    """Truth as the input of metrics."""
    return PreparedTruth(
        visibility=truth.visibility,
        receivers=truth.receivers,
        undecided=truth.undecided,
        area=truth.area,
        blocker=truth.blocker,
        cosine=truth.cosine,
        diagonal=truth.diagonal,
    )


def mask_record(
    visibility: NDArray[np.float32], truth: Truth, prepared: PreparedTruth, surface: NDArray[np.int32] | None = None
) -> dict[str, Any]:
    """Fields of a score record that describe a mask: metrics, digest and pixel counts.

    visibility: (N, N), quantised to 16 bits; prepared: `prepare_truth(truth)`, shared by many masks; surface: (N, N)
    triangle ids of the G-buffer that the mask was drawn over, None if there is none. Row 0 is at the top.
    """
    record: dict[str, Any] = {
        "metrics": score(visibility, prepared),
        "receivers": int(truth.receivers.sum()),
        "undecided": int((truth.receivers & truth.undecided).sum()),
        "mask_sha256": mask_sha256(visibility),
    }
    if surface is not None:
        decided = truth.receivers & ~truth.undecided
        record["surface_mismatch"] = int((decided & (surface != truth.triangle)).sum())
    return record
