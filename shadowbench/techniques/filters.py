"""Filters: how many texels are compared, and how they are weighted. A row and a shader file in `filter/`."""

from typing import ClassVar, Literal

from shadowbench.techniques.biases import MapKind
from shadowbench.techniques.params import Row, param


class Filter(Row):
    """Family of filters. `maps` names the map kinds that a row serves."""

    maps: ClassVar[frozenset[MapKind]] = frozenset({"2d", "array"})

    def radius(self, size: int) -> float:
        """How far from the receiver's point a compared texel reaches, in texels of a map of this size."""
        raise NotImplementedError(self.name)

    @property
    def reads(self) -> int:
        """Reads of the map's sampler for a pixel, one that the hardware blends from four texels being one read."""
        raise NotImplementedError(self.name)


class Hard(Filter):
    """The one texel that holds the point."""

    name = "hard"
    shader = "filter/hard.glsl"
    maps = frozenset({"2d", "array", "cube"})

    def radius(self, size: int) -> float:
        return 0.5

    @property
    def reads(self) -> int:
        return 1


class Hardware(Filter):
    """The sampler's own comparison, 2×2 texels with linear weights."""

    name = "hardware"
    shader = "filter/hardware.glsl"
    maps = frozenset({"2d", "array", "cube"})

    def radius(self, size: int) -> float:
        return 1.0

    @property
    def reads(self) -> int:
        return 1


class PCF(Filter):
    """Percentage-closer filtering: an n×n box at texel steps (Reeves, Salesin and Cook 1987)."""

    name = "pcf"
    shader = "filter/pcf.glsl"
    maps = frozenset({"2d", "array", "cube"})
    taps: Literal[3, 5, 7] = param(3, "texels along a side of the box")

    def radius(self, size: int) -> float:
        return self.taps / 2

    @property
    def reads(self) -> int:
        return self.taps**2


class Dither4(Filter):
    """Four taps whose pattern moves with the pixel's parity (Bunnell and Pellacini 2004)."""

    name = "dither-4"
    shader = "filter/dither-4.glsl"
    width: float = param(2.5, "step between taps", gt=0, le=64)
    unit: Literal["texel", "map"] = param("texel", "of the width: texels, or thousandths of the map as published")

    def radius(self, size: int) -> float:
        width = self.width * size / 1000 if self.unit == "map" else self.width
        return 1.5 * width + 1

    @property
    def reads(self) -> int:
        return 4


class PCF20(Filter):
    """Twenty fixed directions around the receiver, wider with its distance to the camera (Learn OpenGL, de Vries)."""

    name = "pcf-20"
    shader = "filter/pcf-20.glsl"
    maps = frozenset({"cube"})
    spread: float = param(0.04, "metres at the camera, twice as many at its far plane", gt=0, metres=True)

    def radius(self, size: int) -> float:
        return 0.5  # of each direction's own texel; how far they reach changes from pixel to pixel

    @property
    def reads(self) -> int:
        return 20
