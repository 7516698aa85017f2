"""Scores of motion, of a camera that stays, so that each point keeps its pixel."""

from collections.abc import Callable, Sequence
from itertools import product
from typing import Any

import numpy as np
import pytest

from shadowbench.scores import PreparedTruth
from shadowbench.scores.comparison import Comparison
from shadowbench.scores.motion import MOTION, Motion, Seen
from tests.samples import by_turns

HEIGHT, WIDTH = 48, 96
Images = Sequence[np.ndarray]
Y, X = np.mgrid[:HEIGHT, :WIDTH]


@pytest.fixture
def measured(truth: Callable[..., PreparedTruth]) -> Callable[..., Motion]:
    """Motion of masks against truths, all receivers."""

    def build(masks: Images, truths: Images, **given: Any) -> Motion:
        motion, before = Motion(), None
        every = np.arange(truths[0].size, dtype=np.int32)
        for mask, true in zip(masks, truths, strict=True):
            still = before is None or np.array_equal(true, before)
            kept = every[:0] if before is None else every
            seen = Seen(kept, every, 0 * every, 0 * every, np.ones(every.size, bool), still)
            motion.add(Comparison(mask, truth(true, **given)), seen)
            before = true
        return motion

    return build


def lit(inside: np.ndarray) -> np.ndarray:
    return 1 - inside.astype(np.float32)


def bar(middle: float, half: float = 10.0) -> np.ndarray:
    """A shadow of all rows, its edges averaged over pixels."""
    return (np.abs(X - middle) - half + 0.5).clip(0, 1).astype(np.float32)


def disc(radius: float = 15.0, right: float = 0.0) -> np.ndarray:
    return lit((Y - 23.5) ** 2 + (X - 47.5 - right) ** 2 < radius**2)


def moving(frames: int = 60, speed: float = 1.0) -> list[np.ndarray]:
    return [bar(15 + speed * frame) for frame in range(frames)]


@pytest.mark.parametrize(
    ("shift", "angle"), by_turns([(0, 0), (1, 0), (0.5, 0), (0.3, 0.8), (0.5, 0.5), (0.5, 0)], [0.1, 0.45, 0.7])
)
def test_a_hard_map_that_shifts_by_a_part_of_a_texel_changes_the_expected_area(measured, truth, shift, angle) -> None:
    size, texel, normal = 160, 4.0, np.array([np.cos(angle), np.sin(angle)])
    places = np.mgrid[:size, :size] - size / 2

    def drawn(phase: np.ndarray) -> np.ndarray:
        """A straight edge, read at the nearest of texels whose grid is shifted by a phase."""
        centres = [(np.floor(axis / texel - at) + 0.5 + at) * texel for axis, at in zip(places, phase, strict=True)]
        return lit(np.tensordot(normal, centres, 1) < 0)

    true = lit(np.tensordot(normal, places, 1) < 0)
    phases = np.random.default_rng(3).random((25, 2))
    pairs = [measured([drawn(phase), drawn(phase + shift)], [true] * 2) for phase in phases]
    areas = [motion.curves()["pop"][0] for motion in pairs]
    flicker = [motion.scores()["flicker"] for motion in pairs]
    corners = np.array(list(product((0, 1), repeat=2)))
    weights = np.where(corners, shift, np.subtract(1, shift)).prod(axis=1)
    expected = texel * weights @ np.abs((shift - corners) @ normal)
    assert np.mean(areas) * np.cos(angle) / size == pytest.approx(expected, rel=0.05, abs=1e-9)
    assert flicker == pytest.approx(np.array(areas) / truth(true).edge.sum())


def test_a_delay_is_the_lag_and_a_shadow_too_large_is_the_bias_of_lag(measured) -> None:
    truths = moving(60)
    for delay in (0, 2, 5):
        scores = measured([truths[max(frame - delay, 0)] for frame in range(60)], truths).scores()
        assert (scores["lag"], scores["lag_bias"]) == pytest.approx((delay, 0))
        assert scores["flicker"] == scores["false_change"] == 0
    scores = measured([bar(15 + frame, 13) for frame in range(60)], truths).scores()
    assert (scores["lag"], scores["lag_bias"]) == pytest.approx((0, 3))


