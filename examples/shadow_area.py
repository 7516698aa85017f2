"""A metric in one file: shadowbench run stairs -t shadow-map -t unshadowed --plugin examples/shadow_area.py."""

import numpy as np

from shadowbench.scores import Metric


def shadow_area(comparison):
    """Drawn over true shadow area; None where the truth has no shadow."""
    drawn, true = (np.count_nonzero(shadow) for shadow in (comparison.shadow, comparison.truth.shadow))
    return drawn / true if true else None


SHADOW_AREA = Metric("shadow-area", shadow_area, "near 1", "both", "Area of the drawn over the true shadow.")
