"""The shaded picture under a spot light."""

import math
from dataclasses import replace

import numpy as np
import pytest

from shadowbench.gl.device import Device
from shadowbench.gl.picture import PicturePass
from shadowbench.scenes.model import Camera, Light, Scene, view_of

SPOT = Light("spot", "spot", (-0.5, -1.0, 0.25), (1.0, 2.0, -0.5), math.radians(40.0))


def picture(device: Device, studio, meshes, light: Light) -> np.ndarray:
    camera = Camera("camera", (2.3, 4.0, 3.4), (0.0, 0.0, 0.0), 0.9)
    shot = studio.shot(view_of(Scene("spot", tuple(meshes), (camera,), (light,)), camera, light, 64))
    white = device.context.texture((64, 64), 1, np.ones((64, 64), dtype=np.float32).tobytes(), dtype="f4")
    shading = PicturePass(device, shot.geometry)
    found = shading.draw(shot.surface, shot.view, white)
    shading.release()
    device.free((white,))
    return found


@pytest.mark.parametrize("length", [1e-320, 1e-170, 1e-40, 1e17, 1e200])
def test_the_length_of_its_direction_changes_nothing(device: Device, studio, shape, length: float) -> None:
    meshes = [shape("plane", 8.0)]
    usual = picture(device, studio, meshes, SPOT)
    assert np.ptp(usual[..., 1]) > 100, "lit within the cone, dark outside"
    longer = replace(SPOT, direction=(-0.5 * length, -1.0 * length, 0.25 * length))
    assert np.mean(picture(device, studio, meshes, longer) != usual) < 1e-3
