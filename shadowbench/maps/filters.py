"""Shadow-map filters: the compared texels and their weights. Each has a class and a shader file in `filter/`."""

from abc import abstractmethod
from dataclasses import dataclass
from typing import ClassVar, Literal

from shadowbench.maps.biases import ALL_MAPS, MapKind
from shadowbench.plugin.params import Component, param
from shadowbench.scenes.model import Light, Placement

Kernel = Literal["box", "gaussian"]


@dataclass(frozen=True)
class Contents:
    """What a filter stores in a map besides depth, computed by its shader's `filter_contents`, and how it is prepared.

    components: 1 to 4 of them; dtype: f4, f2 (half) or nu2 (16-bit unorm); linear: read with bilinear weights; blur:
    texels along a side of the blur's kernel, 1 for none; mips: read with mip levels.
    """

    components: int
    dtype: Literal["f4", "f2", "nu2"] = "f4"
    linear: bool = True
    blur: int = 1
    kernel: Kernel = "box"
    mips: bool = False


class Filter(Component):
    """Base class of the filters. A subclass has a `name`, a `shader`, a `radius` and `reads`; the rest has defaults.

    maps: the supported kinds of shadow map.
    """

    maps: ClassVar[frozenset[MapKind]] = frozenset({"2d", "array"})
    radius_shader: ClassVar[str] = "filter/radius.glsl"  # defines `radius`, for the bias
    of_number = "pcf"

    @classmethod
    def missing(cls) -> list[str]:
        return [] if cls.shader else ["shader, a file or text with the functions of filter.glsl"]

    @abstractmethod
    def radius(self, size: int) -> float:
        """The distance from a receiver to compared texels that the bias must span, in texels of a map of `size`."""

    def reach(self, size: int) -> float:
        """Largest distance from a receiver's point to any point of a texel that is read, in texels."""
        return self.radius(size)

    def light_radius(self, light: Light, placement: Placement) -> float:
        """Radius of the light by which the filter widens with the distance to a caster; 0 for a fixed width.

        The tangent of a sun's angular radius; of other lights a local length.
        """
        return 0.0

    @property
    def contents(self) -> Contents | None:
        """What the map stores besides depth; None for a filter that reads depths only."""
        return None

    @property
    def on_plane(self) -> bool:
        """Whether each texel is compared with the receiver's plane there, and not all with the receiver's depth."""
        return False

    @property
    @abstractmethod
    def reads(self) -> int:
        """Texture reads per pixel; a hardware comparison of 2×2 texels is one read."""


class Hard(Filter):
    """The nearest texel."""

    name = "hard"
    shader = "filter/hard.glsl"
    maps = ALL_MAPS

    def radius(self, size: int) -> float:
        return 0.5

    @property
    def reads(self) -> int:
        return 1


class Hardware(Filter):
    """Hardware comparison: 2×2 texels with bilinear weights."""

    name = "hardware"
    shader = "filter/hardware.glsl"
    maps = ALL_MAPS

    def radius(self, size: int) -> float:
        return 1.0

    @property
    def reads(self) -> int:
        return 1


class PCF(Filter):
    """Percentage-closer filtering over n×n texels, equally weighted (Reeves, Salesin and Cook 1987)."""

    name = "pcf"
    shader = "filter/pcf.glsl"
    maps = ALL_MAPS
    taps: Literal[3, 5, 7] = param(3, "texels along a side of the box")

    def radius(self, size: int) -> float:
        return self.taps / 2

    @property
    def reads(self) -> int:
        return self.taps**2


class Castano(Filter):
    """A wider kernel by few bilinear comparisons (Castaño 2013, as in Filament, Bevy and Babylon.js).

    As smooth as bilinear interpolation of percentage-closer filtering with the weights 1 2 1 or 1 3 4 3 1 along a side.
    """

    name = "castano"
    shader = "filter/castano.glsl"
    maps = ALL_MAPS
    taps: Literal[3, 5] = param(3, "texels along a side of the kernel: 3 by 4 comparisons, 5 by 9")

    def radius(self, size: int) -> float:
        return (self.taps + 1) / 2

    @property
    def reads(self) -> int:
        return ((self.taps + 1) // 2) ** 2


class Dither4(Filter):
    """Four taps in a pattern that alternates with the pixel's parity (Bunnell and Pellacini 2004)."""

    name = "dither-4"
    shader = "filter/dither-4.glsl"
    width: float = param(2.5, "distance between taps", gt=0, le=64)
    unit: Literal["texel", "map"] = param(
        "texel", "unit of width: texels, or thousandths of the map's side as published"
    )

    def radius(self, size: int) -> float:
        width = self.width * size / 1000 if self.unit == "map" else self.width
        return 1.5 * width + 1

    @property
    def reads(self) -> int:
        return 4


class PCF20(Filter):
    """Twenty fixed directions around the receiver, spread by its distance to the camera (Learn OpenGL, de Vries)."""

    name = "pcf-20"
    shader = "filter/pcf-20.glsl"
    radius_shader = "filter/pcf-20-radius.glsl"
    maps = frozenset({"cube"})
    spread: float = param(
        0.04, "offset of the taps in metres at the camera, twice that at its far plane", gt=0, metres=True
    )

    def radius(self, size: int) -> float:
        return 0.5  # of each tap's own texel; the shader adds the spread, which changes from pixel to pixel

    @property
    def reads(self) -> int:
        return 20
