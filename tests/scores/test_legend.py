import numpy as np
import pytest

from shadowbench.scores.difference import FALSE_LIGHT, FALSE_SHADOW, with_legend


@pytest.mark.parametrize("width", [1, 64, 512])
def test_a_legend_runs_from_false_shadow_to_false_light(width: int) -> None:
    picture = with_legend(np.full((9, width, 3), 7, np.uint8))
    assert (picture[:9] == 7).all() and picture.shape[1:] == (width, 3) and len(picture) > 20
    assert tuple(picture[9, 0]) == FALSE_SHADOW
    if width > 1:
        assert tuple(picture[9, -1]) == FALSE_LIGHT
