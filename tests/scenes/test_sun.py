"""--sun: the sun's size for suns that have none."""

import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np

from shadowbench.scenes.assumed import with_sun
from shadowbench.scenes.library import load_scene
from shadowbench.scenes.model import Light

NOTE = "no size of light in cube-on-plane: assumed the sun's angular radius, 0.2665°"


def test_only_directional_lights_without_a_size_get_the_sun_s() -> None:
    cube = load_scene("cube-on-plane")
    wide = Light("wide", "directional", (0.0, -1.0, 0.0), radius=0.1)
    lamp = Light("lamp", "point", position=(0.0, 3.0, 0.0))
    scene = with_sun(replace(cube, lights=(*cube.lights, wide, lamp)))
    assert [light.radius for light in scene.lights] == [math.radians(0.2665), 0.1, 0.0]
    assert scene.notes == (NOTE,)
    nothing = with_sun(replace(cube, lights=(lamp,)))
    assert nothing.lights == (lamp,) and "no directional light without a size" in nothing.notes[0]


def test_a_truth_under_the_sun_has_penumbrae_and_a_note_says_why(shadowbench: Callable, tmp_path: Path) -> None:
    def visibility(*words: str) -> tuple[np.ndarray, str]:
        answer = shadowbench("truth", "cube-on-plane", "-o", tmp_path / "a.npz", "--view-size", "96", *words)
        assert answer.code == 0
        return np.load(tmp_path / "a.npz")["visibility"], answer.err

    hard, silent = visibility()
    soft, said = visibility("--sun")
    assert set(np.unique(hard)) == {0.0, 1.0} and NOTE not in silent
    assert ((soft > 0.02) & (soft < 0.98)).any() and f"note: {NOTE}\n" in said
