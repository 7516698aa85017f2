"""The truth's own check: no decided pixel is wrong at any value of any axis of `stress`."""

from collections.abc import Callable
from typing import Any

import pytest

from shadowbench.extremes.axes import AXES
from shadowbench.truths.trace import trace

SAME_VIEW = {"depth-format", "map-size"}  # at every value: only parameters change
MANY = 100_000  # triangles from which on fewer pixels are asked
PIXELS, FEWER_PIXELS = 2000, 200

walked = [(name, light) for name, axis in AXES.items() if name not in SAME_VIEW for light in axis.lights]


@pytest.mark.slow
@pytest.mark.timeout(1200)
@pytest.mark.parametrize(("name", "light"), walked)
def test_no_decided_pixel_is_wrong_along_the_axis(name: str, light: Any, judged: Callable[..., Any]) -> None:
    wrong = {}
    for value in AXES[name].values:
        views = AXES[name].at(value, light).views
        for view in dict.fromkeys([views[0], views[-1]]):
            many = len(view.scene.geometry.faces) > MANY
            found = judged(view, trace(view, pixel_samples=1), FEWER_PIXELS if many else PIXELS)
            if found.wrong:
                wrong[value] = found.wrong
    assert wrong == {}
