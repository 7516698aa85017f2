"""Scores against a traced soft truth: a slab 1 m above a floor, below a wide sun at the zenith."""

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from scipy import ndimage

from shadowbench.measure.scoring import mask_record, positions, prepare_truth
from shadowbench.scenes.model import Camera, Light, Mesh, Scene, View, view_of
from shadowbench.scores.comparison import PreparedTruth
from shadowbench.truths.trace import Truth, trace

HEIGHT, HALF_ANGLE, SIZE = 1.0, math.radians(8.0), 160


@pytest.fixture(scope="module")
def view(shape: Callable[..., Mesh]) -> View:
    """Three edges of the slab's shadow are seen, below and beside it."""
    meshes = (shape("box", (12.0, 0.1, 12.0), (0, -0.05, 0)), shape("box", (1.5, 1e-3, 1.5), (0, HEIGHT, 0)))
    camera = Camera("camera", (3.5, 3.5, 1.5), (0.0, 0.0, 0.0), math.radians(32.0))
    light = Light("sun", "directional", (0.0, -1.0, 0.0), radius=HALF_ANGLE)
    scene = Scene("slab", meshes, (camera,), (light,))
    return view_of(scene, camera, light, SIZE)


@pytest.fixture(scope="module")
def soft(view: View) -> Truth:
    return trace(view, pixel_samples=1)


@pytest.fixture(scope="module")
def prepared(soft: Truth) -> PreparedTruth:
    return prepare_truth(soft)


@pytest.fixture(scope="module")
def hard(view: View) -> Truth:
    return trace(replace(view, light=replace(view.light, radius=0.0)), pixel_samples=1)


def test_positions_lie_on_the_surfaces_that_are_seen(view: View, soft: Truth) -> None:
    points = positions(view, soft.triangle)
    height = points[..., 1] + view.camera.position[1]
    floor_top = view.scene.geometry.normals[soft.triangle][..., 1] > 0.99
    on_floor = floor_top & (np.abs(height) < 1e-9)
    on_slab = floor_top & (np.abs(height - HEIGHT - 5e-4) < 1e-9)
    assert (on_floor | on_slab)[floor_top & (soft.triangle >= 0)].all()
    assert on_floor.sum() > SIZE**2 / 4 and on_slab.sum() > 500
    ahead = np.subtract(view.camera.target, view.camera.position)
    middle = points[SIZE // 2 - 1 : SIZE // 2 + 1, SIZE // 2 - 1 : SIZE // 2 + 1].mean((0, 1))
    np.testing.assert_allclose(np.cross(middle, ahead), 0, atol=0.02 * np.linalg.norm(middle) * np.linalg.norm(ahead))


def test_a_penumbra_below_the_zenith_is_as_wide_as_the_sun_at_that_height(prepared: PreparedTruth) -> None:
    """2 d tan α; from 0.1 to 0.9, 0.687 of it, in whichever direction the edge runs."""
    across = prepared.crossings
    assert across is not None and len(across.width) > 60
    expected = 0.687 * 2 * HEIGHT * math.tan(HALF_ANGLE)
    assert np.median(across.width) == pytest.approx(expected, rel=0.02)
    assert np.percentile(across.width, 10) == pytest.approx(expected, rel=0.03)
    assert np.percentile(across.width, 90) == pytest.approx(expected, rel=0.1), "wider at the corners"


def test_a_row_of_a_soft_truth_says_how_well_it_is_known(soft: Truth, prepared: PreparedTruth) -> None:
    record = mask_record(soft.visibility, soft, prepared)
    scored = soft.receivers & ~soft.undecided
    partly = (soft.visibility > 0) & (soft.visibility < 1)
    assert record["truth_error"] == pytest.approx(math.sqrt(np.mean((soft.standard_error * partly)[scored] ** 2.0)))
    assert record["truth_error"] < record["truth_error_pen"] < 1 / 255
    assert record["penumbra"] == np.count_nonzero(prepared.penumbra) > 500
    assert 0.5 < record["width_share"] <= 1
    metrics = record["metrics"]
    assert metrics["rmse"] == metrics["noise"] == metrics["width"] == metrics["acne_soft"] == record["width_bias"] == 0
    sharper = mask_record(np.clip((soft.visibility - 0.5) * 2 + 0.5, 0, 1), soft, prepared)
    assert sharper["width_bias"] == pytest.approx(-sharper["metrics"]["width"], rel=0.1)
    assert sharper["width_bias"] < -0.5, "too narrow"


def test_a_hard_mask_is_wrong_in_the_penumbra_and_a_better_blur_less_so(
    soft: Truth, hard: Truth, prepared: PreparedTruth
) -> None:
    masks = [hard.visibility, *(ndimage.gaussian_filter(hard.visibility, sigma) for sigma in (1.0, 2.0))]
    scores = [mask_record(mask, soft, prepared)["metrics"] for mask in masks]
    for name in ("rmse", "rmse_pen", "width", "noise"):
        values = [metrics[name] for metrics in scores]
        assert values == sorted(values, reverse=True) and values[0] > values[-1] > 0, name
    assert all(abs(metrics["bias_pen"]) < 0.03 for metrics in scores)
    assert scores[0]["iou"] > 0.95, "IoU sees where the middle of the edge lies, not its width"


def test_samples_of_the_light_have_the_noise_of_their_number(soft: Truth, prepared: PreparedTruth) -> None:
    """A binomial mask of 16 samples, whose variance is V (1 − V)/16."""
    mask = np.random.default_rng(0).binomial(16, soft.visibility) / 16
    expected = math.sqrt(np.mean((soft.visibility * (1 - soft.visibility) / 16)[prepared.penumbra]))
    metrics = mask_record(mask, soft, prepared)["metrics"]
    assert metrics["rmse_pen"] == pytest.approx(expected, rel=0.1)
    assert metrics["noise"] == pytest.approx(expected, rel=0.2)
    assert metrics["width"] < 0.2
