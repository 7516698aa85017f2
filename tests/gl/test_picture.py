"""Shaded pictures, and the properties of a light that they depend on."""

from dataclasses import replace

import numpy as np
import pytest

from shadowbench.gl.picture import PicturePass


@pytest.mark.parametrize("length", [1e-320, 30.0, 1e200])
def test_a_spot_s_cone_is_as_wide_however_long_its_direction_is(studio, builtin, device, length) -> None:
    """Scene files give directions of any length."""
    shot = studio.shot(builtin("spot-lamp", 96))
    light = shot.view.light
    visible = device.context.texture((96, 96), 1, np.ones((96, 96), "f4").tobytes(), dtype="f4")
    painter = PicturePass(device, shot.geometry)
    longer, dark = (
        replace(light, direction=tuple(length * np.array(light.direction))),
        replace(light, angle=1e-3),  # a cone that holds next to nothing
    )
    unit_cone, same_cone, no_cone = (
        painter.draw(shot.surface, replace(shot.view, light=one), visible).astype(int) for one in (light, longer, dark)
    )
    painter.release()
    device.free((visible,))
    assert (np.abs(same_cone - unit_cone) > 1).mean() < 1e-3, "rounding decides for pixels on the border alone"
    assert (np.abs(no_cone - unit_cone) > 1).any(axis=-1).mean() > 0.1, "the picture shows what the cone lights"


@pytest.fixture
def painted(studio, builtin, device):
    """Draws a view with visibility, row 0 at the top; with None, lit and shadowed everywhere. Gives its surface too."""

    def paint(name: str, visibility: np.ndarray | None):
        shot = studio.shot(builtin(name, 128))
        painter = PicturePass(device, shot.geometry)
        if visibility is None:
            picture = painter.extremes(shot.surface, shot.view)
        else:
            texture = device.context.texture((128, 128), 1, visibility[::-1].astype("f4").tobytes(), dtype="f4")
            picture = painter.draw(shot.surface, shot.view, texture)
            device.free((texture,))
        painter.release()
        return picture, shot.surface

    return paint


def test_a_shadow_s_edge_keeps_its_pixels_and_a_surface_s_edge_is_smooth(painted) -> None:
    checks = np.indices((128, 128)).sum(axis=0) % 2
    (lit, ambient), surface = painted("cube-on-plane", None)
    drawn, _ = painted("cube-on-plane", checks)
    ids = surface.triangles()
    inner = np.ones((128, 128), dtype=bool)
    for axis in (0, 1):
        for by in (-1, 1):
            inner &= np.roll(ids, by, axis) == ids
    inner[[0, -1]] = inner[:, [0, -1]] = False
    expected = np.where(checks[..., None] == 1, lit, ambient)
    assert inner.mean() > 0.5 and np.array_equal(drawn[inner], expected[inner])
    sky = ids < 0
    edge = (sky & ~np.roll(sky, -1, axis=0))[:-1]
    assert edge.sum() > 20
    above, here = lit[:-2][edge[1:]].astype(int), lit[1:-1][edge[1:]].astype(int)
    assert (np.abs(here - above).max(axis=-1) > 3).mean() > 0.5, "the last pixel of the sky has taken from the ground"
