"""A small crowd, expanded and as a scene of many triangles has it: three shapes, seven times each, on a ground."""

from pathlib import Path

import pytest

from shadowbench.scenes.library import load_scene
from shadowbench.scenes.model import Scene

_SHAPES = (
    'shape = "torus"\nsections = 24\nscale = [0.7, 0.9, 0.5]',
    'shape = "sphere"\nsubdivisions = 3\nsmooth = true\nscale = [0.4, 0.7, -0.5]',
    'shape = "box"\nscale = [0.3, 1.1, 0.4]\nplanar = true',
)
CROWD = """
name = "small-crowd"
[camera]
position = [4.0, 3.0, 6.0]
target = [0.0, 0.4, 0.0]
fov_y = 40
[[light]]
name = "sun"
kind = "directional"
direction = [0.5, -1.0, -0.4]
[[light]]
name = "low"
kind = "directional"
direction = [1.0, -0.06, -0.3]
[[light]]
name = "lamp"
kind = "point"
position = [0.3, 1.6, 0.2]
[[light]]
name = "close"
kind = "point"
position = [-1.7, 0.65, -0.4]
[[light]]
name = "spot"
kind = "spot"
position = [1.0, 4.0, 2.0]
direction = [0.0, -1.0, -0.3]
angle = 70
[[mesh]]
shape = "plane"
scale = [12, 1, 12]
""" + "".join(
    f"""
[[mesh]]
{shape}
color = [0.9, {0.2 + 0.3 * k}, 0.3]
translate = [{-2.3 + 0.4 * k}, 0.55, {-1.4 + 1.3 * k}]
rotate = [{10 * k}, {35 * k + 7}, {5 * k}]
repeat = [{{ count = 7, step = [0.72, 0.013, 0.07] }}]
"""
    for k, shape in enumerate(_SHAPES)
)


def expanded_and_instanced(path: Path, monkeypatch: pytest.MonkeyPatch) -> tuple[Scene, Scene]:
    """The scene of a file, and as it would be if it had more triangles than one list may have."""
    flat = load_scene(path)
    with monkeypatch.context() as patch:
        patch.setattr("shadowbench.scenes.placed.MOST_TRIANGLES", flat.geometry.count - flat.geometry.count // 4)
        return flat, load_scene(path)
