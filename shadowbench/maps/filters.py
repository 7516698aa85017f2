"""Shadow-map filters: the compared texels and their weights. Each has a class and a shader file in `filter/`."""

import math
from dataclasses import dataclass
from typing import ClassVar, Literal

from shadowbench.maps.biases import ALL_MAPS, MapKind
from shadowbench.plugin.params import Component, param
from shadowbench.scenes.model import Light, Placement

Kernel = Literal["box", "gaussian"]
Dtype = Literal["f4", "f2", "nu2"]


@dataclass(frozen=True)
class Contents:
    """What a filter stores in a map besides depth, computed by its shader's `filter_contents`, and how it is prepared.

    components: 1 to 4 of them; dtype: f4, f2 (half) or nu2 (16-bit unorm); linear: read with bilinear weights; blur:
    texels along a side of the blur's kernel, 1 for none; mips: read with mip levels.
    """

    components: int
    dtype: Dtype = "f4"
    linear: bool = True
    blur: int = 1
    kernel: Kernel = "box"
    mips: bool = False


class Filter(Component):
    """Base class of the filters. A subclass has a `name` and a `shader`; the rest has defaults.

    maps: the supported kinds of shadow map; compares: whether it compares texels one by one or in fours, as a bias with
    a comparison of its own needs; reads: texture reads per pixel, of which a hardware comparison of 2×2
    texels is one; on_plane: whether each texel is compared with the receiver's plane there, and not all with the
    receiver's depth.
    """

    maps: ClassVar[frozenset[MapKind]] = frozenset({"2d", "array"})
    compares: ClassVar[bool] = True

    def radius(self, size: int) -> float:
        """The distance from a receiver to compared texels that the bias must span, in texels of a map of `size`.

        By default that of a bilinear read.
        """
        return 1.0

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
    def reads(self) -> int:
        return 1

    @property
    def on_plane(self) -> bool:
        return False


class Hard(Filter):
    """The nearest texel."""

    name = "hard"
    shader = "filter/hard.glsl"
    maps = ALL_MAPS

    def radius(self, size: int) -> float:
        return 0.5


class Hardware(Filter):
    """Hardware comparison: 2×2 texels with bilinear weights."""

    name = "hardware"
    shader = "filter/hardware.glsl"
    maps = ALL_MAPS


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
    maps = frozenset({"cube"})
    compares = False
    spread: float = param(
        0.04, "offset of the taps in metres at the camera, twice that at its far plane", gt=0, metres=True
    )

    def radius(self, size: int) -> float:
        return 0.5  # of each tap's own texel; the shader adds the spread, which changes from pixel to pixel

    @property
    def reads(self) -> int:
        return 20


Bits = Literal[16, 32]


class Filterable(Filter):
    """Base class of filters whose contents are blurred: reads once per pixel, however wide the blur.

    A symmetric blur leaves the mean depth of a plane as it is, so that the bias need not span it.
    """

    maps = ALL_MAPS
    compares = False
    blur: int = param(5, "texels along a side of the blur's kernel; 1 for none", ge=1, le=64)
    kernel: Kernel = param("box", "weights of the blur; a Gaussian's standard deviation is a quarter of its width")
    mips: bool = param(False, "mip levels, with a footprint from the receiver's plane")

    def reach(self, size: int) -> float:
        return self.blur / 2 + 1

    def _blurred(self, components: int, dtype: Dtype) -> Contents:
        return Contents(components, dtype, blur=self.blur, kernel=self.kernel, mips=self.mips)


class VSM(Filterable):
    """Variance shadow map: Chebyshev's bound from two moments (Donnelly and Lauritzen 2006).

    Light bleeds where two casters overlap, the more, the farther apart they are.
    """

    name = "vsm"
    shader = "filter/vsm.glsl"
    bits: Bits = param(32, "bits of each moment; 16 are half floats, whose step is 5e-4 at the far plane")
    bleed: float = param(0.3, "light bleeding reduction: a bound below it is shadow", ge=0, lt=1)
    min_variance: float = param(1e-7, "least variance, in squared depth", ge=0, le=1)

    @property
    def contents(self) -> Contents:
        return self._blurred(2, "f2" if self.bits == 16 else "f4")


class ESM(Filterable):
    """Exponential shadow map: the mean of e^(c·depth) over that of the receiver (Annen et al. 2008).

    Leaks at contacts, and wherever the kernel holds texels deeper than the receiver.
    """

    name = "esm"
    shader = "filter/esm.glsl"
    c: float = param(80.0, "sharpness; e^c overflows beyond 87", gt=0, le=87)

    @property
    def contents(self) -> Contents:
        return self._blurred(1, "f4")


class EVSM(Filterable):
    """Exponential variance shadow map: Chebyshev's bound of warped depths (Lauritzen and McCool 2008).

    With four components the smaller of the bounds of two warps, one of which is exact at contacts.
    """

    name = "evsm"
    shader = "filter/evsm.glsl"
    components: Literal[2, 4] = param(4, "2: the positive warp only; 4: both warps")
    bits: Bits = param(32, "bits of each moment; 16 are half floats, and limit both exponents to 5.54")
    positive: float = param(40.0, "exponent of the positive warp; its square overflows beyond 42", gt=0, le=42)
    negative: float = param(5.0, "exponent of the negative warp", gt=0, le=42)
    bleed: float = param(0.0, "light bleeding reduction: a bound below it is shadow", ge=0, lt=1)
    min_variance: float = param(1e-8, "least variance, in squared depth at the receiver", ge=0, le=0.01)

    @property
    def contents(self) -> Contents:
        return self._blurred(self.components, "f2" if self.bits == 16 else "f4")


