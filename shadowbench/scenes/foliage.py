"""Foliage as games have it: a twig of leaves cut out of a card by alpha, and crowns of such cards."""

from functools import cache
from typing import Annotated, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from shadowbench.scenes.cutouts import Cutout, cut_out
from shadowbench.scenes.geometry import Faces, Floats

_LEAFLETS = 4  # on each side of a twig, besides the one at its end
LEAF = 0.36
"""Length of the longest leaf, as a share of a card's side."""
_EDGE = 1.5  # texels from 0 to 255 at the edge of a leaf
_FACES = np.array([[0, 1, 2], [0, 2, 3]], dtype=np.int32)


class Cards(NamedTuple):
    """Squares of two triangles, cut out. vertices: (4 N, 3); faces: (2 N, 3); coordinates, places: (2 N, 3, 2)."""

    vertices: Floats
    faces: Faces
    cutout: Cutout
    coordinates: NDArray[np.float32]
    places: NDArray[np.float32]


def foliage(
    count: Annotated[int, Field(ge=1, le=50_000, strict=True)] = 200,
    size: Annotated[float, Field(gt=0.0, le=1.0, strict=True)] = 0.3,
    texels: Annotated[int, Field(ge=4, le=1024, strict=True)] = 64,
    nearest: Annotated[bool, Field(strict=True)] = False,
    seed: Annotated[int, Field(ge=0, le=2**32 - 1, strict=True)] = 1,
) -> Cards:
    """Twigs of leaves, cut out by alpha of cards with random orientations in a ball of diameter 1.

    count: cards, denser towards the ball's surface; size: side of a card; texels: along a side of the mask; nearest:
    the nearest texel in place of four mixed bilinearly; seed: of the orientations.
    """
    random = np.random.default_rng(seed)
    outward, other = random.normal(size=(2, count, 3))
    outward /= np.linalg.norm(outward, axis=1, keepdims=True)
    middle = outward * (0.5 - size / 2) * random.uniform(0.1, 1.0, (count, 1)) ** (1 / 3)
    across = np.cross(outward, other)
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    up = outward + 0.7 * np.cross(outward, across)  # twigs point outwards, with random deviation
    up -= across * np.einsum("ij,ij->i", up, across)[:, None]
    up /= np.linalg.norm(up, axis=1, keepdims=True)
    half = size / 2
    corners = [middle + half * (x * across + y * up) for x, y in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
    faces = (4 * np.arange(count, dtype=np.int32)[:, None, None] + _FACES).reshape(-1, 3)
    corners_of = np.array([[0, 1], [1, 1], [1, 0], [0, 0]], dtype=np.float32)  # v downwards
    coordinates = np.tile(corners_of[_FACES], (count, 1, 1))
    cutout = cut_out(twig(texels), nearest=nearest, wrap=("clamp", "clamp"))
    vertices = np.stack(corners, axis=1).reshape(-1, 3)
    return Cards(vertices, faces, cutout, coordinates, cutout.places(coordinates))


@cache
def twig(texels: int) -> NDArray[np.uint8]:
    """(texels, texels) uint8 alpha of a twig that grows upwards, opaque in its leaves; read-only, as it is cached."""
    across, along = np.meshgrid(*(2 * [(np.arange(texels) + 0.5) / texels]), indexing="xy")
    x, y = across - 0.5, 1.0 - along  # y from the foot up
    inside = 0.018 - np.hypot(x, np.minimum(np.maximum(y - 0.85, 0.0), 1.0))  # the stem, to a height of 0.85
    for number in range(_LEAFLETS):
        for side in (-1.0, 1.0):
            inside = np.maximum(inside, _leaf(x, y, (0.0, 0.08 + 0.19 * number), side * np.radians(62.0), LEAF))
    inside = np.maximum(inside, _leaf(x, y, (0.0, 0.66), 0.0, 0.32))
    alpha = np.clip(0.5 + inside * texels / _EDGE, 0.0, 1.0)
    alpha[:, [0, -1]] = alpha[[0, -1]] = 0.0  # nothing reaches a card's edge
    result = np.rint(255 * alpha).astype(np.uint8)
    result.flags.writeable = False
    return result


def _leaf(x: Floats, y: Floats, foot: tuple[float, float], turn: float, length: float) -> Floats:
    """Roughly the distance inwards from the outline of a leaf: where two circles overlap."""
    sine, cosine = np.sin(turn), np.cos(turn)
    u = (x - foot[0]) * cosine - (y - foot[1]) * sine
    v = (x - foot[0]) * sine + (y - foot[1]) * cosine - length / 2
    radius = 0.62 * length
    offset = np.sqrt(radius**2 - (length / 2) ** 2)
    inside: Floats = radius - np.maximum(np.hypot(u - offset, v), np.hypot(u + offset, v))
    return inside
