"""Detection of rotated, inverted, shifted and encoded masks, without false alarms for inaccurate ones."""

from collections.abc import Callable

import numpy as np
import pytest

from shadowbench.engines.detection import MaskEncoding, detect_encoding, estimate_shift, misorientation
from tests.engines.conftest import srgb

SCENES = ["cube-on-plane", "stairs", "spot-lamp", "railings", "room-with-window", "lamp-by-wall"]
NOISE = np.random.default_rng(7)


@pytest.fixture(params=[128, pytest.param(256, marks=[pytest.mark.slow, pytest.mark.exhaustive])])
def size(request: pytest.FixtureRequest) -> int:
    """Pixels along a side of the view."""
    found: int = request.param
    return found


def with_acne(mask: np.ndarray, share: float) -> np.ndarray:
    return np.where(NOISE.random(mask.shape) < share, 0, mask)


def blurred(mask: np.ndarray, times: int) -> np.ndarray:
    for _ in range(times):
        mask = (mask + np.roll(mask, 1, 0) + np.roll(mask, 1, 1) + np.roll(mask, (1, 1), (0, 1))) / 4
        mask = (mask + np.roll(mask, -1, 0) + np.roll(mask, -1, 1) + np.roll(mask, (-1, -1), (0, 1))) / 4
    return mask


@pytest.mark.parametrize("name", SCENES)
@pytest.mark.parametrize("quality", ["exact", "acne"])
def test_a_turned_or_inverted_mask_is_named(
    name: str, quality: str, size: int, drawn: Callable, prepared: Callable
) -> None:
    mask = drawn(name, size, hard=True)
    mask = with_acne(mask, 0.1) if quality == "acne" else mask
    truth = prepared(name, size)
    assert misorientation(mask, truth) is None
    assert misorientation(mask[::-1], truth) == "flipped vertically"
    assert misorientation(mask[:, ::-1], truth) == "flipped horizontally"
    assert misorientation(mask[::-1, ::-1], truth) == "rotated by 180°"
    assert misorientation(1 - mask, truth) == "inverted"
    assert misorientation(1 - mask[::-1], truth) == "flipped vertically and inverted"


@pytest.mark.parametrize("name", SCENES)
def test_a_bad_mask_is_not_taken_for_a_turned_one(name: str, size: int, drawn: Callable, prepared: Callable) -> None:
    mask, truth = drawn(name, size, hard=True), prepared(name, size)
    bad = [
        np.ones_like(mask),
        np.zeros_like(mask),
        NOISE.random(mask.shape),
        with_acne(np.ones_like(mask), 0.4),
        with_acne(mask, 0.7),
        np.maximum(mask, NOISE.random(mask.shape) < 0.8),
        np.roll(mask, size // 6, 0),
        np.roll(mask, -size // 6, 1),
    ]
    assert [misorientation(one, truth) for one in bad] == [None] * len(bad)


@pytest.mark.parametrize("name", SCENES)
@pytest.mark.parametrize("shift", [(0.5, 0), (0, 0.5), (-0.5, 0.5), (1, 0), (0, -1), (1, 1), (3, -2)])
def test_a_shift_is_measured_within_a_tenth_of_a_pixel(
    name: str, shift: tuple[float, float], size: int, drawn: Callable, comparison: Callable
) -> None:
    found = estimate_shift(comparison(drawn(name, size, shift=shift), name))
    assert found is not None
    np.testing.assert_allclose(found, shift, atol=0.1)


@pytest.mark.parametrize("name", ["stairs", "spot-lamp", "railings"])
def test_a_hard_mask_is_measured_too(name: str, size: int, drawn: Callable, comparison: Callable) -> None:
    # Its samples lie ⅛ pixel right of and below the centres, so that it lies that much left and above.
    found = estimate_shift(comparison(drawn(name, size, shift=(1, -0.5), hard=True), name))
    np.testing.assert_allclose(found, (1 - 1 / 8, -0.5 - 1 / 8), atol=0.1)


@pytest.mark.parametrize("name", SCENES)
def test_an_aligned_mask_has_no_shift(name: str, size: int, drawn: Callable, comparison: Callable) -> None:
    exact = drawn(name, size)
    for mask in (exact, blurred(exact, 2), with_acne(exact, 0.1), np.ones_like(exact), drawn(name, size, hard=True)):
        assert estimate_shift(comparison(mask, name)) is None


@pytest.mark.parametrize("name", SCENES)
@pytest.mark.parametrize("times", [0, 1, 3])
def test_an_encoded_mask_is_told_from_a_linear_one(
    name: str, times: int, size: int, drawn: Callable, comparison: Callable
) -> None:
    mask = blurred(drawn(name, size), times)
    assert detect_encoding(comparison(mask, name)) == MaskEncoding(None, False)
    assert detect_encoding(comparison(srgb(mask), name)) == MaskEncoding(None, True)


@pytest.mark.parametrize("name", SCENES)
def test_an_encoded_mask_that_is_shifted_too_is_told_its_own_shift(
    name: str, size: int, drawn: Callable, comparison: Callable
) -> None:
    mask = drawn(name, size, shift=(1, 0.5))  # once encoded, its edges look moved into the shadow
    for values, encoded in ((mask, False), (srgb(mask), True)):
        found = detect_encoding(comparison(values, name))
        assert (found.srgb_encoded, found.umbra) == (encoded, None) and found.shift is not None
        np.testing.assert_allclose(found.shift, (1, 0.5), atol=0.1)


@pytest.mark.parametrize("name", SCENES)
@pytest.mark.parametrize("umbra", [0.1, 0.3, 0.6])
@pytest.mark.parametrize("hard", [False, True])
def test_a_linear_mask_that_is_never_dark_is_not_taken_for_an_encoded_one(
    name: str, umbra: float, hard: bool, size: int, drawn: Callable, comparison: Callable
) -> None:
    size = 256 if name == "railings" else size  # the shadows of its bars are too thin for an umbra in 128²
    found = detect_encoding(comparison(umbra + (1 - umbra) * drawn(name, size, hard=hard), name))
    assert (found.srgb_encoded, found.shift) == (False, None)
    assert found.umbra == pytest.approx(umbra, abs=2e-3)


def test_nothing_is_said_of_the_encoding_of_a_hard_mask(size: int, drawn: Callable, comparison: Callable) -> None:
    assert detect_encoding(comparison(drawn("stairs", size, hard=True), "stairs")) == MaskEncoding(None)
