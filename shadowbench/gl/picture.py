"""The shaded picture (Blinn-Phong, anti-aliased where surfaces meet): to look at, never scored."""

from dataclasses import asdict, dataclass

import numpy as np
from numpy.typing import NDArray

from shadowbench.gl.device import Device, moderngl
from shadowbench.gl.gbuffer import GBuffer, download
from shadowbench.gl.geometry import TRIANGLE_DEFINES, DeviceGeometry
from shadowbench.gl.program import SHADERS, Drawable, Sampling, compose, link
from shadowbench.scenes.model import View
from shadowbench.scenes.vectors import Vec3, unit, vec3


@dataclass(frozen=True)
class Shading:
    """Coefficients of Blinn-Phong, the exponent of its highlight, and linear RGB colours.

    sky, ground: of ambient light from above and from below; horizon, zenith: behind the scene.
    """

    ambient: float = 1.0
    diffuse: float = 1.0
    specular: float = 0.12
    shininess: float = 32.0
    light_color: Vec3 = (0.86, 0.82, 0.76)
    sky: Vec3 = (0.13, 0.17, 0.25)
    ground: Vec3 = (0.085, 0.075, 0.06)
    horizon: Vec3 = (0.28, 0.36, 0.46)
    zenith: Vec3 = (0.11, 0.18, 0.32)


DEFAULT_SHADING = Shading()


class PicturePass:
    """Shades any view of one geometry with any visibility."""

    def __init__(self, device: Device, geometry: DeviceGeometry) -> None:
        self._device, self._geometry = device, geometry
        self._white = device.context.texture((1, 1), 4, b"\xff" * 4)
        self._shade, self._antialias = (self._fullscreen(name) for name in ("shade", "antialias"))

    def _fullscreen(self, fragment: str) -> Drawable:
        defines = {**TRIANGLE_DEFINES, **self._geometry.smooth_defines}
        vertex, text = compose("fullscreen.vert", SHADERS), compose(f"picture/{fragment}.frag", SHADERS, defines)
        program = link(self._device, vertex, text)
        return Drawable(program, self._device.context.vertex_array(program.linked, []), count=3)

    def draw(
        self, surface: GBuffer, view: View, visibility: moderngl.Texture, tint: moderngl.Texture | None = None
    ) -> NDArray[np.uint8]:
        """(N, N, 3) uint8 sRGB, row 0 at the top: the picture that `shade` draws."""
        smooth = self.shade(surface, view, visibility, tint)
        picture = download(smooth, "u1")[..., :3].astype(np.uint8)
        self._device.free((smooth,))
        return picture

    def shade(
        self,
        surface: GBuffer,
        view: View,
        visibility: moderngl.Texture,
        tint: moderngl.Texture | None = None,
        shading: Shading = DEFAULT_SHADING,
    ) -> moderngl.Texture:
        """A texture (N, N) of sRGB bytes, which the caller releases: ambient + visibility · (diffuse + specular).

        `tint`, a texture of the picture's size, is multiplied into the surfaces' colours.
        """
        xyz, w = view.light.homogeneous
        self._shade.program.set(
            light=(*xyz, w),
            eye=view.camera.position,
            cone_axis=vec3(unit(view.light.direction)),
            cos_half_angle=view.light.cos_half_angle,
            **asdict(shading),
        )
        shaded, smooth = (self._device.context.texture((view.size, view.size), 4, dtype="f1") for _ in range(2))
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
            even = np.full((view.size, view.size), level, dtype=np.float32)
            visibility = self._device.context.texture(even.shape, 1, even.tobytes(), dtype="f4")
            pictures.append(self.draw(surface, view, visibility))
            self._device.free((visibility,))
        return pictures[0], pictures[1]

    def release(self) -> None:
        """Free the programs and textures."""
        drawables = (self._shade, self._antialias)
        self._device.free((*(part for one in drawables for part in (one.vertices, one.program.linked)), self._white))
