"""What scoring may cost, and that the truth's side of it is found once a view."""

import os
import time
from collections import Counter
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest

from shadowbench.scenes.model import View
from shadowbench.scores import reference, split
from shadowbench.studies.scoring import mask_record, reference_of
from shadowbench.truth.trace import Truth, trace


@pytest.fixture
def one_core() -> Iterator[None]:
    if not hasattr(os, "sched_setaffinity"):
        pytest.skip("no way to keep to one core here")
    allowed = os.sched_getaffinity(0)
    os.sched_setaffinity(0, {min(allowed)})
    yield
    os.sched_setaffinity(0, allowed)


@pytest.mark.alone
def test_a_cell_of_1024_pixels_a_side_is_scored_in_a_quarter_of_a_second(
    builtin: Callable[..., View], one_core: None
) -> None:
    truth = trace(builtin("colonnade", 1024), pixel_samples=1)
    against = reference_of(truth)
    mask = np.roll(truth.visibility, (1, 2), axis=(0, 1))
    mask_record(mask, truth, against, truth.triangle)
    seconds = []
    for _ in range(5):
        start = time.process_time()
        mask_record(mask, truth, against, truth.triangle)
        seconds.append(time.process_time() - start)
    assert min(seconds) < 0.25


def test_what_only_the_truth_decides_is_found_once(truth_of: Callable[..., Truth], monkeypatch: Any) -> None:
    counts: Counter[str] = Counter()

    def counted(module: Any, name: str) -> None:
        function = getattr(module, name)

        def call(*arguments: Any) -> Any:
            counts[name] += 1
            return function(*arguments)

        monkeypatch.setattr(module, name, call)

    truth = truth_of("sphere-and-torus", 128)
    for module, name in (
        (reference, "squared_distance"),
        (split, "squared_distance"),
        (split, "edge_pixels"),
        (reference, "window_moments"),
    ):
        counted(module, name)
    against = reference_of(truth)
    each = []
    for shift in range(3):
        before = counts.copy()
        mask_record(np.roll(truth.visibility, shift, axis=1), truth, against)
        each.append(counts - before)
    # To the truth's edge, to shadow and to light from the other side; and to the mask's own edge.
    assert each[0] == {"squared_distance": 3 + 1, "edge_pixels": 1 + 1, "window_moments": 1}
    assert each[1] == each[2] == {"squared_distance": 1, "edge_pixels": 1}
