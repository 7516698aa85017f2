"""Textures of base colours on the device, for pictures: all in one array, and where they lie on the triangles."""

import logging
import math

import numpy as np
from numpy.typing import NDArray

from shadowbench.errors import InputError
from shadowbench.gl.device import Device
from shadowbench.gl.geometry import TRIANGLE_ROW, triangle_texels
from shadowbench.gl.program import Sampling, Textures
from shadowbench.scenes.cutouts import WRAPS
from shadowbench.scenes.images import opened_image, read_square
from shadowbench.scenes.triangles import Geometry, Texture, in_slices

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
