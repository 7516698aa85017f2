"""Crossings of hand-made penumbrae, and variation along isolines, of values that are known pixel by pixel."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from shadowbench.scores.loops import step_squared
from shadowbench.scores.penumbrae import Crossings, Isolines, crossings, smooth_gradient

METRES = 0.1
"""Width of a pixel on the floor."""


def floor(height: int, width: int) -> np.ndarray:
    y, x = np.mgrid[:height, :width] * METRES
    return np.stack([x, 0 * x, y], axis=-1)


def test_a_line_ends_with_the_last_valid_pixel_and_off_the_plane() -> None:
    """Visibility crosses 0.1 and 0.9 at columns 25 and 55; a step of a thousandth of the line ends a plane."""
    profile = np.interp(np.arange(81), (25, 26, 54, 55), (0.05, 0.2, 0.8, 0.95))
    visibility, (y, x) = np.tile(np.float32(profile), (3, 1)), np.mgrid[:3, :81]
    edge, plane = (y == 1) & (x == 40), floor(3, 81)
    gradient = np.stack([0 * edge, edge]).astype(np.float32)
    for low, high, step, lines in [
        (25, 55, 0, 1), (26, 55, 0, 0), (25, 54, 0, 0), (0, 80, 0.95e-3, 1), (0, 80, 1.05e-3, 0), (0, 80, -1.05e-3, 0)
    ]:  # fmt: skip
        stepped = plane + [0, step * 5 * METRES, 0] * (x >= 45)[..., np.newaxis]
        valid = (x >= low) & (x <= high)
        assert len(crossings(visibility, 0 * visibility, valid, edge, gradient, stepped).width) == lines


def test_a_width_is_measured_along_the_steepest_line_on_the_plane() -> None:
    """Eight tenths of a penumbra of 20 px, between straight lines; steepest in metres, not by pixels.

    A pixel to the right is 0.1 m along x, one down is `down` along x and z. If p = J q is the point at the pixel q and
    visibility rises by s·q / 20, it rises by J⁻ᵀs·p / 20: in that direction, and as fast as that vector is long.
    """
    for towards in [(0.8, 0.6), (-0.6, 0.8), (0.0, -1.0)]:
        for down in [(0.0, 0.4), (0.07, 0.2)]:
            y, x = np.mgrid[:90, :110].astype(float)
            positions = np.stack([METRES * x + down[0] * y, 0 * x, down[1] * y], axis=-1)
            right_of, below = x - 54, y - 45
            visibility = np.clip((towards[0] * right_of + towards[1] * below) / 20 + 0.5, 0, 1).astype(np.float32)
            gradient = np.stack([towards[1] + 0 * x, towards[0] + 0 * x]).astype(np.float32)
            edge = (np.abs(right_of) < 3) & (np.abs(below) < 3)
            found = crossings(visibility, 0 * visibility, x >= 0, edge, gradient, positions)
            to_metres = np.array([[METRES, down[0]], [0, down[1]]])
            steepest = np.linalg.solve(to_metres.T, towards)
            by_pixels = np.linalg.solve(to_metres, steepest)
            assert len(found.width) == found.tried == 25
            assert found.width == pytest.approx(16 / np.linalg.norm(steepest), rel=1e-5)
            assert found.width_px == pytest.approx(16 * np.linalg.norm(by_pixels) / (by_pixels @ towards), rel=1e-5)
            assert found.pixel == pytest.approx(found.width / found.width_px, rel=1e-5)


def drawn(row: list[float], first: int = 0, last: int | None = None) -> float:
    """Width in pixels of a mask of a few pixels on a line along its only row, used from `first` to `last`."""
    mask = np.array([row], np.float32)
    column = np.arange(mask.shape[1])
    line = np.stack([0 * column, column])[:, np.newaxis].astype(np.float32)
    one = np.ones(1)
    end = np.array([column[-1] if last is None else last])
    along = column[np.newaxis].astype(np.float32)
    (width,) = Crossings(1, line, np.array([first]), end, along, one, one, one / 8).widths_of(mask)
    return float(width)


def test_a_width_lies_between_the_first_points_at_a_tenth_and_at_nine_tenths() -> None:
    """On the used part; one that falls is smoothed by its running extremes, and one shade is as narrow as a pixel."""
    assert [drawn([0, 0.5, 1]), drawn([1, 0, 0.5, 1, 0], first=1, last=3)] == pytest.approx([1.6, 1.6])
    assert drawn([0, 0.9, 0.9, 0.9, 1]) == drawn([0, 0.9, 0.9, 0.9]) == pytest.approx(1 - 1 / 9)
    assert drawn([0, 0.5, 0.5, 0.5]) == pytest.approx(3 - 0.2), "as wide as the line is long"
    assert drawn([0, 0.4, 0.8]) == pytest.approx(2 - 0.25)
    assert drawn([0.5, 0.5, 0.5, 1]) == pytest.approx(2.8)
    assert drawn([0, 0.6, 0.4, 1]) == drawn([0, 0.5, 0.5, 1]) == pytest.approx(2.8 - 0.2)
    assert drawn([0, 0, 0]) == drawn([1, 1, 1]) == drawn([0, 1, 1], first=1) == 1 / 8


def hardening(true: np.ndarray, mask: np.ndarray, pixels: float = 10) -> tuple[float, float] | None:
    """Of penumbrae that are all `pixels` wide."""
    none = np.zeros((len(true), 0))
    flat = Crossings(len(true), none, none, none, none, true, np.full(len(true), pixels), np.ones(len(true)))
    return flat.hardening(mask)


def test_hardening_is_the_line_through_thirty_widths() -> None:
    true = np.linspace(1, 10, 30)
    assert hardening(true, 2 * true + 1) == pytest.approx((2, 1 / 5.5))
    assert hardening(true[1:], 2 * true[1:] + 1) is None


def test_hardening_needs_widths_that_vary_by_a_factor_of_three() -> None:
    """Of 41 widths in order, the fifth is the 10th percentile, the fifth but last is the 90th."""
    for high, found in [(30, (1, 0)), (29.9, None)]:
        true = np.array([5] * 4 + [10] + [20] * 31 + [high] + [40] * 4)
        assert hardening(true, true) == (found and pytest.approx(found))


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


def test_one_value_among_seven_pixels() -> None:
    """Their mean is 1/7, from which the middle one differs by 6/7 or 1/7; squared, 7/6 times."""
    for distance, expected in [(0, 6 / 7), (1, 1 / 42), (2, 1 / 42), (3, 1 / 42), (4, 0)]:
        values = np.zeros((SIZE, SIZE))
        values[MIDDLE + distance, MIDDLE] = 1
        assert variance(values) == pytest.approx(expected)
        assert variance(values[::-1]) == pytest.approx(expected)
        assert variance(values.T) == pytest.approx(0 if distance else 6 / 7), "across the isoline"


@given(st.integers(0, 2**32 - 1), st.floats(0, 2 * math.pi))
def test_a_constant_has_no_variance_whichever_pixels_are_valid(seed, angle) -> None:
    """Along isolines in any direction, between pixels of which some are not valid."""
    valid = np.random.default_rng(seed).random((SIZE, SIZE)) < 0.8
    valid[MIDDLE, MIDDLE] = True
    values = np.where(valid, 1.0, 100.0)
    assert variance(values, math.cos(angle), math.sin(angle), valid) in (None, pytest.approx(0, abs=1e-10))
