"""Truths of scenes that are traced as Embree instances, in comparison with the same scenes expanded."""

from dataclasses import replace

import numpy as np
import pytest

from shadowbench.measure.scoring import mask_record, positions, prepare_truth
from shadowbench.scenes.model import Scene, view_of
from shadowbench.truths.trace import Truth, trace


def truths(scenes: tuple[Scene, Scene], light: str, size: int = 256, **changes: float) -> tuple[Truth, Truth]:
    (lit,) = (each for each in scenes[0].lights if each.name == light)
    return tuple(trace(view_of(scene, scene.cameras[0], replace(lit, **changes), size), 2) for scene in scenes)


@pytest.mark.parametrize("light", ["sun", "low", "lamp", "close", "spot"])
def test_no_decided_pixel_differs(crowd_scenes, light: str) -> None:
    flat, shared = truths(crowd_scenes, light)
    decided = ~(flat.undecided | shared.undecided)
    assert decided[flat.receivers].mean() > 0.99
    for name in ("visibility", "receivers", "facet_shadow"):
        assert not (getattr(flat, name) != getattr(shared, name))[decided].any(), name
    assert shared.undecided.sum() <= 1.5 * flat.undecided.sum() + 10
    assert shared.cosine[decided] == pytest.approx(flat.cosine[decided], abs=1e-6)
    same = np.isfinite(flat.blocker) & decided
    assert same.any() and shared.blocker[same] == pytest.approx(flat.blocker[same], abs=1e-5 * flat.diagonal)


def test_soft_shadows_agree_within_their_error(crowd_scenes) -> None:
    flat, shared = truths(crowd_scenes, "sun", 64, radius=0.02)
    apart = np.abs(flat.visibility - shared.visibility)
    error = np.hypot(flat.standard_error, shared.standard_error)
    assert (flat.standard_error > 0).sum() > 50
    assert (apart <= 5 * error + 1e-6)[~(flat.undecided | shared.undecided)].all()


def test_masks_score_the_same(crowd_scenes) -> None:
    flat, shared = truths(crowd_scenes, "sun")
    assert np.array_equal(positions(shared.view, flat.triangle), positions(flat.view, flat.triangle))
    same = replace(shared, **{name: values for name, values in flat.arrays().items() if name != "diagonal"})
    mask = np.roll(flat.visibility, 2, axis=1)
    first, second = (mask_record(mask, truth, prepare_truth(truth))["metrics"] for truth in (flat, same))
    assert first == second and first["iou"] < 0.99
