"""The cost of scoring, by counted calls: a truth is prepared once per view."""

from collections import Counter
from collections.abc import Callable
from typing import Any

import numpy as np

from shadowbench.measure.scoring import mask_record, prepare_truth
from shadowbench.scores import comparison, loops, prepared
from shadowbench.truths.trace import Truth


def test_values_that_depend_only_on_the_truth_are_computed_once(
    truth_of: Callable[..., Truth], monkeypatch: Any
) -> None:
    counts: Counter[str] = Counter()

    def counted(module: Any, name: str) -> None:
        function = getattr(module, name)

        def call(*arguments: Any) -> Any:
            counts[name] += 1
            return function(*arguments)

        monkeypatch.setattr(module, name, call)

    truth = truth_of("sphere-and-torus", 128)
    for module, name in (
        (prepared, "squared_distance"),
        (comparison, "squared_distance"),
        (loops, "ssim_map"),
    ):
        counted(module, name)
    against = prepare_truth(truth)
    each = []
    for shift in range(3):
        before = counts.copy()
        mask_record(np.roll(truth.visibility, shift, axis=1), truth, against)
        each.append(counts - before)
    # To the truth's edge, to shadow and to light from the other side; and to the mask's own edge.
    assert each[0] == {"squared_distance": 3 + 1, "ssim_map": 1}
    assert each[1] == each[2] == {"squared_distance": 1, "ssim_map": 1}
