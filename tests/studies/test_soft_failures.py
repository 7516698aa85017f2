"""Each failure of soft shadows is seen best by a metric of its own."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from soft_failures import failure_table


@pytest.mark.slow
def test_each_failure_of_a_soft_shadow_has_its_metric(shadowbench: Callable[..., Any], tmp_path: Path) -> None:
    assert shadowbench("run", "-s", "soft-failures", "-o", str(tmp_path / "run")).code == 0
    errors = failure_table(tmp_path / "run").to_numpy()
    others = np.where(np.eye(len(errors), dtype=bool), 0.0, errors).max(axis=1)
    assert np.diag(errors) == pytest.approx(1.0)  # the largest of its column
    assert (others < 0.95).all()
