"""The cost of scoring, by counted calls: a truth is prepared once per view."""

from unittest.mock import Mock

import numpy as np

from shadowbench.measure.scoring import mask_record, prepare_truth
from shadowbench.scores import comparison, loops, prepared


def test_values_that_depend_only_on_the_truth_are_computed_once(truth_of, monkeypatch) -> None:
    spies = []
    for module, name in ((prepared, "squared_distance"), (comparison, "squared_distance"), (loops, "ssim_map")):
        spies.append(Mock(wraps=getattr(module, name)))
        monkeypatch.setattr(module, name, spies[-1])
    truth = truth_of("sphere-and-torus", 128)
    against = prepare_truth(truth)
    each = []
    for shift in range(3):
        mask_record(np.roll(truth.visibility, shift, axis=1), truth, against)
        each.append([spy.call_count for spy in spies])
    # Distances to the truth's edge, to shadow and to light from the other side; to the mask's own edge; its SSIM.
    assert each == [[3, 1, 1], [3, 2, 2], [3, 3, 3]]
