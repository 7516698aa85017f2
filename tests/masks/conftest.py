"""Masks as other renderers might draw them."""

from collections.abc import Callable
from functools import lru_cache
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from shadowbench.measure.scoring import prepare_truth
from shadowbench.scenes.opening import chosen_view
from shadowbench.scores.comparison import Comparison, PreparedTruth
from shadowbench.truths.cache import cached_truth

FINER = 4


def srgb(linear: np.ndarray) -> np.ndarray:
    """The sRGB curve of IEC 61966-2-1."""
    return np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * np.maximum(linear, 1e-9) ** (1 / 2.4) - 0.055)


@pytest.fixture(scope="session")
def prepared(truth_cache: None) -> Callable[..., PreparedTruth]:
    """The prepared truth of a built-in scene's first view."""
    return lru_cache(lambda name, size=256: prepare_truth(cached_truth(chosen_view(name, size))))


@pytest.fixture(scope="session")
def drawn(truth_cache: None) -> Callable[..., np.ndarray]:
    """Visibility without an error but its shift, in pixels to the right and down, smooth over the pixel or hard.

    Made of a truth with 4 × 4 samples a pixel; a shift is a multiple of ¼, a hard sample lies ⅛ beside the centre.
    """
    finer = lru_cache(lambda name, size: cached_truth(chosen_view(name, FINER * size), 1).visibility)

    def draw(name: str, size: int = 256, shift: tuple[float, float] = (0, 0), hard: bool = False) -> np.ndarray:
        across, down = (round(FINER * part) for part in shift)
        moved = np.roll(finer(name, size), (down, across), (0, 1))
        if hard:
            return moved[FINER // 2 :: FINER, FINER // 2 :: FINER]
        return moved.reshape(size, FINER, size, FINER).mean((1, 3))

    return draw


@pytest.fixture(scope="session")
def comparison(prepared: Callable[..., PreparedTruth]) -> Callable[..., Comparison]:
    """A mask beside the truth of a built-in scene."""
    return lambda mask, name: Comparison(mask.astype(np.float32), prepared(name, len(mask)))


@pytest.fixture
def png(tmp_path: Path) -> Callable[..., Path]:
    """Stores values in [0, 1] as 8-bit PNG, (H, W) grey or (H, W, 3) in colour."""

    def write(name: str, values: np.ndarray) -> Path:
        file = tmp_path / name
        Image.fromarray(np.rint(np.asarray(values) * 255).astype(np.uint8)).save(file)
        return file

    return write
