"""Faults of a whole mask are named, each kind, and inaccurate masks are not taken for faulty ones."""

from collections.abc import Callable

import numpy as np
import pytest
from scipy import ndimage

from shadowbench.masks.accuracy import MaskEncoding, detect_encoding, misorientation
from shadowbench.measure.scoring import prepare_truth
from shadowbench.scenes.opening import chosen_view
from shadowbench.truths.cache import cached_truth
from tests.masks.conftest import srgb

SCENES = ("cube-on-plane", "stairs", "spot-lamp", "railings", "room-with-window", "lamp-by-wall")
SIZE = 128
NOISE = np.random.default_rng(7)


def with_acne(mask: np.ndarray, share: float) -> np.ndarray:
    return np.where(NOISE.random(mask.shape) < share, 0, mask)


TURNED: dict[str | None, Callable[[np.ndarray], np.ndarray]] = {
    None: lambda mask: mask,
    "flipped vertically": lambda mask: mask[::-1],
    "flipped horizontally": lambda mask: mask[:, ::-1],
    "rotated by 180°": lambda mask: mask[::-1, ::-1],
    "inverted": lambda mask: 1 - mask,
    "flipped vertically and inverted": lambda mask: 1 - mask[::-1],
}
BAD: dict[str, Callable[[np.ndarray], np.ndarray]] = {
    "lit": np.ones_like,
    "in shadow": np.zeros_like,
    "noise": lambda mask: NOISE.random(mask.shape),
    "acne alone": lambda mask: with_acne(np.ones_like(mask), 0.4),
    "mostly acne": lambda mask: with_acne(mask, 0.7),
    "leaks": lambda mask: np.maximum(mask, NOISE.random(mask.shape) < 0.8),
    "far off": lambda mask: np.roll(mask, len(mask) // 6, 0),
}


@pytest.mark.parametrize("scene", SCENES)
def test_a_flipped_or_inverted_mask_is_named_and_a_bad_one_is_not_taken_for_it(
    scene: str, drawn: Callable, prepared: Callable
) -> None:
    mask, truth = drawn(scene, SIZE, hard=True), prepared(scene, SIZE)
    for fault, turn in TURNED.items():
        assert misorientation(turn(mask), truth) == fault
        assert misorientation(turn(with_acne(mask, 0.1)), truth) == fault
    assert {name: misorientation(spoil(mask), truth) for name, spoil in BAD.items()} == dict.fromkeys(BAD)


@pytest.mark.parametrize("scene", SCENES)
def test_a_rectangle_is_named_that_lies_on_its_side_or_is_mirrored(scene: str, truth_cache: None) -> None:
    wide, high = (cached_truth(chosen_view(scene, size)) for size in ("192x108", "108x192"))
    truths, mask = [prepare_truth(truth) for truth in (wide, high)], wide.visibility
    for fault, turned in {
        "transposed": mask.T,
        "rotated by 90° to the right": np.rot90(mask, -1),
        "rotated by 90° to the left": np.rot90(mask),
        "transposed and inverted": 1 - mask.T,
    }.items():
        assert misorientation(turned, truths[1], lambda: truths[0]) == fault
    for fault in (None, "flipped horizontally", "flipped vertically"):
        assert misorientation(TURNED[fault](mask), truths[0], lambda: truths[1]) == fault
    for name in ("noise", "acne alone", "mostly acne", "far off"):
        assert misorientation(BAD[name](mask), truths[0], lambda: truths[1]) is None


@pytest.mark.parametrize(
    ("scene", "shift", "hard", "encoded", "umbra"),
    [
        ("stairs", (0, 0.5), False, False, 0.0),
        ("room-with-window", (1, 0), False, False, 0.0),
        ("stairs", (3, -2), False, True, 0.0),
        ("railings", (1, -0.5), True, None, 0.0),
        ("cube-on-plane", (0, 0), False, True, 0.0),
        ("spot-lamp", (0, 0), False, False, 0.1),
        ("stairs", (0, 0), True, False, 0.3),
        ("room-with-window", (1, 1), False, False, 0.3),
        ("cube-on-plane", (1, 0), False, True, 0.3),
    ],
)
def test_a_shift_an_encoding_and_ambient_light_are_measured(
    scene: str,
    shift: tuple[float, float],
    hard: bool,
    encoded: bool | None,
    umbra: float,
    drawn: Callable,
    comparison: Callable,
) -> None:
    """Alone and together: a shift within a tenth of a pixel."""
    mask = drawn(scene, SIZE, shift=shift, hard=hard)
    found = detect_encoding(comparison(umbra + (1 - umbra) * (srgb(mask) if encoded else mask), scene))
    assert found.srgb_encoded == encoded
    assert (found.umbra or 0) == pytest.approx(umbra, abs=2e-3)
    beside = np.array(shift) - hard / (8 if hard else 1)  # hard samples lie ⅛ pixel right of and below the centres
    assert (found.shift is None) == (shift == (0, 0))
    np.testing.assert_allclose(found.shift or (0, 0), beside if found.shift else 0, atol=0.1)


@pytest.mark.parametrize("scene", SCENES)
def test_an_inaccurate_mask_has_no_fault_of_the_whole(scene: str, drawn: Callable, comparison: Callable) -> None:
    exact = drawn(scene, SIZE)
    tall = np.maximum(exact, np.eye(SIZE))
    for mask in (exact, drawn(scene, SIZE, hard=True), with_acne(exact, 0.1), 0.8 * exact, np.ones_like(exact), tall):
        assert detect_encoding(comparison(mask, scene)) in (MaskEncoding(None), MaskEncoding(None, False))
    for sigma in (1.0, 3.0):
        assert detect_encoding(comparison(ndimage.gaussian_filter(exact, sigma), scene)) == MaskEncoding(None, False)
        encoded = srgb(ndimage.gaussian_filter(exact, sigma))
        assert detect_encoding(comparison(encoded, scene)) == MaskEncoding(None, True)


@pytest.mark.parametrize("ambient", [0.1, 0.5])
def test_ambient_light_that_is_in_both_screenshots_is_told_from_soft_edges(
    ambient: float, drawn: Callable, comparison: Callable, prepared: Callable
) -> None:
    """It leaves a / (a + d · N·L) in shadow, of another level on each plane."""
    truth = prepared("stairs")
    light = np.clip(truth.cosine, 0, 1) / 2
    level = np.median((ambient / (ambient + light))[truth.shadow_interior])
    exact = drawn("stairs")
    for mask, shift in (
        (exact, (0, 0)),
        (ndimage.gaussian_filter(exact, 3.0), (0, 0)),
        (drawn("stairs", shift=(2, 1)), (2, 1)),
    ):
        found = detect_encoding(comparison((ambient + light * mask) / (ambient + light), "stairs"), linear=True)
        assert found.umbra == pytest.approx(level, abs=0.03) and found.srgb_encoded is None
        np.testing.assert_allclose(found.shift or (0, 0), shift, atol=0.1)
        assert detect_encoding(comparison(mask, "stairs"), linear=True).umbra is None
