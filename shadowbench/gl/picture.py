"""The shaded picture (Blinn-Phong, anti-aliased where surfaces meet), with textures: to look at, never scored."""

import logging
import math
from dataclasses import asdict, dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from shadowbench.errors import InputError
from shadowbench.gl.device import Device, moderngl
from shadowbench.gl.gbuffer import GBuffer, download
from shadowbench.gl.geometry import TRIANGLE_DEFINES, TRIANGLE_ROW, DeviceGeometry, triangle_texels
from shadowbench.gl.program import SHADERS, Drawable, Sampling, Textures, compose, link
from shadowbench.scenes.cutouts import WRAPS
from shadowbench.scenes.images import opened_image, read_square
from shadowbench.scenes.model import View
from shadowbench.scenes.triangles import Geometry, Texture, in_slices
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
        self._textures = shown_textures(geometry.geometry)
        self._white = device.context.texture((1, 1), 4, b"\xff" * 4)
        self._shade, self._antialias = (self._fullscreen(name) for name in ("shade", "antialias"))

    def _fullscreen(self, fragment: str) -> Drawable:
        defines = {**TRIANGLE_DEFINES, **self._geometry.smooth_defines, **({"TEXTURED": "1"} if self._textures else {})}
        vertex, text = compose("fullscreen.vert", SHADERS), compose(f"picture/{fragment}.frag", SHADERS, defines)
        program = link(self._device, vertex, text)
        return Drawable(program, self._device.context.vertex_array(program.linked, []), count=3)

    @cached_property
    def _layers(self) -> Textures:
        """Images of `picture/texture.glsl`, from the first picture on."""
        return base_color_layers(self._device, self._textures) if self._textures else {}

    @cached_property
    def _places(self) -> Textures:
        """Where they lie on the triangles."""
        return base_color_places(self._device, self._geometry.geometry, self._textures) if self._textures else {}

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
            **self._layers,
            **self._places,
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
        for name in ("_layers", "_places"):
            self._device.free(texture for texture, _ in self.__dict__.pop(name, {}).values())
        self._device.free((*(part for one in drawables for part in (one.vertices, one.program.linked)), self._white))


LARGEST_SIDE = 1024
"""Limit in texels on the sides to which textures are shrunk; all have the same."""
MOST_TEXELS = 1 << 25
"""Limit on the texels of all of them: 32 of LARGEST_SIDE."""
_MOST_LAYERS = 2048  # what OpenGL 4.1 guarantees
_NOT_READ = np.array([128, 128, 128, 255], dtype=np.uint8)


def shown_textures(geometry: Geometry) -> list[Texture]:
    """The textures of triangles that `base_color_layers` takes."""
    return list({id(each.texture): each.texture for each in geometry.textured}.values())[:_MOST_LAYERS]


def base_color_layers(device: Device, shown: list[Texture]) -> Textures:
    """Images of `picture/texture.glsl`, decoded now. A line in the log, and grey, for one that is not read."""
    side = _side(shown)
    texels = b"".join(_texels(one, side).tobytes() for one in shown)
    layers = device.context.texture_array((side, side, len(shown)), 4, texels)
    layers.build_mipmaps()
    return {"textures": (layers, Sampling(linear=True, wrap="repeat", mips=True))}


def base_color_places(device: Device, geometry: Geometry, shown: list[Texture]) -> Textures:
    """Textures of `picture/texture.glsl` by triangle: which of the images it has, and where they lie on it."""
    context = device.context
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
        "texture_numbers": (context.texture(size, 1, number_texels.tobytes(), dtype="i4"), Sampling()),
        "texture_maps": (context.texture((2 * size[0], size[1]), 4, map_texels.tobytes(), dtype="f4"), Sampling()),
    }


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


def _side(textures: list[Texture]) -> int:
    """The side of all textures: the largest of theirs, as far as the limits allow."""
    largest = max(max(_size(texture)) for texture in textures)
    return min(largest, LARGEST_SIDE, math.isqrt(MOST_TEXELS // len(textures)))


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
