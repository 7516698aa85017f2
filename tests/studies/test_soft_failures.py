"""Each failure of soft shadows is seen best by a metric of its own."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

# What each row of the study draws wrongly, in its order, by the metric that is to see it: a variance map without
# reduction, a bias that is too small, two random taps, six taps in place, a hard edge, and a kernel of fixed width.
METRICS = ["bleed", "false_dark", "noise", "banding", "width", "hardening"]


@pytest.mark.slow
def test_each_failure_of_a_soft_shadow_has_its_metric(shadowbench: Callable[..., Any], tmp_path: Path) -> None:
    assert shadowbench("run", "-s", "soft-failures", "-o", str(tmp_path / "run")).code == 0
    table = pd.read_csv(tmp_path / "run" / "table.csv")
    errors = table[METRICS].abs()
    errors["hardening"] = (table["hardening"] - 1).abs()
    shares = (errors / errors.max()).to_numpy()
    others = np.where(np.eye(len(shares), dtype=bool), 0.0, shares).max(axis=1)
    assert np.diag(shares) == pytest.approx(1.0)  # the largest of its column
    assert (others < 0.95).all()
