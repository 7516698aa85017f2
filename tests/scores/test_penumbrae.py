"""Crossings of hand-made penumbrae, and variation along isolines, of values that are known pixel by pixel."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from shadowbench.scores.loops import step_squared
from shadowbench.scores.masks import LEVELS
from shadowbench.scores.penumbrae import Crossings, Isolines, crossings, smooth_gradient

METRES = 0.1
"""Width of a pixel on the floor."""


def floor(height: int, width: int) -> np.ndarray:
    y, x = np.mgrid[:height, :width] * METRES
    return np.stack([x, 0 * x, y], axis=-1)


def crossed(profile: np.ndarray, start: int = 40, error: float = 0, slant: float = 0, **given: np.ndarray) -> int:
    """Number of crossings, 1 or 0, of a line to the right from column `start`, with visibility `profile` by column.

    slant: rows down by which the line deviates per pixel.
    """
    edge = np.zeros((3, len(profile)), bool)
    edge[1, start] = True
    found = crossings(
        np.tile(np.float32(profile), (3, 1)),
        np.full(edge.shape, error, np.float32),
        given.get("valid", np.ones(edge.shape, bool)),
        edge,
        np.stack([slant * edge, edge]).astype(np.float32),
        given.get("positions", floor(*edge.shape)),
    )
    assert found.tried == 1
    return len(found.width)


def rising(*knots: tuple[float, float], columns: int = 81) -> np.ndarray:
    """Visibility by column: straight between knots (column, visibility)."""
    return np.interp(np.arange(columns), *zip(*knots, strict=True))


def test_a_line_reaches_a_quarter_of_the_image_to_either_side() -> None:
    """From column 80 of 160 to the first pixels darker than 0.1 and lighter than 0.9."""
    for dark, lit, found in [(40, 120, 1), (39, 120, 0), (40, 121, 0)]:
        knots = (dark, 0.05), (dark + 1, 0.2), (lit - 1, 0.8), (lit, 0.95)
        assert crossed(rising(*knots, columns=160), 80) == found


def test_a_line_ends_with_the_last_valid_pixel() -> None:
    """The first pixels darker than 0.1 and lighter than 0.9 are 25 and 55."""
    for low, high, found in [(25, 55, 1), (26, 55, 0), (25, 54, 0)]:
        column = np.tile(np.arange(81), (3, 1))
        profile = rising((25, 0.05), (26, 0.2), (54, 0.8), (55, 0.95))
        assert crossed(profile, valid=(column >= low) & (column <= high)) == found


def test_the_truth_may_fall_by_four_standard_errors_and_a_level() -> None:
    """From column 42 to 43, on the line's lit side or on its dark one."""
    for start in [38, 46]:
        for fall, error, found in [
            (0.0399, 0.01, 1),
            (0.0402, 0.01, 0),
            (0.95 / LEVELS, 0, 1),
            (1.05 / LEVELS, 0, 0),
            (0.25, (0.25 - 1 / LEVELS) / 4, 1),
        ]:
            assert crossed(rising((30, 0), (42, 0.75), (43, 0.75 - fall), (55, 1)), start, error) == found


def test_a_line_ends_a_thousandth_of_its_length_off_the_plane() -> None:
    """A step, up or down, five pixels from the start; beyond it the line comes nearer to the plane."""
    for height, found in [(0.95e-3, 1), (1.05e-3, 0)]:
        for up in (-1, 1):
            stepped = floor(3, 81)
            stepped[:, 45:, 1] = up * height * 5 * METRES
            assert crossed(rising((30, 0), (50, 1)), positions=stepped) == found


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


def drawn(*rows: list[float], first: int = 0, last: int | None = None) -> float:
    """Width in pixels of a mask of a few pixels on a line along the middle of its rows, used from `first` to `last`."""
    mask = np.array(rows, np.float32)
    column = np.arange(mask.shape[1])
    line = np.stack([0 * column + (len(mask) - 1) / 2, column])[:, np.newaxis].astype(np.float32)
    one = np.ones(1)
    end = np.array([column[-1] if last is None else last])
    along = column[np.newaxis].astype(np.float32)
    (width,) = Crossings(1, line, np.array([first]), end, along, one, one, one / 8).widths_of(mask)
    return float(width)


def test_a_width_lies_between_the_first_points_at_a_tenth_and_at_nine_tenths() -> None:
    assert drawn([0, 0.5, 1]) == pytest.approx(1.8 - 0.2)
    assert drawn([0, 0.9, 0.9, 0.9, 1]) == drawn([0, 0.9, 0.9, 0.9]) == pytest.approx(1 - 1 / 9)


def test_only_the_used_part_of_a_line_counts() -> None:
    assert drawn([1, 0, 0.5, 1, 0], first=1, last=3) == pytest.approx(1.6)


def test_a_mask_that_stays_grey_is_as_wide_as_the_line_is_long() -> None:
    assert drawn([0, 0.5, 0.5, 0.5]) == pytest.approx(3 - 0.2)
    assert drawn([0, 0.4, 0.8]) == pytest.approx(2 - 0.25)
    assert drawn([0.5, 0.5, 0.5, 1]) == pytest.approx(2.8)


def test_a_mask_of_one_shade_is_as_narrow_as_a_pixel() -> None:
    assert drawn([0, 0, 0]) == drawn([1, 1, 1]) == drawn([0, 1, 1], first=1) == 1 / 8


def test_a_mask_that_falls_is_smoothed_by_the_mean_of_its_running_extremes() -> None:
    assert drawn([0, 0.6, 0.4, 1]) == drawn([0, 0.5, 0.5, 1]) == pytest.approx(2.8 - 0.2)


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


def test_a_circle_is_straight_over_a_segment_that_turns_by_less_than_30_degrees() -> None:
    for radius, straight in [(3 / math.tan(math.radians(29)), 1), (3 / math.tan(math.radians(31)), 0)]:
        y, x = np.mgrid[:SIZE, :SIZE] - MIDDLE
        middle = (x == 0) & (y == 0)
        gradient = np.stack([y, x + radius]).astype(np.float32)
        assert len(Isolines.of(gradient, middle).rows) == straight


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