class MSM(Filterable):
    """Moment shadow map: the sharpest lower bound on shadow from four moments (Peters and Klein 2015, Hamburger).

    Two depths at a pixel bleed nothing, three do.
    """

    name = "msm"
    shader = "filter/msm.glsl"
    bits: Bits = param(32, "bits of each moment; 16 are unsigned normalised integers of transformed moments")
    bias: float = param(
        0.0,
        "share of fixed moments mixed in, against rounding; 0: as published, 3e-6 for 32 bits and 6e-5 for 16",
        ge=0,
        le=1,
    )
    bleed: float = param(0.0, "light bleeding reduction: a bound below it is shadow", ge=0, lt=1)

    def radius(self, size: int) -> float:
        # Where a kernel covers a plane, the bound is 0 from the standard deviation in front of its mean depth on: that
        # of a box along its diagonal, and 1/√2 of it for the diagonal of a texel, in which biases count.
        return max(1.0, self.blur / math.sqrt(24))

    @property
    def contents(self) -> Contents:
        return self._blurred(4, "nu2" if self.bits == 16 else "f4")


class Disc(Filter):
    """Base class of filters of taps over a disc, each compared with the receiver's plane there."""

    maps = ALL_MAPS
    pattern: Literal["vogel", "poisson"] = param(
        "vogel", "positions of the taps: a spiral of equal areas (Vogel 1979), or 32 Poisson-disc points"
    )
    rotate: bool = param(True, "turns the pattern from pixel to pixel by interleaved gradient noise (Jimenez 2014)")

    @property
    def on_plane(self) -> bool:
        return True


class PCFDisc(Disc):
    """Percentage-closer filtering over a disc of a fixed radius (Reeves, Salesin and Cook 1987)."""

    name = "pcf-disc"
    shader = "filter/pcf-disc.glsl"
    width: float = param(2.5, "radius of the disc in texels", gt=0, le=64)
    taps: int = param(16, "bilinear comparisons", ge=1, le=256)
    plane: bool = param(True, "compares each tap with the receiver's plane; false: all with the receiver, as published")

    @property
    def on_plane(self) -> bool:
        return self.plane

    def radius(self, size: int) -> float:
        return super().radius(size) if self.plane else self.reach(size)

    def reach(self, size: int) -> float:
        return self.width + 1

    @property
    def reads(self) -> int:
        return self.taps


class PCSS(Disc):
    """Percentage-closer soft shadows: the disc is as wide as the penumbra (Fernando 2005).

    The mean distance of the blockers in a search disc gives the penumbra's width by similar triangles, in the scene's
    units, so that it does not depend on the map's depth range. Wrong where casters at several distances overlap; noisy
    where the disc holds few taps. The variants of engines depend on the depth range, and need a fit whose near plane is
    in front of the casters, such as scene.
    """

    name = "pcss"
    shader = "filter/pcss.glsl"
    search: int = param(16, "taps of the blocker search", ge=1, le=256)
    taps: int = param(32, "comparisons of the nearest texel", ge=1, le=256)
    angle: float = param(0.0, "angular radius of a sun in degrees; 0: the scene's", ge=0, le=45)
    size: float = param(0.0, "radius of other lights; 0: the scene's", ge=0, metres=True)
    variant: Literal["world", "godot", "filament", "bevy", "babylon", "three"] = param(
        "world", "penumbra by lengths in the scene, or as an engine publishes it, by depths in [0, 1]"
    )
    light: float = param(
        0.0,
        "the light's size in a variant's unit: angular diameter in degrees (godot), radius in metres (filament, bevy),"
        " share of the map's side (babylon, three); 0: as shipped: the scene's (godot), 0.02 (filament), 10 (bevy's"
        " example), 0.1 (babylon), 0.00133 (three's example)",
        ge=0,
        le=1e6,
    )

    def light_radius(self, light: Light, placement: Placement) -> float:
        if light.kind == "directional":
            return math.tan(math.radians(self.angle) if self.angle else light.radius)
        if self.size:
            return placement.length(self.size)
        width, height = light.size
        return math.sqrt(width * height / math.pi) if light.kind == "rectangle" else light.radius

    @property
    def contents(self) -> Contents:
        return Contents(1, linear=False)

    @property
    def reads(self) -> int:
        return self.search + self.taps


class DPCF(Disc):
    """Percentage-closer filtering over a fixed disc, hardened at contacts (Myers, Shadow of Cold War; Filament).

    The share of shadowed taps is sharpened by the ratio of the distances from receiver to blockers and from blockers to
    the near plane, or to a light that is not a sun: a guess of the penumbra by one set of taps, which depends on the
    map's near plane.
    """

    name = "dpcf"
    shader = "filter/dpcf.glsl"
    taps: int = param(12, "comparisons of the nearest texel", ge=1, le=256)
    bulb: float = param(0.02, "radius of the disc in metres", gt=0, metres=True)

    @property
    def contents(self) -> Contents:
        return Contents(1, linear=False)

    @property
    def reads(self) -> int:
        return self.taps
