"""A picture that is wider or narrower than another of the same camera shows the same where both show anything."""

from collections.abc import Callable

import numpy as np
import pytest

from shadowbench.scenes.library import load_scene
from shadowbench.scenes.model import View
from shadowbench.truths.trace import trace
from tests.parallel import parallel

HEIGHT = 64
WIDTHS = (128, 32)  # times a power of two, so that not even rounding differs
OF_THE_SCENE = {
    "stairs": [
        *("unshadowed", "ray-traced", "shadow-volume", "planar-projection", "hybrid:fit=scene", "light-samples"),
        *(f"shadow-map:fit=scene,filter={name}" for name in ("hard", "hardware", "pcf", "dither-4", "evsm")),
        *(f"shadow-map:fit=scene,bias={name}" for name in ("receiver-plane", "normal-offset", "slope")),
    ],
    "room-with-lamp": ["cube-map", "shadow-volume", "ray-traced:where=gpu"],
    "spot-lamp": ["shadow-map:fit=scene", "hybrid:fit=scene"],
}
"""Techniques by scene of which a pixel depends on nothing else in the picture."""


def middle(image: np.ndarray, width: int) -> np.ndarray:
    """The columns that are as far from the middle as those of a picture of a width, or all if it is wider."""
    margin = max(image.shape[1] - width, 0) // 2
    return image[:, margin : image.shape[1] - margin]


@pytest.fixture(params=["perspective", "orthographic"])
def seen(builtin: Callable[..., View], request: pytest.FixtureRequest) -> Callable[[str, int], View]:
    def make(name: str, width: int) -> View:
        size = f"{width}x{HEIGHT}"
        return builtin(name, size) if request.param == "perspective" else parallel(load_scene(name), size)

    return make


@pytest.mark.parametrize("name", OF_THE_SCENE)
def test_masks_and_truths_of_two_widths_are_equal_where_pixels_coincide(name, seen, studio, build) -> None:
    square = studio.shot(seen(name, HEIGHT))
    known = trace(square.filed, pixel_samples=1)
    of_square = {spec: build(spec, square).draw(square) for spec in OF_THE_SCENE[name]}
    for width in WIDTHS:
        other = studio.shot(seen(name, width))
        truth = trace(other.filed, pixel_samples=1)
        for field in ("visibility", "receivers", "undecided", "triangle"):
            one, two = middle(getattr(known, field), width), middle(getattr(truth, field), HEIGHT)
            assert np.array_equal(one, two), (field, width)
        for spec, mask in of_square.items():
            drawn = build(spec, other).draw(other)
            assert drawn.shape == (HEIGHT, width)
            assert np.abs(middle(mask, width) - middle(drawn, HEIGHT)).max() <= 1 / 255, (spec, width)


@pytest.mark.parametrize("size", ["256x96", "64x192"])
@pytest.mark.parametrize("spec", ["shadow-map", "shadow-map:fit=view", "cascades", "cascades:box=sphere,select=depth"])
def test_a_map_that_follows_the_view_covers_all_of_a_rectangle(spec, size, builtin, studio, build) -> None:
    """What it leaves out would be lit."""
    shot = studio.shot(builtin("street", size))
    truth = trace(shot.filed, pixel_samples=1)
    mask = build(f"{spec},size=2048" if ":" in spec else f"{spec}:size=2048", shot).draw(shot)
    shadow = (truth.visibility < 0.5) & truth.receivers & ~truth.undecided
    for side in (shadow[:, : shadow.shape[1] // 4], shadow[:, -shadow.shape[1] // 4 :]):
        assert side.any()
    assert (mask[shadow] < 0.5).mean() > 0.98
