"""Metrics of penumbrae on truths whose scores are known in closed form.

A truth is a ramp of visibility, dark at the left, on a floor that is seen from above at 0.1 m a pixel.
"""

import math
from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from scipy import ndimage

from shadowbench.scores import METRICS, PreparedTruth, score
from shadowbench.scores.metrics import soft_faults

SIZE = 160
METRES = 0.1
Y, X = np.mgrid[:SIZE, :SIZE].astype(float)
DIAGONAL = (X + Y) / math.sqrt(2)

Scored = Callable[..., dict[str, float | None]]


def ramp(width: float | np.ndarray, middle: float = 80.0, across: np.ndarray = X) -> np.ndarray:
    """Visibility that rises from 0 to 1 over `width` pixels."""
    return np.clip((across - middle) / width + 0.5, 0, 1)


def floor(down: float = METRES, right: float = METRES) -> np.ndarray:
    return np.stack([X * right, 0 * X, Y * down], axis=-1)


@pytest.fixture(scope="session")
def prepared(truth: Callable[..., PreparedTruth]) -> Callable[..., PreparedTruth]:
    """A soft truth on the floor."""

    def build(visibility: np.ndarray, positions: np.ndarray | None = None, **given: np.ndarray) -> PreparedTruth:
        return truth(visibility, positions=lambda: floor() if positions is None else positions, **given)

    return build


@pytest.fixture(scope="session")
def scored(prepared: Callable[..., PreparedTruth]) -> Scored:
    """Scores of a mask against a soft truth."""
    return lambda mask, visibility, **given: score(mask, prepared(visibility, **given))


WEDGE = ramp(6 + Y / SIZE * 34)
"""A penumbra that widens from top to bottom."""


def test_the_truth_itself_has_no_error_and_hardens_as_it_should(scored) -> None:
    scores = scored(WEDGE, WEDGE)
    for name, metric in METRICS.items():
        if metric.kind != "hard" and name not in ("iou_soft", "ssim", "ssim_edge", "acne_soft"):
            assert scores[name] == pytest.approx(1 if metric.better == "near 1" else 0, abs=1e-6), name


def test_a_straight_penumbra_that_moved_by_k_pixels(scored) -> None:
    """Off by k/w on the ramp; P is the 19 columns above 0.02 and below 0.98 and two on either side."""
    for k in [-4, -1, 1, 3]:
        width = 20.0
        scores = scored(ramp(width, 80.0 + k), ramp(width))
        column = ramp(width, 80.0 + k)[0] - ramp(width)[0]
        inside = slice(71 - 2, 89 + 2 + 1)
        assert np.count_nonzero(column[inside]) >= 19
        assert scores["rmse_pen"] == pytest.approx(math.sqrt(np.mean(column[inside] ** 2)), abs=2e-5)
        assert scores["bias_pen"] == pytest.approx(np.mean(column[inside]), abs=2e-5)
        assert np.sign(scores["bias_pen"]) == -np.sign(k)
        assert scores["rmse"] == pytest.approx(math.sqrt(np.mean(column**2)), abs=2e-5)
        assert scores["bleed"] == scores["false_dark"] == 0
        assert scores["noise"] < 1e-6
        assert scores["width"] == pytest.approx(0, abs=1e-3)
        assert scores["hardening"] is scores["hardening_intercept"] is None  # of a single width


def test_umbra_and_full_light_keep_eight_pixels_from_the_rest(prepared) -> None:
    """The ramp is above 0.01 from column 71, below 0.99 up to 89."""
    undecided = (X == 20) & (Y == 100) | (X == 140) & (Y == 100)
    found = prepared(ramp(20), undecided=undecided)
    assert np.flatnonzero(found.umbra[5]).tolist() == list(range(63))
    assert np.flatnonzero(found.full_light[5]).tolist() == list(range(98, SIZE))
    assert np.flatnonzero(found.umbra[108]).tolist() == [*range(12), *range(29, 63)]
    assert np.flatnonzero(found.full_light[109]).tolist() == list(range(98, SIZE))
    assert np.flatnonzero(found.full_light[108]).tolist() == [*range(98, 132), *range(149, SIZE)]


def test_light_in_the_umbra_bleeds_and_darkness_in_full_light_is_false_but_not_a_blur_of_eight_pixels(scored) -> None:
    truth = ramp(20)  # dark up to column 70
    assert scored(np.where(truth < 0.01, 0.3, truth), truth)["bleed"] == pytest.approx(0.3, abs=1e-5)
    assert scored(np.where(truth > 0.99, 0.8, truth), truth)["false_dark"] == pytest.approx(0.2, abs=1e-5)
    near, far = scored(ramp(36), truth), scored(ramp(60), truth)
    assert near["bleed"] == near["false_dark"] == 0 < min(far["bleed"], far["false_dark"])


