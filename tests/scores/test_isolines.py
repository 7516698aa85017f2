"""Gradients and variation along isolines, of values that are known pixel by pixel."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from shadowbench.scores.isolines import Isolines, smooth_gradient
from shadowbench.scores.loops import step_squared

SIZE = 15
MIDDLE = 7


def along(right: float = 1.0, down: float = 0.0, valid: np.ndarray | None = None) -> tuple[Isolines, np.ndarray]:
    """The segment through the middle pixel of 15 by 15, across the gradient (down, right), and the valid pixels."""
    seen = np.ones((SIZE, SIZE), bool) if valid is None else valid
    middle = np.zeros((SIZE, SIZE), bool)
    middle[MIDDLE, MIDDLE] = True
    gradient = np.stack([np.full(middle.shape, part, np.float32) for part in (down, right)])
    return Isolines.of(gradient, middle), seen


def variance(
    values: np.ndarray, right: float = 1.0, down: float = 0.0, valid: np.ndarray | None = None
) -> float | None:
    line, seen = along(right, down, valid)
    return line.variance(values.astype(np.float32), seen, np.zeros((SIZE, SIZE), np.float32))


def test_a_step_is_half_the_difference_of_the_neighbours_where_both_are_valid() -> None:
    """A rise by 0.2 a column and 0.1 a row; no neighbours beyond the image, nor where a pixel is not valid."""
    y, x = np.mgrid[:5, :5].astype(np.float32)
    valid = (y != 2) | (x != 1)
    right, down = ((x > 0) & (x < 4)).astype(float), ((y > 0) & (y < 4)).astype(float)
    right[2, 2] = down[1, 1] = down[3, 1] = 0
    expected = 0.04 * right + 0.01 * down
    assert step_squared(0.2 * x + 0.1 * y, valid) == pytest.approx(expected)


def test_the_gradient_of_an_edge_is_that_of_a_gaussian_of_one_and_a_half_pixels() -> None:
    """The smoothed step rises by a Gaussian from pixel to pixel, so twice the central difference by two of them."""
    visibility = np.repeat(np.float32([[0, 1]] * 20), 10, axis=1)
    gaussian = np.exp(-(np.arange(-9, 10) ** 2) / (2 * 1.5**2))
    gaussian /= gaussian.sum()
    down, right = smooth_gradient(visibility, visibility >= 0)[:, 10]
    assert right[6:14] == pytest.approx((gaussian[5:13] + gaussian[6:14]) / 2, abs=1e-4)
    assert down == pytest.approx(0, abs=1e-6)


@pytest.mark.parametrize(("slope", "found"), [(0.95e-6, 0), (1e-6, 0), (1.05e-6, 1)])
def test_a_gradient_of_a_millionth_a_pixel_has_no_direction(slope, found) -> None:
    assert len(along(slope)[0].rows) == len(along(0, slope)[0].rows) == found


@pytest.mark.parametrize(
    ("radius", "straight"), [(3 / math.tan(math.radians(29)), 1), (3 / math.tan(math.radians(31)), 0)]
)
def test_a_circle_is_straight_over_a_segment_that_turns_by_less_than_30_degrees(radius, straight) -> None:
    y, x = np.mgrid[:SIZE, :SIZE] - MIDDLE
    middle = (x == 0) & (y == 0)
    gradient = np.stack([y, x + radius]).astype(np.float32)
    assert len(Isolines.of(gradient, middle).rows) == straight


@pytest.mark.parametrize(("distance", "expected"), [(0, 6 / 7), (1, 1 / 42), (2, 1 / 42), (3, 1 / 42), (4, 0)])
def test_one_value_among_seven_pixels(distance, expected) -> None:
    """Their mean is 1/7, from which the middle one differs by 6/7 or 1/7; squared, 7/6 times."""
    values = np.zeros((SIZE, SIZE))
    values[MIDDLE + distance, MIDDLE] = 1
    assert variance(values) == pytest.approx(expected)
    assert variance(values[::-1]) == pytest.approx(expected)
    assert variance(values.T) == pytest.approx(0 if distance else 6 / 7), "across the isoline"


def test_the_known_variance_is_taken_off() -> None:
    line, valid = along()
    values = np.zeros((SIZE, SIZE), np.float32)
    values[MIDDLE, MIDDLE] = 1
    assert line.variance(values, valid, values / 4) == pytest.approx(6 / 7 - 1 / 4)


@given(st.integers(0, 2**32 - 1), st.floats(0, 2 * math.pi))
def test_a_constant_has_no_variance_whichever_pixels_are_valid(seed, angle) -> None:
    """Along isolines in any direction, between pixels of which some are not valid."""
    valid = np.random.default_rng(seed).random((SIZE, SIZE)) < 0.8
    valid[MIDDLE, MIDDLE] = True
    values = np.where(valid, 1.0, 100.0)
    assert variance(values, math.cos(angle), math.sin(angle), valid) in (None, pytest.approx(0, abs=1e-10))


@pytest.mark.parametrize(("slant", "counts"), [(0.45, True), (0.5, False), (0.55, False)])
def test_a_segment_with_no_more_than_half_a_pair_does_not_count(slant, counts) -> None:
    """Of the rows, only those from the middle down are valid.

    The points above the middle lie k times `slant` rows higher, and so on valid pixels by 1 − k · slant, if at all.
    """
    valid = np.arange(SIZE)[:, np.newaxis] >= MIDDLE + np.zeros(SIZE)
    assert (variance(np.zeros((SIZE, SIZE)), slant, math.sqrt(1 - slant**2), valid) is not None) == counts
