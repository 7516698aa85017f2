import math
from functools import partial

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from shadowbench.scores import METRICS, score

seeds = st.integers(0, 2**32 - 1)
SIZE = 40
OF_PENUMBRAE = {"rmse_pen", "bias_pen", "noise", "banding", "width", "hardening", "hardening_intercept"}
NONE = OF_PENUMBRAE | {"terminator"}  # of flat surfaces and hard shadows
"""Metrics that a truth without a penumbra leaves undefined."""


def random_view(rng):
    """A shadow of random blobs with holes in the receivers, undecided pixels, and a noisy mask of it."""
    y, x = np.mgrid[:SIZE, :SIZE]
    centres, radii = rng.uniform(0, SIZE, (3, 2)), rng.uniform(4, 15, 3)
    shadow = np.any([(y - cy) ** 2 + (x - cx) ** 2 < r**2 for (cy, cx), r in zip(centres, radii, strict=True)], axis=0)
    view = {
        "visibility": 1.0 - shadow,
        "receivers": (y > rng.integers(0, 10)) & (rng.random((SIZE, SIZE)) < 0.97),
        "undecided": rng.random((SIZE, SIZE)) < 0.003,
        "area": np.clip(1.0 - shadow + rng.normal(0, 0.1, (SIZE, SIZE)), 0, 1),
        "blocker": np.where(shadow, rng.uniform(0, 0.5, (SIZE, SIZE)), np.inf),
        "cosine": rng.random((SIZE, SIZE)),
    }
    mask = np.clip(np.roll(1.0 - shadow, rng.integers(-2, 3), 1) + rng.normal(0, 0.2, (SIZE, SIZE)), 0, 1)
    return mask, view


def test_in_a_view_of_few_pixels_every_metric_is_a_number_or_none(truth):
    """Also where all is lit, in shadow or in penumbra; no penumbra is wide enough for a width."""
    for size, soft in [(1, True), (2, False), (5, True), (9, False)]:
        y, x = np.mgrid[:size, :size].astype(float)
        ramp = np.clip((x - size / 2) / 3 + 0.5, 0, 1) if soft else (x >= size / 2) * 1.0
        flat = [np.zeros((size, size)), np.ones((size, size)), *([np.full((size, size), 0.5)] if soft else [])]
        positions = {"positions": partial(np.stack, [x, 0 * x, y], axis=-1)} if soft else {}
        for exact in (ramp, ramp.T, *flat):
            prepared = truth(exact, **positions)
            for mask in (exact, 1 - exact, ramp, *flat):
                found = score(mask, prepared)
                assert list(found) == list(METRICS)
                assert all(value is None or math.isfinite(value) for value in found.values())
                assert found["width"] is found["hardening"] is found["hardening_intercept"] is None


def test_every_metric_has_a_row_that_explains_it():
    assert list(METRICS) == [
        *("iou", "iou_soft", "boundary_iou", "ssim", "ssim_edge", "mae", "mae_area", "mae_lit"),
        *("acne", "acne_soft", "leak", "contact", "terminator", "edge_px", "edge_p95"),
        *("rmse", "rmse_pen", "bias_pen", "bleed", "false_dark", "noise", "banding"),
        *("width", "hardening", "hardening_intercept"),
    ]
    for name, metric in METRICS.items():
        assert metric.name == name
        assert metric.kind == "soft" or name not in OF_PENUMBRAE
        assert metric.help.endswith(".")
    assert "Large lit areas raise it, and it prefers a displaced edge to a blurred one" in METRICS["ssim"].help
    assert (METRICS["iou"].error_label, METRICS["iou"].error(0.75)) == ("1 − IoU", 0.25)
    assert (METRICS["rmse"].error_label, METRICS["rmse"].error(0.75)) == ("RMSE", 0.75)


def test_a_value_below_the_truths_own_error_is_printed_as_that():
    fields = {"truth_error": 0.002, "truth_error_pen": 0.004}
    shown = [METRICS["rmse"].text(value, str, fields) for value in (0.001, 0.002, 0.003, None)]
    assert shown == ["<0.002", "0.002", "0.003", "–"]
    assert METRICS["rmse_pen"].text(0.003, str, fields) == "<0.004"
    assert METRICS["iou"].text(0.001, str, fields) == METRICS["rmse"].text(0.001, str, {}) == "0.001"


