from collections.abc import Callable

import numpy as np
import pytest

from shadowbench.scores import PreparedTruth


@pytest.fixture(scope="session")
def truth() -> Callable[..., PreparedTruth]:
    """A PreparedTruth of a visibility; what is not given is the simplest: all receivers, a far blocker, N·L = 1."""

    def build(visibility, positions=None, **given):
        visibility = np.asarray(visibility, np.float32)
        shape = visibility.shape
        arrays = {
            "visibility": visibility,
            "standard_error": np.zeros(shape),
            "receivers": np.ones(shape, bool),
            "undecided": np.zeros(shape, bool),
            "area": visibility,
            "blocker": np.where(visibility < 0.5, 1.0, np.inf),
            "cosine": np.ones(shape),
            "diagonal": 10.0,
        }
        return PreparedTruth(arrays | given, positions)

    return build


@pytest.fixture(scope="session")
def half_plane() -> Callable[..., np.ndarray]:
    """Visibility of a shadow left of column `edge`."""

    def build(edge, height=128, width=128):
        return np.broadcast_to(np.arange(width) >= edge, (height, width)).astype(np.float32)

    return build


@pytest.fixture(scope="session")
def disc() -> Callable[..., np.ndarray]:
    """Visibility of a round shadow, its centre that of the image unless moved."""

    def build(radius, size=128, right=0.0):
        y, x = np.mgrid[:size, :size] - (size - 1) / 2
        return (y**2 + (x - right) ** 2 >= radius**2).astype(np.float32)

    return build