def noisy(amount: float, seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    """A ramp sampled with a known standard error, and that error."""
    exact = ramp(60)
    error = np.where((exact > 0.1) & (exact < 0.9), amount, 0)
    return exact + error * np.random.default_rng(seed).standard_normal(exact.shape), error


def test_the_error_of_the_truth_is_no_error_of_the_mask(scored) -> None:
    sampled, error = noisy(0.02)
    with_bars, without = (scored(ramp(60), sampled, standard_error=bars) for bars in (error, 0 * error))
    for name in ("rmse", "rmse_pen", "noise"):
        assert without[name] > 0.008, name
        assert with_bars[name] < 0.2 * without[name], name
    assert with_bars["width"] < 0.05
    assert with_bars["banding"] < 0.01


def test_the_error_bar_of_a_pixel_where_all_points_of_the_light_agree_is_a_bound_and_hides_no_error(scored) -> None:
    truth, wrong = ramp(20), ramp(20, 80.05)
    bars = np.where((truth == 0) | (truth == 1), 1 / 256, 0)
    exact, bounded = (scored(wrong, truth, standard_error=error) for error in (0 * bars, bars))
    assert 0.002 < exact["rmse_pen"] < 1 / 256
    assert {name: bounded[name] for name in ("rmse", "rmse_pen")} == {
        name: exact[name] for name in ("rmse", "rmse_pen")
    }


def test_noise_of_a_known_amplitude(scored) -> None:
    """Along a diagonal, samples lie between pixels, whose mean has less noise."""
    for across, low in [(X, 0.98), (DIAGONAL, 0.9)]:
        middle = float(across.mean())
        truth = 0.25 + 0.5 * ramp(400, middle, across)
        mask = truth + 0.1 * np.random.default_rng(1).choice([-1, 1], truth.shape)
        assert 0.1 * low < scored(mask, truth)["noise"] < 0.102


def test_a_smooth_error_around_pinholes_is_no_noise_and_dither_is_where_isolines_are_straight(scored) -> None:
    """Discs of light of a radius of 4 px, and a straight penumbra of 20 px at the right."""
    pinholes = ((X % 16 - 8) ** 2 + (Y % 16 - 8) ** 2 < 4**2) & (X < 96)
    truth = np.maximum(ndimage.gaussian_filter(pinholes.astype(float), 1.5), ramp(20, 130))
    blurred = ndimage.gaussian_filter(truth, 2.0)
    soft = (truth > 0.02) & (truth < 0.98)
    dithered = np.clip(truth + 0.1 * np.random.default_rng(1).choice([-1, 1], truth.shape) * soft, 0, 1)
    assert scored(blurred, truth)["rmse_pen"] > 0.08
    assert scored(blurred, truth)["noise"] < 0.01
    assert scored(dithered, truth)["noise"] > 0.06


def test_few_levels_are_bands_and_many_are_not(scored) -> None:
    truth = ramp(40)
    few = np.clip(np.round(truth * 4), 0, 4) / 4
    flat = np.flatnonzero([few[5, x - 1] == few[5, x + 1] and 0 < few[5, x] < 1 for x in range(1, SIZE - 1)])
    share = len(flat) / (2 * 2 + 39)  # of columns above 0.02 and below 0.98, and 2 px on either side
    assert scored(few, truth)["banding"] == pytest.approx(share, abs=1e-6)
    assert share > 0.4
    assert scored(np.round(truth * 40) / 40, truth)["banding"] == 0
    assert scored(truth, truth)["banding"] == 0
    assert scored((truth > 0.5).astype(float), truth)["banding"] == 0


def test_a_smooth_wide_ramp_has_no_bands_however_flat(scored) -> None:
    for wide in [60, 150, 1000, np.inf]:
        assert scored(ramp(wide), ramp(6))["banding"] == 0


def test_a_penumbra_of_twice_the_width_is_one_off(scored) -> None:
    for times, across in [(0.5, X), (0.75, DIAGONAL), (1.5, Y), (2.0, X)]:
        middle = float(across.mean())
        scores = scored(ramp(16 * times, middle, across), ramp(16, middle, across))
        assert scores["width"] == pytest.approx(abs(math.log2(times)), abs=0.04)


def test_without_positions_no_width_is_known(truth) -> None:
    scores = score(WEDGE, truth(WEDGE))
    assert {name for name in ("width", "hardening", "hardening_intercept", "noise") if scores[name] is None} == {
        "width",
        "hardening",
        "hardening_intercept",
    }


def test_a_blur_of_fixed_width_does_not_harden_and_half_the_width_hardens_by_half(scored) -> None:
    scores, half = scored(ramp(20), WEDGE), scored(ramp(0.5 * (6 + Y / SIZE * 34)), WEDGE)
    assert scores["hardening"] == pytest.approx(0, abs=0.02)
    median = 0.8 * (6 + 34 / 2)
    assert scores["hardening_intercept"] == pytest.approx(0.8 * 20 / median, rel=0.05)
    assert half["hardening"] == pytest.approx(0.5, abs=0.03)
    assert half["hardening_intercept"] == pytest.approx(0, abs=0.04)


def soft_view(rng: np.random.Generator) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """A round soft shadow with holes in the receivers, undecided pixels, a known error, and a shifted noisy mask."""
    side = 64
    y, x = np.mgrid[:side, :side].astype(float)
    width = rng.uniform(6, 14)
    exact = np.clip((np.hypot(x - rng.uniform(26, 38), y - rng.uniform(26, 38)) - 20) / width + 0.5, 0, 1)
    error = np.where((exact > 0) & (exact < 1), 0.004, 0)
    visibility = np.clip(exact + error * rng.standard_normal(exact.shape), 0, 1)
    view = {
        "visibility": visibility,
        "standard_error": error,
        "receivers": rng.random(exact.shape) < 0.995,
        "undecided": rng.random(exact.shape) < 0.0005,
        "area": visibility,
        "blocker": np.ones(exact.shape),
        "cosine": rng.random(exact.shape),
        "floor": np.stack([x * METRES, 0 * x, y * METRES], axis=-1),
    }
    mask = np.clip(np.roll(exact, 1, 1) * rng.uniform(0.9, 1) + rng.normal(0, 0.02, exact.shape), 0, 1)
    return mask, view


@given(seed=st.integers(0, 2**32 - 1), scale=st.sampled_from([1e-3, 1, 1e4]))
@example(seed=17810423, scale=1)
@example(seed=303179, scale=1e-3)  # a turn rounds a line across the penumbra to beyond its limit of straightness
def test_neither_turns_nor_the_scenes_size_nor_pixels_that_are_not_scored_change_a_score(truth, seed, scale) -> None:
    def scores_of(mask: np.ndarray, view: dict[str, np.ndarray]) -> dict[str, float | None]:
        given = {name: array for name, array in view.items() if name != "floor"}
        return score(mask, truth(positions=lambda: view["floor"], **given))

    rng = np.random.default_rng(seed)
    mask, view = soft_view(rng)
    before = scores_of(mask, view)
    assert before["width"] is not None
    for turn in (np.flipud, np.rot90):  # of which all eight are made
        after = scores_of(
            turn(mask), {name: turn(array) for name, array in view.items()} | {"floor": turn(view["floor"]) * scale}
        )
        for name, value in before.items():
            limit = 5e-3 if name.startswith(("width", "hardening")) else 1e-4  # the former are medians over such lines
            assert after[name] == (None if value is None else pytest.approx(value, abs=limit)), name
    valid = view["receivers"] & ~view["undecided"]
    other = {name: np.where(valid, view[name], rng.random(mask.shape)) for name in ("visibility", "standard_error")}
    assert scores_of(np.where(valid, mask, rng.random(mask.shape)), view | other) == before


FINE = {"rmse_pen": 0.05, "width": 0.1, "hardening": 0.9, "noise": 0.01, "banding": 0.0, "bias_pen": 0.005}


def test_what_is_small_or_unknown_is_not_named_and_causes_come_before_the_largest_errors() -> None:
    assert soft_faults(FINE, None) == soft_faults(FINE | {"width": None, "hardening": None, "bleed": None}, None) == {}
    wrong = {"width": 2.0, "hardening": 0.0, "bias_pen": -0.02, "bleed": 0.1, "noise": 0.04}
    names = ["penumbra too narrow", "contact hardening", "light bleeding", "noise", "penumbra too dark"]
    assert list(soft_faults(FINE | wrong, -1.9)) == names


def test_a_wrong_width_has_a_direction_where_most_penumbrae_agree() -> None:
    for wider, words in [
        (1.0, "2 times too wide (median"),
        (-1.0, "2 times too narrow (median"),
        (0.1, "too wide or"),
        (None, "too wide or"),
    ]:
        (line,) = soft_faults(FINE | {"width": 1.0}, wider).values()
        assert words in line
