"""Filters over a disc of taps, of a fixed radius or as wide as the penumbra."""

import math
from typing import Literal

from shadowbench.maps.biases import ALL_MAPS
from shadowbench.maps.filters import Contents, Filter
from shadowbench.plugin.params import param
from shadowbench.scenes.model import Light, Placement


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

    def radius(self, size: int) -> float:
        return 1.0  # of a single tap


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
