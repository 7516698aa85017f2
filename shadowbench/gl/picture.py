"""The shaded picture (Blinn-Phong, anti-aliased where surfaces meet), with textures: to look at, never scored."""

import logging
import math
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from shadowbench.errors import InputError
from shadowbench.gl.device import Device, moderngl
from shadowbench.gl.gbuffer import TRIANGLE_ROW, DeviceGeometry, GBuffer, download, triangle_texels
from shadowbench.gl.program import Sampling, Textures, fullscreen
from shadowbench.scenes.cutouts import WRAPS
from shadowbench.scenes.images import opened_image, read_square
from shadowbench.scenes.model import View
from shadowbench.scenes.triangles import Texture, in_slices
from shadowbench.scenes.vectors import unit, vec3


class PicturePass:
    """Shades any view of one geometry with any visibility."""

    def __init__(self, device: Device, geometry: DeviceGeometry) -> None:
        self._device, self._geometry = device, geometry
        textures = {id(each.texture): each.texture for each in geometry.geometry.textured}
        self._textures = list(textures.values())[:_MOST_LAYERS]
        self._white = device.context.texture((1, 1), 4, b"\xff" * 4)
        defines = {**geometry.defines, **({"TEXTURED": "1"} if self._textures else {})}
        self._shade = fullscreen(device, "picture/shade.frag", defines)
        self._antialias = fullscreen(device, "picture/antialias.frag")

    def draw(
        self, surface: GBuffer, view: View, visibility: moderngl.Texture, tint: moderngl.Texture | None = None
    ) -> NDArray[np.uint8]:
        """(N, N, 3) uint8 sRGB, row 0 at the top: the picture that `shade` draws."""
        smooth = self.shade(surface, view, visibility, tint)
        picture = download(smooth, "u1")[..., :3].astype(np.uint8)
        self._device.free((smooth,))
        return picture

    def shade(
        self, surface: GBuffer, view: View, visibility: moderngl.Texture, tint: moderngl.Texture | None = None
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
        )
        if self._textures:
            right, up, back = view.camera.basis()
            pixel = 2 * np.tan(view.camera.fov_y / 2) / view.size
            self._shade.program.set(forward=vec3(-back), pixel_right=vec3(right * pixel), pixel_up=vec3(up * pixel))
        shaded, smooth = (self._device.context.texture((view.size, view.size), 4, dtype="f1") for _ in range(2))
        targets = [self._device.context.framebuffer([texture]) for texture in (shaded, smooth)]
        inputs = {
            **surface.inputs,
            "surface_triangle": (surface.triangle, Sampling()),
            "colors": (self._geometry.colors, Sampling()),
            "visibility": (visibility, Sampling()),
            "tint": (tint or self._white, Sampling()),
            **self._base_colors,
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

    @cached_property
    def _base_colors(self) -> Textures:
        """Textures of `picture/texture.glsl`, decoded for the first: images, and where they lie on triangles."""
        if not (shown := self._textures):
            return {}
        context, geometry = self._device.context, self._geometry.geometry
        largest = max(max(_size(texture)) for texture in shown)
        side = min(largest, LARGEST_SIDE, math.isqrt(MOST_TEXELS // len(shown)))
        layers = context.texture_array(
            (side, side, len(shown)), 4, b"".join(_texels(one, side).tobytes() for one in shown)
        )
        layers.build_mipmaps()
        numbers = np.zeros(len(geometry.faces), dtype=np.int32)
        maps = np.zeros((len(geometry.faces), 2, 4), dtype=np.float32)
        for first, texture, coordinates in geometry.textured:
            if texture in shown:
                wraps = [WRAPS.index(wrap) for wrap in texture.wrap]
                numbers[first : first + len(coordinates)] = 1 + 9 * shown.index(texture) + 3 * wraps[0] + wraps[1]
            for part in in_slices(len(coordinates)):
                triangles = slice(first + part.start, first + part.stop)
                maps[triangles] = _affine_maps(geometry.vertices[geometry.faces[triangles]], coordinates[part])
        number_texels, map_texels = triangle_texels(numbers), triangle_texels(maps)
        size = TRIANGLE_ROW, len(number_texels)
        return {
            "textures": (layers, Sampling(linear=True, wrap="repeat", mips=True)),
            "texture_numbers": (context.texture(size, 1, number_texels.tobytes(), dtype="i4"), Sampling()),
            "texture_maps": (context.texture((2 * size[0], size[1]), 4, map_texels.tobytes(), dtype="f4"), Sampling()),
        }

    def release(self) -> None:
        """Free the programs and textures."""
        self._shade.release()
        self._antialias.release()
        decoded = self.__dict__.pop("_base_colors", {})
        self._device.free((self._white, *(texture for texture, _ in decoded.values())))


LARGEST_SIDE = 1024
"""Limit in texels on the sides to which textures are shrunk; all have the same."""
MOST_TEXELS = 1 << 25
"""Limit on the texels of all of them: 32 of LARGEST_SIDE."""
_MOST_LAYERS = 2048  # what OpenGL 4.1 guarantees
_NOT_READ = np.array([128, 128, 128, 255], dtype=np.uint8)


def _affine_maps(corners: NDArray[np.float64], coordinates: NDArray[np.float32]) -> NDArray[np.float64]:
    """(K, 2, 4) for u and v of triangles: their gradient by the position on the triangle's plane, and their value at 0.

    corners: (K, 3, 3) positions; coordinates: (K, 3, 2).
    """
    first, second = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    normal = np.cross(first, second)
    places = coordinates.astype(np.float64)
    steps = places[:, 1:] - places[:, :1]
    # The gradients of the barycentric weights of the second and third corner.
    weights = np.stack([np.cross(second, normal), np.cross(normal, first)], axis=1)
    squares = np.einsum("ki,ki->k", normal, normal)
    gradients = np.einsum("kwc,kwi->kci", steps, weights) / np.where(squares > 0.0, squares, 1.0)[:, None, None]
    values = places[:, 0] - np.einsum("kci,ki->kc", gradients, corners[:, 0])
    return np.concatenate([gradients, values[..., None]], axis=2)


def _size(texture: Texture) -> tuple[int, int]:
    try:
        with opened_image(texture.content, texture.where) as image:
            return image.size
    except InputError:  # which `_texels` tells
        return (1, 1)


def _texels(texture: Texture, side: int) -> NDArray[np.uint8]:
    try:
        return read_square(texture.content, texture.where, side, texture.opaque)
    except InputError as error:
        logging.getLogger("shadowbench").error("%s: drawn grey", error)
        return np.broadcast_to(_NOT_READ, (side, side, 4))
