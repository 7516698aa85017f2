"""Textures of base colours, for pictures only: no score, mask or key depends on them."""

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from shadowbench.scenes.cutouts import Wrap

MOST_BYTES = 1 << 28
"""Limit in bytes on the image files of a mesh file that are kept for pictures."""


@dataclass(frozen=True, eq=False)
class Texture:
    """A surface's base colour, decoded only when a picture is drawn, which truths and masks do not wait for.

    content: an image file in sRGB, whose first row is at v = 0; where: the beginning of its errors; wrap: of u and v
    outside 0 to 1; opaque: whether its alpha says nothing.
    """

    content: bytes = field(repr=False)
    where: str
    wrap: tuple[Wrap, Wrap] = ("repeat", "repeat")
    opaque: bool = True


class TexturedFaces(NamedTuple):
    """Consecutive triangles of a scene with one texture.

    first: index of the first; coordinates: (K, 3, 2) float32 texture coordinates of the corners.
    """

    first: int
    texture: Texture
    coordinates: NDArray[np.float32]