@pytest.mark.parametrize("alpha", [0.5, 0.2, 0.1])
def test_an_exponential_history_lags_by_its_mean_age(measured, alpha: float) -> None:
    truths, masks = moving(260, 0.25), [bar(15)]
    for true in truths[1:]:
        masks.append((alpha * true + (1 - alpha) * masks[-1]).astype(np.float32))
    scores = measured(masks, truths).scores()
    assert scores["lag"] == pytest.approx((1 - alpha) / alpha, rel=0.04)  # the last 0.02 are not waited for
    assert scores["lag_bias"] == pytest.approx(0, abs=0.01)


def test_swim_is_the_deviation_of_an_edges_offset(measured) -> None:
    true, offsets = bar(48), 2 * np.sin(np.arange(40) * 2 * np.pi / 20)
    for widened, expected in ((False, offsets.std()), (True, offsets.std())):
        masks = [bar(48, 10 + offset) if widened else bar(48 + offset) for offset in offsets]
        assert measured(masks, [true] * 40).scores()["swim"] == pytest.approx(expected, rel=0.02)


def test_a_mask_of_noise_within_the_truths_error_does_not_flicker(measured) -> None:
    random = np.random.default_rng(1)
    true = np.broadcast_to(np.linspace(0, 1, WIDTH, dtype=np.float32), (HEIGHT, WIDTH))
    noisy = [(true + 0.01 * random.uniform(-1, 1, true.shape)).clip(0, 1) for _ in range(3)]
    for error, quiet in ((0.0, False), (0.02, True)):
        scores = measured(noisy, [true] * 3, standard_error=np.full(true.shape, error)).scores()
        assert (scores["flicker"] == 0) == quiet


def test_masks_without_memory_score_the_same_backwards(measured) -> None:
    random = np.random.default_rng(2)
    truths = [disc(15, shift) for shift in np.cumsum(random.uniform(-1, 1, 12))]
    for true in (truths, [disc()] * 12):
        masks = [np.where(random.random(one.shape) < 0.1, 1 - one, one) for one in true]
        forward, backward = (measured(masks[::way], true[::way]).scores() for way in (1, -1))
        for name in ("flicker", "false_change", "pop", "swim"):
            assert forward[name] == pytest.approx(backward[name]), name
        assert forward["pop_frame"] == 12 - backward["pop_frame"]


def test_what_is_undefined_is_none(measured) -> None:
    still = measured([disc()] * 5, [disc()] * 5).scores()
    assert {name for name, value in still.items() if value is None} == {"false_change", "pop_frame", "lag", "lag_bias"}
    assert measured([disc()] * 2, [disc()] * 2).scores()["pop"] is None
    assert set(Motion().scores().values()) == {None}
    assert set(MOTION) | {"pop_frame"} == set(still)


# Faults

BOUNDS = {"flicker": 0.25, "false_change": 0.25, "pop": 200.0, "swim": 0.7, "lag": 0.5, "lag_bias": 0.5}
RANDOM = np.random.default_rng(0)


def one(frames: Images, place: int, image: np.ndarray) -> list[np.ndarray]:
    """The frames, one of them replaced."""
    return [image if number == place else frame for number, frame in enumerate(frames)]


def texels(image: np.ndarray, shift: Sequence[float], size: float = 3.0) -> np.ndarray:
    """An image read by texels at a shift of their grid."""
    row, column = ((np.floor(axis / size + s) + 0.5 - s) * size for axis, s in zip((Y, X), shift, strict=True))
    return image[row.astype(int).clip(0, HEIGHT - 1), column.astype(int).clip(0, WIDTH - 1)]


def blended(frames: Images, alpha: float, first: np.ndarray) -> list[np.ndarray]:
    """The frames with an exponential history that begins with an image."""
    history = [first]
    for frame in frames:
        history.append((alpha * frame + (1 - alpha) * history[-1]).astype(np.float32))
    return history[1:]


