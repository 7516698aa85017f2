"""A tiny light casts the shadows of one without a size."""

from dataclasses import replace

import numpy as np
import pytest

from shadowbench.scenes.model import Light, View
from shadowbench.scenes.opening import chosen_view
from shadowbench.scenes.vectors import vec3
from shadowbench.truths.trace import trace

TINY = 1e-9  # of the light's distance


def lit_by(name: str, kind: str) -> View:
    """A built-in scene whose middle is lit by a hard light of a kind, from where its own light is."""
    view = chosen_view(name, 64)
    low, high = view.scene.geometry.bounds
    middle, light = (low + high) / 2, view.light
    sun = light.kind == "directional"
    position = middle - np.multiply(light.direction, np.linalg.norm(high - low)) if sun else np.array(light.position)
    angle = np.radians(100.0) if kind == "spot" else 0.0
    return replace(view, light=Light(kind, kind, vec3(middle - position), vec3(position), angle))


@pytest.mark.parametrize(
    ("kind", "name"),
    [("directional", "colonnade"), ("spot", "spot-lamp"), ("point", "colonnade"), ("disc", "spot-lamp"),
     ("rectangle", "colonnade")],
)  # fmt: skip
def test_a_tiny_light_casts_the_shadows_of_one_without_a_size(kind, name) -> None:
    view = lit_by(name, kind)
    hard, distance = trace(view, pixel_samples=1), float(np.linalg.norm(view.light.direction))
    for share in (TINY, 1e3 * TINY):
        radius = share if kind == "directional" else share * distance
        sized = {"size": (radius, 2 * radius)} if kind == "rectangle" else {"radius": radius}
        tiny = trace(replace(view, light=replace(view.light, **sized)), pixel_samples=1)
        decided = ~hard.undecided & ~tiny.undecided
        assert (hard.receivers == tiny.receivers).all()
        assert decided[hard.receivers].mean() > 0.97
        assert set(np.unique(hard.visibility[decided & hard.receivers])) == {0, 1}
        assert (hard.visibility == tiny.visibility)[decided].all()
