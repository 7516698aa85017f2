"""The inputs that each pass declares, which totals for a still scene, a moving camera and a moving light rely on."""

from collections.abc import Iterator
from contextlib import contextmanager

import moderngl
import numpy as np
import pytest

from shadowbench.gl.program import Drawable
from shadowbench.plugin.base import Frame, Phase
from shadowbench.plugin.registry import own_techniques
from shadowbench.scenes.model import Camera, Light, view_of

LIGHTS = {
    "directional": Light("sun", "directional", (0.5, -1.0, -0.3)),
    "spot": Light("spot", "spot", (1.7, -3.0, -1.5), (-1.7, 3.2, 1.3), 1.0),
    "point": Light("point", "point", position=(-1.0, 2.2, 0.8)),
}
CASES = [(one.name, kind) for one in own_techniques() for kind in LIGHTS if kind in one.lights]
# pass: what it depends on, of the specs that have a map to keep while the camera moves, and of those that have none
CHANGES = {
    "unshadowed": {"resolve": "view"},
    "ray-traced": {"download": "view", "trace": "view", "upload": "view"},
    "shadow-map": {"fit": "view", "depth": "view", "resolve": "view"},
    "shadow-map:fit=scene": {"fit": "light", "depth": "light", "resolve": "view"},
    "cube-map": {"depth": "light", "resolve": "view"},
    "cascades": {"fit": "view", "depth": "view", "resolve": "view"},
    "planar-projection": {"flatten": "view"},
}


def seen(builtin, camera: int, light: Light):
    eye, target = [((2.0, 2.6, 3.7), (0.1, 0.45, -0.45)), ((-2.4, 0.8, 2.0), (0.4, 0.3, 0.0))][camera]
    return view_of(builtin("spot-lamp").scene, Camera("camera", eye, target, 0.9), light, 96)


@pytest.mark.parametrize("spec", CHANGES)
def test_passes_depend_on_what_they_must(spec: str, studio, build, builtin) -> None:
    light = LIGHTS["point" if spec == "cube-map" else "directional"]
    shot = studio.shot(seen(builtin, 0, light))
    one = build(spec, shot)
    frame = Frame(shot.view, Phase(0), 0, shot.surface, one.clock)
    assert one.clock.passes(lambda: one.technique.draw(frame)).changes == CHANGES[spec]


@pytest.mark.parametrize(
    ("spec", "kind"),
    [
        *CASES,
        ("shadow-map:fit=scene", "directional"),
        ("shadow-map:fit=fixed", "spot"),
        ("shadow-volume:compare=depth", "point"),
        ("shadow-volume:faces=triangle", "directional"),
    ],
)
def test_passes_that_change_with_the_light_are_not_redrawn_for_another_camera(
    spec: str, kind: str, studio, build, builtin, monkeypatch: pytest.MonkeyPatch
) -> None:
    """With these passes disabled, a moved camera still gives the mask of a fresh build."""
    first, second = (studio.shot(seen(builtin, camera, LIGHTS[kind])) for camera in (0, 1))
    expected = build(spec, second).draw(second)
    one = build(spec, first)
    one.draw(first)
    kept = False

    @contextmanager
    def timed(name: str, changes: str = "frame") -> Iterator[None]:
        nonlocal kept
        kept = changes == "light"
        yield
        kept = False

    draw, clear = Drawable.draw, moderngl.Framebuffer.clear
    monkeypatch.setattr(one.clock, "timed", timed)
    monkeypatch.setattr(Drawable, "draw", lambda *args, **more: None if kept else draw(*args, **more))
    monkeypatch.setattr(moderngl.Framebuffer, "clear", lambda *args, **more: None if kept else clear(*args, **more))
    assert np.array_equal(one.draw(second), expected)
