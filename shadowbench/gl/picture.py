"""The shaded picture (Blinn-Phong, anti-aliased where surfaces meet): to look at, never scored."""

import numpy as np
from numpy.typing import NDArray

from shadowbench.gl.device import Device, moderngl
from shadowbench.gl.gbuffer import DeviceGeometry, GBuffer, download
from shadowbench.gl.program import Sampling, fullscreen
from shadowbench.scenes.model import View
from shadowbench.scenes.vectors import unit, vec3


class PicturePass:
    """Shades any view of one geometry with any visibility."""

    def __init__(self, device: Device, geometry: DeviceGeometry) -> None:
        self._device, self._geometry = device, geometry
        self._white = device.context.texture((1, 1), 4, b"\xff" * 4)
        self._shade = fullscreen(device, "picture/shade.frag", geometry.defines)
        self._antialias = fullscreen(device, "picture/antialias.frag")

    def draw(
        self, surface: GBuffer, view: View, visibility: moderngl.Texture, tint: moderngl.Texture | None = None
    ) -> NDArray[np.uint8]:
        """(H, W, 3) uint8 sRGB, row 0 at the top: the picture that `shade` draws."""
        smooth = self.shade(surface, view, visibility, tint)
        picture = download(smooth, "u1")[..., :3].astype(np.uint8)
        self._device.free((smooth,))
        return picture

    def shade(
        self, surface: GBuffer, view: View, visibility: moderngl.Texture, tint: moderngl.Texture | None = None
    ) -> moderngl.Texture:
        """A texture of sRGB bytes, which the caller releases: ambient + visibility · (diffuse + specular).

        `tint`, a texture of the picture's size, is multiplied into the surfaces' colours.
        """
        xyz, w = view.light.homogeneous
        self._shade.program.set(
            light=(*xyz, w),
            eye=view.camera.eye,
            cone_axis=vec3(unit(view.light.direction)),
            cos_half_angle=view.light.cos_half_angle,
        )
        shaded, smooth = (self._device.context.texture(view.size, 4, dtype="f1") for _ in range(2))
        targets = [self._device.context.framebuffer([texture]) for texture in (shaded, smooth)]
        inputs = {
            **surface.inputs,
            "surface_triangle": (surface.triangle, Sampling()),
            "colors": (self._geometry.colors, Sampling()),
            "visibility": (visibility, Sampling()),
            "tint": (tint or self._white, Sampling()),
        }
        self._shade.draw(targets[0], inputs)
        self._antialias.draw(targets[1], {**surface.inputs, "shaded": (shaded, Sampling(linear=True))})
        self._device.free((*targets, shaded))
        return smooth

    def extremes(self, surface: GBuffer, view: View) -> tuple[NDArray[np.uint8], NDArray[np.uint8]]:
        """The view lit everywhere and in shadow everywhere, as `draw` gives them; every mask's picture lies between."""
        pictures = []
        for level in (1.0, 0.0):
            even = np.full(view.size.shape, level, dtype=np.float32)
            visibility = self._device.context.texture(view.size, 1, even.tobytes(), dtype="f4")
            pictures.append(self.draw(surface, view, visibility))
            self._device.free((visibility,))
        return pictures[0], pictures[1]

    def release(self) -> None:
        """Free the programs and textures."""
        self._shade.release()
        self._antialias.release()
        self._device.free((self._white,))
