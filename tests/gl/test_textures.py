"""Textures of base colours in pictures."""

import io
import logging

import numpy as np
import pytest
from PIL import Image

from shadowbench.gl.picture import PicturePass
from shadowbench.scenes.cutouts import WRAPS, cut_out
from shadowbench.scenes.model import Light, Mesh
from shadowbench.scenes.triangles import Texture
from tests.cards import alpha_at

AMBIENT = 0.75 * np.mean([[0.13, 0.17, 0.25], [0.085, 0.075, 0.06]], axis=0)
"""Linear ambient light on a surface that faces +z, as in shade.frag."""
HEADLIGHT = Light("light", "directional", (0.0, 0.0, -1.0))
SIZE = 128
RANDOM = np.random.default_rng(3).integers(0, 256, (4, 8, 3), dtype=np.uint8)


def encoded(texels: np.ndarray) -> bytes:
    stream = io.BytesIO()
    Image.fromarray(texels).save(stream, "PNG")
    return stream.getvalue()


def wall(texture: Texture | None, low: float = 0.0, high: float = 1.0, **more: object) -> Mesh:
    """A square, 1 wide, that faces +z, with u to the right and v downwards."""
    vertices = np.array([[-0.5, -0.5, 0], [0.5, -0.5, 0], [0.5, 0.5, 0], [-0.5, 0.5, 0]])
    corners = np.array([[low, high], [high, high], [high, low], [low, low]], dtype=np.float32)
    faces = np.array([[0, 1, 2], [0, 2, 3]], dtype=np.int32)
    white = (1.0, 1.0, 1.0)
    return Mesh("wall", vertices, faces, **{"color": white, "texture": texture, "coordinates": corners[faces], **more})


@pytest.fixture
def painted(studio, looking, device):
    """The (SIZE, SIZE, 3) picture of a wall that fills it, in ambient light alone, as float."""

    def paint(*meshes: Mesh) -> np.ndarray:
        shot = studio.shot(looking(meshes, HEADLIGHT, SIZE, eye=(0, 0, 0.5), fov=90.0))
        painter = PicturePass(device, shot.geometry)
        _, ambient = painter.extremes(shot.surface, shot.view)
        painter.release()
        return ambient.astype(float)

    return paint


@pytest.mark.parametrize(("across", "down"), [(WRAPS[0], WRAPS[1]), (WRAPS[1], WRAPS[2]), (WRAPS[2], WRAPS[0])])
def test_a_texel_is_where_its_coordinates_say_and_v_is_downwards(painted, across, down) -> None:
    picture = painted(wall(Texture(encoded(RANDOM), "a", (across, down)), -1.0, 2.0))
    at = (np.arange(SIZE) + 0.5) / SIZE * 3 - 1
    places = np.stack(np.meshgrid(at, at), axis=-1)
    high = RANDOM.repeat(2, axis=0)  # textures are squares on the device
    expected = np.stack(
        [alpha_at(high[..., k], False, (across, down), places.reshape(-1, 2)) for k in range(3)], axis=-1
    )
    expected = 255 * srgb(AMBIENT * linear(expected.reshape(picture.shape) / 255))
    assert np.abs(picture - expected).max() <= 2, "GPUs round the weights of their filters to 8 bits"


def test_the_texture_is_multiplied_by_the_colour_and_by_vertex_colours_in_linear_light(painted) -> None:
    grey = np.full((1, 1, 3), 188, dtype=np.uint8)  # 0.5 in linear light
    tints = np.array([[1.0, 1.0, 0.5], [0.5, 1.0, 1.0]], dtype=np.float32)
    picture = painted(wall(Texture(encoded(grey), "a"), color=(1.0, 0.5, 0.25), tints=tints))
    assert picture[-9, -25] == pytest.approx(255 * srgb(AMBIENT * 0.5 * np.array([1.0, 0.5, 0.125])), abs=1.5)
    assert picture[8, 24] == pytest.approx(255 * srgb(AMBIENT * 0.5 * np.array([0.5, 0.5, 0.25])), abs=1.5)


def srgb(linear: np.ndarray) -> np.ndarray:
    return np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)


def linear(srgb: np.ndarray) -> np.ndarray:
    return np.where(srgb <= 0.04045, srgb / 12.92, ((srgb + 0.055) / 1.055) ** 2.4)


def test_a_far_texture_is_its_mean_and_does_not_alias(painted) -> None:
    checks = (np.indices((64, 64)).sum(axis=0) % 2 * 255).astype(np.uint8)
    picture = painted(wall(Texture(encoded(np.dstack([checks] * 3)), "a"), 0.0, 37.0))
    assert np.abs(picture - 255 * srgb(AMBIENT * linear(np.array(0.5)))).max() <= 2


def test_what_is_cut_away_leaves_no_dark_rim(painted) -> None:
    texels = np.zeros((16, 16, 4), dtype=np.uint8)
    texels[4:12, 4:12] = 40, 200, 40, 255
    image = encoded(texels)
    cutout = cut_out(texels[..., 3])
    places = cutout.places(wall(None).coordinates)
    leaf = wall(Texture(image, "a", opaque=False), cutout=cutout, places=places)
    picture = painted(leaf)
    whole = 255 * srgb(AMBIENT * linear(np.array([40, 200, 40]) / 255))
    shown = np.abs(picture - whole).max(axis=-1) <= 8
    assert 0.2 < shown.mean() < 0.3, "half as wide and as high as the wall, and as bright up to its rim"
    assert (picture.min(axis=-1) > 5).all(), "beside it the sky"
    ignored = painted(wall(Texture(image, "a")))
    assert np.abs(ignored[2, 2] - [0, 0, 0]).max() <= 1, "an alpha that says nothing is not looked at"


def test_an_image_that_cannot_be_decoded_is_grey_and_told(painted, caplog) -> None:
    broken = encoded(RANDOM)[:-40]
    with caplog.at_level(logging.ERROR, "shadowbench"):
        picture = painted(wall(Texture(broken, "a.glb: images 1")))
    assert np.abs(picture - 255 * srgb(AMBIENT * linear(np.array(128 / 255)))).max() <= 1
    assert "a.glb: images 1: not an image" in caplog.text


def test_neither_keys_nor_masks_depend_on_a_texture(looking, mask) -> None:
    views = [looking([wall(texture)], HEADLIGHT) for texture in (None, Texture(encoded(RANDOM), "a"))]
    assert views[0].scene.geometry.digest() == views[1].scene.geometry.digest()
    assert np.array_equal(mask("shadow-map", views[0]), mask("shadow-map", views[1]))
