"""What is wrong with a soft shadow, in words, from its metrics alone."""

import pytest

from shadowbench.scores.metrics import soft_faults

FINE = {"rmse_pen": 0.05, "width": 0.1, "hardening": 0.9, "noise": 0.01, "banding": 0.0, "bias_pen": 0.005}


def test_what_is_small_or_unknown_is_not_named() -> None:
    assert soft_faults(FINE) == []
    assert soft_faults(FINE | {"width": None, "hardening": None, "bleed": None}) == []


def test_causes_come_before_the_largest_errors() -> None:
    wrong = {"width": 2.0, "hardening": 0.0, "bias_pen": -0.02, "bleed": 0.1, "noise": 0.04}
    names = [fault.name for fault in soft_faults(FINE | wrong, -1.9)]
    assert names == ["penumbra too narrow", "contact hardening", "light bleeding", "noise", "penumbra too dark"]


@pytest.mark.parametrize(
    ("wider", "told"),
    [
        (1.0, "2 times too wide (median"),
        (-1.0, "2 times too narrow (median"),
        (0.1, "too wide or"),
        (None, "too wide or"),
    ],
)
def test_a_wrong_width_has_a_direction_where_most_penumbrae_agree(wider, told) -> None:
    (fault,) = soft_faults(FINE | {"width": 1.0}, wider)
    assert told in fault.line
