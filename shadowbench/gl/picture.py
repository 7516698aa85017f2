"""The shaded picture (Blinn-Phong): for people to look at, never scored."""

import moderngl
import numpy as np
from numpy.typing import NDArray

from shadowbench.data import data_folder
from shadowbench.gl.device import Device
from shadowbench.gl.gbuffer import GBuffer, download
from shadowbench.gl.geometry import TRIANGLE_DEFINES, DeviceGeometry
from shadowbench.gl.program import Drawable, Sampling, link
from shadowbench.gl.shaders import compose
from shadowbench.scenes.model import View, unit, vec3


class PicturePass:
    """Shades any view of one geometry with any visibility."""

    def __init__(self, device: Device, geometry: DeviceGeometry) -> None:
        roots = [data_folder("shaders")]
        self._device, self._geometry = device, geometry
        shade = compose("picture/shade.frag", roots, TRIANGLE_DEFINES)
        self._program = link(device, compose("fullscreen.vert", roots), shade)
        self._white = device.context.texture((1, 1), 4, b"\xff" * 4)
        self._triangle = Drawable(self._program, device.context.vertex_array(self._program.linked, []), count=3)

    def draw(
        self, surface: GBuffer, view: View, visibility: moderngl.Texture, tint: moderngl.Texture | None = None
    ) -> NDArray[np.uint8]:
        """(N, N, 3) uint8 sRGB, row 0 at the top: ambient + visibility · (diffuse + specular).

        `tint`, a texture of the picture's size, is multiplied into the surfaces' colours.
        """
        xyz, w = view.light.homogeneous
        self._program.set(
            light=(*xyz, w),
            eye=view.camera.position,
            cone_axis=vec3(unit(view.light.direction)),
            cos_half_angle=view.light.cos_half_angle,
        )
        color = self._device.context.texture((view.size, view.size), 4, dtype="f1")
        target = self._device.context.framebuffer([color])
        inputs = {
            **surface.inputs,
            "surface_triangle": (surface.triangle, Sampling()),
            "colors": (self._geometry.colors, Sampling()),
            "visibility": (visibility, Sampling()),
            "tint": (tint or self._white, Sampling()),
        }
        self._triangle.draw(target, inputs)
        picture = download(color, "u1")[..., :3].astype(np.uint8)
        self._device.free((target, color))
        return picture

    def release(self) -> None:
        """Free the program."""
        self._device.free((self._triangle.vertices, self._program.linked, self._white))
