"""What a material gives a mesh: where it is cut out, and what colour it has in pictures."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from shadowbench.scenes.cutouts import Cutout
from shadowbench.scenes.model import GREY
from shadowbench.scenes.textures import Texture
from shadowbench.scenes.vectors import Vec3

BLEND_CUTOFF = 0.5
"""Alpha below which surfaces are cut out whose material mixes them with what is behind."""
MOST_MASKED = 1 << 27
"""Limit on the texels of a file's masks, thirty-two of 2048², which techniques hold in one texture."""
OPAQUE = np.full((1, 1), 255, dtype=np.uint8)
"""Alphas of a material without an image."""


class Look(NamedTuple):
    """Fields of `Mesh` of these names."""

    color: Vec3 = GREY
    cutout: Cutout | None = None
    texture: Texture | None = None
    coordinates: NDArray[np.float32] | None = None
    places: NDArray[np.float32] | None = None
    tints: NDArray[np.float32] | None = None
