"""The subset of long parameter lists that `make test-slow` runs; `make test-all` runs every parameter."""

from collections.abc import Collection, Iterable
from typing import Any

import pytest


def sampled(values: Iterable[Any], sample: Collection[Any]) -> list[Any]:
    """Arguments of `parametrize`, a tuple for several; those outside the sample are marked `exhaustive`."""
    values = list(values)
    assert set(sample) <= set(values)
    return [
        pytest.param(
            *(value if isinstance(value, tuple) else (value,)), marks=[] if value in sample else pytest.mark.exhaustive
        )
        for value in values
    ]
