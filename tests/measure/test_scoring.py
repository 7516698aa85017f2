"""Scoring of a mask against a truth, with counts for a truth made by hand; without GL."""

import numpy as np

from shadowbench.measure.scoring import mask_record, prepare_truth
from shadowbench.scores.masks import mask_sha256
from shadowbench.scores.metrics import METRICS
from shadowbench.truths.trace import Truth

SIDE = 16


def truth() -> Truth:
    """The left half in shadow; the top row is no receiver, the bottom row is undecided."""
    visibility = np.ones((SIDE, SIDE), np.float32)
    visibility[1:, : SIDE // 2] = 0
    receivers = np.ones((SIDE, SIDE), bool)
    receivers[0] = False
    undecided = np.zeros((SIDE, SIDE), bool)
    undecided[-1] = True
    undecided[0, 0] = True  # outside the receivers, where it counts for nothing
    return Truth(
        visibility=visibility,
        standard_error=np.zeros_like(visibility),
        irradiance=visibility,
        receivers=receivers,
        undecided=undecided,
        area=visibility,
        blocker=np.where(visibility < 1, np.float32(1), np.float32(np.inf)),
        triangle=np.arange(SIDE * SIDE, dtype=np.int32).reshape(SIDE, SIDE),
        cosine=receivers.astype(np.float32),
        diagonal=10.0,
    )


def test_a_mask_is_scored_where_receivers_are_decided() -> None:
    true = truth()
    mask = np.ones((SIDE, SIDE), np.float32)
    mask[1:, : SIDE // 4] = 0  # half of the shadow
    mask[-1, SIDE // 2 :] = 0  # nobody can say that it is wrong
    record = mask_record(mask, true, prepare_truth(true))
    assert list(record["metrics"]) == list(METRICS)
    assert record["metrics"]["iou"] == 0.5
    assert (record["receivers"], record["undecided"]) == (SIDE * (SIDE - 1), SIDE)
    assert record["mask_sha256"] == mask_sha256(mask)


def test_surfaces_are_compared_where_there_is_one_and_receivers_are_decided() -> None:
    true = truth()
    prepared = prepare_truth(true)
    surface = true.triangle.copy()
    assert mask_record(true.visibility, true, prepared, surface)["surface_mismatch"] == 0
    surface[0], surface[-1] = -1, -1
    assert mask_record(true.visibility, true, prepared, surface)["surface_mismatch"] == 0
    surface[3, 4:7] = -1
    assert mask_record(true.visibility, true, prepared, surface)["surface_mismatch"] == 3
    assert "surface_mismatch" not in mask_record(true.visibility, true, prepared)
