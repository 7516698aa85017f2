"""Difference pictures."""

import numpy as np
import pytest

from shadowbench.scores.difference import difference_over, weight


def test_false_shadow_is_vermillion_and_false_light_blue():
    """As Okabe and Ito (2008) give them; the weaker the error, the more of the picture is left."""
    for sign, color in [(-1, "d55e00"), (1, "0072b2")]:
        signed = sign * np.array([[0.0, 0.5, 1.0]])
        red, green, blue = bytes.fromhex(color)
        expected = [[200, 200, 200], [(200 + red) / 2, (200 + green) / 2, (200 + blue) / 2], [red, green, blue]]
        assert difference_over(np.full((1, 3), 200.0), signed)[0].tolist() == np.rint(expected).tolist()


def test_small_errors_of_soft_shadows_are_seen_with_their_sign() -> None:
    errors = np.array([-0.25, -0.01, 0.0, 0.01, 1.0])
    assert weight(errors, soft=True) == pytest.approx([-0.5, -0.1, 0, 0.1, 1])
    assert weight(errors, soft=False).tolist() == errors.tolist()
