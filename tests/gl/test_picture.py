"""Pictures for people: what of a light they may depend on."""

from dataclasses import replace

import numpy as np
import pytest

from shadowbench.gl.picture import PicturePass


@pytest.mark.parametrize("length", [0.1, 0.5, 2.0, 30.0])
def test_a_spot_s_cone_is_as_wide_however_long_its_direction_is(studio, builtin, device, length: float) -> None:
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
