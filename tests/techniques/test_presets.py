"""The default shadow map compared with published presets, over all built-in scenes with a sun.

One phase, and 512² pictures, which take a quarter of the time of `run -s presets` and rank alike.
"""

import numpy as np
import pytest

from shadowbench.plugin.registry import techniques
from shadowbench.scenes.library import hard_names, load_scene
from tests.samples import sampled

SUNNY = [name for name in hard_names() if load_scene(name).lights[0].kind == "directional"]
PRESETS = list(techniques()["shadow-map"].presets)
VIEW_SIZE = 512
SIZES = [512, 1024, 2048, 4096]

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def kept() -> dict[tuple[str, int], dict[str, float]]:
    """Mean scores, by spec and map size."""
    return {}


@pytest.fixture
def mean(kept, builtin, truth_of, studio, build, scored):
    """The mean scores of a spec at a map size over the sunny scenes."""

    def of(items: str, size: int) -> dict[str, float]:
        if (items, size) not in kept:
            rows = []
            for name in SUNNY:
                shot = studio.shot(builtin(name, VIEW_SIZE))
                built = build(f"shadow-map:{items}size={size}", shot)
                rows.append(scored(built.draw(shot), truth_of(name, VIEW_SIZE)))
                built.stage.release()
            kept[items, size] = {key: float(np.mean([row[key] for row in rows])) for key in ("iou", "ssim")}
        return kept[items, size]

    return of


@pytest.mark.parametrize("size", sampled(SIZES, [512, 2048]))
def test_the_default_errs_at_most_half_as_much_as_the_course_preset(mean, size: int) -> None:
    assert 1 - mean("", size)["iou"] <= (1 - mean("preset=course,", size)["iou"]) / 2


@pytest.mark.parametrize("size", sampled(SIZES, [512, 2048]))
@pytest.mark.parametrize("preset", PRESETS)
def test_the_default_beats_every_preset(mean, preset: str, size: int) -> None:
    default, other = mean("", size), mean(f"preset={preset},", size)
    assert default["iou"] > other["iou"]
    assert default["ssim"] > other["ssim"]