def test_a_change_for_the_worse_leads_away_from_the_ideal():
    for name, before, after, worse in [
        ("iou", 0.75, 0.5, 0.25),
        ("mae", 0.5, 0.75, 0.25),
        ("bias_pen", -0.25, 0.25, 0),
        ("bias_pen", 0.25, -0.5, 0.25),
        ("hardening", 0.5, 1.5, 0),
        ("hardening", 1.25, 0.5, 0.25),
    ]:
        assert METRICS[name].worse(before, after) == worse
        assert METRICS[name].worse(after, before) == -worse


def test_the_truth_itself_gets_the_best_value_of_every_metric(truth, disc):
    scores = score(disc(30), truth(disc(30), blocker=np.zeros((128, 128))))
    for name, metric in METRICS.items():
        best = 1 if metric.better == "higher" else 0
        assert scores[name] == (None if name in NONE else best), name


def test_a_worse_mask_never_scores_better(truth, half_plane):
    """The shadow retreats from its occluder, and acne of the same area spreads over the lit side."""
    prepared = truth(half_plane(64), blocker=np.where(half_plane(64) < 0.5, 0.1, np.inf))
    noise = np.random.default_rng(5).random((128, 128))

    def mask(amount):
        return np.where((half_plane(64) == 1) & (noise < amount / 200), 0, half_plane(64 - amount))

    scores = [score(mask(amount), prepared) for amount in (0, 1, 2, 4, 8, 16)]
    for name in METRICS.keys() - NONE:
        values = [each[name] for each in scores]
        assert values == sorted(values, reverse=METRICS[name].better == "higher"), name
        assert values[-1] != values[0], name


def test_a_straight_edge_that_moved_by_k_pixels(truth, half_plane):
    for k, turn in [(-20, np.asarray), (-1, np.transpose), (2, np.asarray), (30, np.transpose)]:
        scores = score(turn(half_plane(64 + k)), truth(turn(half_plane(64))))
        assert scores["edge_px"] == scores["edge_p95"] == abs(k)
        assert scores["iou"] == scores["iou_soft"] == (64 + min(k, 0)) / (64 + max(k, 0))
        assert scores["mae"] == abs(k) / 128
        width = 4  # 2% of 128 √2 is 3.6
        assert scores["boundary_iou"] == max(width - abs(k), 0) / min(width + abs(k), 2 * width)


def test_partial_acne_shows_in_the_soft_scores_only(truth, half_plane):
    mask = np.where(half_plane(64) == 1, 0.6, 0)
    scores = score(mask, truth(half_plane(64)))
    assert scores["acne"] == 0
    assert scores["acne_soft"] == pytest.approx(0.4, abs=1e-5)
    assert scores["iou"] == 1
    assert scores["mae"] == pytest.approx(0.2, abs=1e-5)
    assert scores["iou_soft"] == pytest.approx(64 / (64 + 64 * 0.4), abs=1e-5)


def test_errors_beside_an_edge_are_neither_acne_nor_leak(truth, half_plane):
    for k in (-3, 3):
        scores = score(half_plane(64 + k), truth(half_plane(64)))
        assert scores["acne"] == scores["leak"] == 0
    assert score(half_plane(3), truth(half_plane(3)))["leak"] is None  # too thin for an interior
    assert score(half_plane(68), truth(half_plane(64)))["acne"] == 1 / 61
    assert score(half_plane(60), truth(half_plane(64)))["leak"] == 1 / 61


def test_peter_panning_is_light_where_the_occluder_touches(truth, half_plane):
    blocker = np.where(half_plane(64) < 0.5, np.arange(128) * 0.01, np.inf)  # nearer than 0.2: columns 0 to 19
    mask = half_plane(64)
    mask[:, :5] = 1
    assert score(mask, truth(half_plane(64), blocker=blocker))["contact"] == 5 / 20


def test_a_correct_filter_is_not_punished_by_mae_area(truth, half_plane):
    area = half_plane(64)
    area[:, 63:65] = [0.25, 0.75]
    scores = score(area, truth(half_plane(64), area=area))
    assert scores["mae_area"] == 0
    assert scores["mae"] > 0
    assert score(half_plane(64), truth(half_plane(64), area=area))["mae_area"] == pytest.approx(0.5 / 128, rel=1e-4)