def part(frames: Images, others: Images, rows: slice, since: int) -> list[np.ndarray]:
    """The frames, of others in some rows since one of them."""
    chosen = [frame.copy() for frame in frames]
    for frame, other in zip(chosen[since:], others[since:], strict=True):
        frame[rows] = other[rows]
    return chosen


STILL, SUN, SLOW, QUICK = [disc()] * 60, moving(60), moving(300, 0.2), moving(24, 3.0)
NOISE = [np.where(RANDOM.random(X.shape) < 0.02, 0, STILL[0]) for _ in STILL]
DITHER = [np.where(np.abs(np.hypot(Y - 23.5, X - 47.5) - 15) < 2, RANDOM.random(X.shape), STILL[0]) for _ in STILL]
PHASES = RANDOM.random((60, 2))
GHOST = [np.minimum(STILL[0], lit(X < 26))] * 60
SWAPPED = [SUN[number ^ 1] for number in range(60)]
FAULTS: dict[str, tuple[Images, Images, set[str]]] = {
    "one bad frame in 300": (one(SLOW, 150, 0 * X), SLOW, {"pop"}),
    "shadow lost for a frame": (one(SUN, 9, 0 * X + 1), SUN, {"pop"}),
    "mirrored frame": (one(SUN, 9, SUN[9][:, ::-1]), SUN, {"pop"}),
    "NaN that shows as black in a frame": (one(STILL, 9, np.where(X < 20, 0, STILL[0])), STILL, {"pop"}),
    "a frame repeated": (one(QUICK, 9, QUICK[8]), QUICK, {"pop"}),
    "cascade that switches": (part(SUN, [bar(19 + n) for n in range(60)], slice(30), 50), SUN, {"pop"}),
    "caster that is culled": (part(SUN, [0 * X + 1] * 60, slice(20), 50), SUN, {"pop"}),
    "history of another view": (blended(STILL, 0.3, GHOST[0]), STILL, {"pop"}),
    "map redrawn every sixth frame": ([SUN[n - n % 6] for n in range(60)], SUN, {"pop", "lag"}),
    "window not snapped": ([texels(STILL[0], phase) for phase in PHASES], STILL, {"flicker"}),
    "window not snapped, sun moves": (
        [texels(frame, phase) for frame, phase in zip(SUN, PHASES, strict=True)], SUN, {"flicker", "false_change"}),
    "noise in the penumbra": (DITHER, STILL, {"flicker"}),
    "acne that shimmers": (NOISE, STILL, {"flicker"}),
    "half a pixel to and fro": ([bar(48 + n % 2 / 2) for n in range(60)], [bar(48)] * 60, {"flicker"}),
    "frames out of order": (SWAPPED, SUN, {"flicker", "false_change"}),
    "bias that breathes": ([disc(15 + 2 * np.sin(n / 10)) for n in range(60)], STILL, {"swim"}),
    "shadow that drifts": ([disc(15, n / 12) for n in range(60)], STILL, {"swim"}),
    "two frames late": ([*SUN[:1] * 2, *SUN[:-2]], SUN, {"lag"}),
    "a frame early": ([*SUN[1:], SUN[-1]], SUN, {"lag"}),
    "history that is too long": (blended(SUN, 0.3, SUN[0]), SUN, {"lag"}),
    "shadow too large": ([bar(15 + n, 12) for n in range(60)], SUN, {"lag_bias"}),
}  # fmt: skip


def test_each_fault_is_caught_by_the_score_that_names_it(measured) -> None:
    print(f"\n{'':36}" + "".join(f"{name:>14}" for name in BOUNDS))
    beyond = {}
    for fault, (masks, truths, _) in FAULTS.items():
        scores = measured(masks, truths).scores()
        print(f"{fault:36}" + "".join(f"{'–' if scores[n] is None else format(scores[n], '.3g'):>14}" for n in BOUNDS))
        beyond[fault] = {name for name, bound in BOUNDS.items() if abs(scores[name] or 0) > bound}
    assert beyond == {fault: named for fault, (_, _, named) in FAULTS.items()}
