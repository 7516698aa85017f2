"""Result of drawing a cell: its images, GPU memory, work counts and facts."""

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from shadowbench.files import png_of
from shadowbench.gl.gbuffer import download
from shadowbench.gl.library import moderngl
from shadowbench.maps.filters import Filter
from shadowbench.plugin.base import Technique
from shadowbench.scenes.tables import LONGEST_NAME
from shadowbench.scores.masks import quantise


@dataclass(frozen=True, eq=False)
class Rendering:
    """Images and measurements of one draw; row 0 of images is at the top.

    visibility: (N, N) float32, 0 in shadow to 1 lit, quantised to 16 bits; picture: (N, N, 3) uint8 sRGB, shaded with
    the visibility; map: (H, W) float32 linear depth, None if not requested or the technique has none; gpu_bytes: of its
    textures and buffers; work: counts by name; facts: numbers reported by the technique, by name.
    """

    visibility: NDArray[np.float32]
    picture: NDArray[np.uint8]
    map: NDArray[np.float32] | None
    gpu_bytes: int
    work: dict[str, int]
    facts: dict[str, float]

    def __repr__(self) -> str:
        """One line: the sizes of its images."""
        size = len(self.visibility)
        shadow_map = "no map" if self.map is None else f"a map of {self.map.shape[1]} × {self.map.shape[0]} texels"
        return f"<Rendering of {size} × {size} pixels, {(self.visibility < 0.5).mean():.1%} in shadow, {shadow_map}>"

    def _repr_png_(self) -> bytes:
        """PNG of the picture, for notebooks."""
        return png_of(self.picture)


def checked_texture(spec: str, texture: object, size: int) -> moderngl.Texture:
    """What a technique drew. TypeError or ValueError unless it is a texture, size × size, with one component."""
    if not isinstance(texture, moderngl.Texture):
        raise TypeError(f"{spec} drew {type(texture).__name__}; allowed: a texture")
    if texture.size != (size, size):
        raise ValueError(f"{spec} drew {' × '.join(map(str, texture.size))} pixels; allowed: {size} × {size}")
    if texture.components != 1:
        raise ValueError(f"{spec} drew {texture.components} components; allowed: 1, the visibility")
    return texture


def visibility_of(spec: str, texture: object, size: int) -> NDArray[np.float32]:
    """(size, size) quantised visibility that a technique drew, row 0 at the top.

    Raises as `checked_texture` does, and ValueError for values that are not finite or not in [0, 1].
    """
    drawn = checked_texture(spec, texture, size)
    try:
        return quantise(download(drawn)[..., 0])
    except ValueError as error:
        raise ValueError(f"{spec} drew {error}") from error


def declared_work(technique: Technique, pixels: int, facts: dict[str, float]) -> dict[str, int]:
    """Work that OpenGL does not count: shadow-map reads and rays, moved here from `facts` if reported there.

    A technique with a built-in filter reads as many texels per pixel as the filter declares.
    """
    work: dict[str, int] = {name: int(facts.pop(name)) for name in ("reads", "rays") if name in facts}
    chosen = getattr(technique.params, "filter", None)
    if "reads" not in work and isinstance(chosen, Filter):
        work["reads"] = pixels * chosen.reads
    return work


def finite_facts(spec: str, facts: Mapping[str, float]) -> dict[str, float]:
    """Facts as plain floats. Raises ValueError if one is not finite or its name is longer than LONGEST_NAME."""
    for name, value in facts.items():
        if len(name) > LONGEST_NAME:
            raise ValueError(
                f"{spec}: fact {name!r:.60}… has a name of {len(name)} characters; allowed: {LONGEST_NAME}"
            )
        if not math.isfinite(value):
            raise ValueError(f"{spec}: fact {name!r} is {value}; allowed: finite numbers")
    return {name: float(value) for name, value in facts.items()}