def test_mae_lit_counts_by_the_cosine(truth, half_plane):
    cosine = np.where(np.arange(128) < 64, 0.25, 0.75) * np.ones((128, 1))
    mask = half_plane(64)
    mask[:, :32] = 1
    assert score(mask, truth(half_plane(64), cosine=cosine))["mae_lit"] == pytest.approx(32 * 0.25 / 64)


def test_the_95th_percentile_of_known_distances(truth):
    """A hundred shadows of one pixel, each moved along its row: 94 by 1 pixel, 2 by 2 and 4 by 3."""
    moved = np.random.default_rng(3).permutation(np.repeat([1, 2, 3], [94, 2, 4]))
    rows, columns = (index.ravel() * 12 + 4 for index in np.indices((10, 10)))
    still, mask = np.ones((128, 128)), np.ones((128, 128))
    still[rows, columns] = 0
    mask[rows, columns + moved] = 0
    scores = score(mask, truth(still))
    assert scores["edge_p95"] == 2  # 94% of the distances are 1, 96% at most 2
    assert scores["edge_px"] == pytest.approx(moved.mean())


@given(seeds)
def test_excluded_pixels_never_matter(truth, seed):
    """Neither of the mask nor of the truth."""
    rng = np.random.default_rng(seed)
    mask, view = random_view(rng)
    valid = truth(**view).valid
    changed = np.where(valid, mask, rng.random(mask.shape))
    other = {
        name: np.where(valid, view[name], rng.random(mask.shape))
        for name in ("visibility", "area", "cosine", "blocker")
    }
    assert score(changed, truth(**view | other)) == score(mask, truth(**view))


@pytest.mark.parametrize("turn", [np.flipud, np.rot90])
@given(seed=seeds)
def test_turning_both_images_changes_no_score(truth, turn, seed):
    mask, view = random_view(np.random.default_rng(seed))
    turned = {name: turn(array) for name, array in view.items()}
    before, after = score(mask, truth(**view)), score(turn(mask), truth(**turned))
    for name in METRICS:
        assert after[name] == (None if before[name] is None else pytest.approx(before[name], abs=1e-6)), name


def nulls(scores):
    return {name for name, value in scores.items() if value is None}


def test_a_metric_whose_denominator_is_empty_is_none(truth, disc):
    lit, dark = np.ones((128, 128)), np.zeros((128, 128))
    of_shadows = {"iou", "iou_soft", "boundary_iou", "ssim_edge", "leak", "contact", "edge_px", "edge_p95", "bleed"}
    of_light = {"boundary_iou", "ssim_edge", "acne", "acne_soft", "contact", "edge_px", "edge_p95", "false_dark"}
    assert nulls(score(lit, truth(lit))) == of_shadows | NONE
    assert nulls(score(dark, truth(dark))) == of_light | NONE
    assert nulls(score(lit, truth(dark, receivers=dark > 0))) == set(METRICS)
    only_drawn = score(disc(20), truth(lit))
    assert nulls(only_drawn) == {"ssim_edge", "leak", "contact", "bleed"} | NONE
    assert only_drawn["iou"] == only_drawn["boundary_iou"] == 0
    assert only_drawn["edge_px"] == math.hypot(128, 128)


def test_a_mask_of_another_size_and_nan_even_where_it_is_not_scored_are_refused(truth):
    """NaN indicates a broken shader at any pixel."""
    with pytest.raises(ValueError, match=r"shape \(4, 5\); allowed: the truth's \(4, 4\)"):
        score(np.ones((4, 5)), truth(np.ones((4, 4))))
    with pytest.raises(ValueError, match="NaN or infinite in 1"):
        score([[1, np.nan]], truth([[1, 1]], receivers=np.array([[True, False]])))


def test_dark_facets_count_by_the_light_that_they_take(truth):
    facets, cosine = np.zeros((32, 32), bool), np.full((32, 32), 0.5)
    facets[:8] = True
    cosine[:8] = 0.25
    exact = np.where(facets, 0.0, 1.0)
    prepared = truth(exact, facet_shadow=facets, shading_cosine=cosine, receivers=~facets)
    assert score(exact, prepared)["terminator"] == pytest.approx(8 * 0.25 / (8 * 0.25 + 24 * 0.5))
    assert score(np.where(facets, 0.5, 1.0), prepared)["terminator"] == pytest.approx(4 * 0.25 / 14, rel=1e-4)
    assert score(np.ones((32, 32)), prepared)["terminator"] == 0
