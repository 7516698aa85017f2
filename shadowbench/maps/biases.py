"""Depth biases against self-shadowing (acne): a class each and, where needed, a shader file in `bias/`."""

import math
from dataclasses import dataclass
from typing import ClassVar, Literal, Self

from pydantic import model_validator

from shadowbench.plugin.params import Call, Component, param, parse_value

MapKind = Literal["2d", "array", "cube"]
ALL_MAPS: frozenset[MapKind] = frozenset({"2d", "array", "cube"})


@dataclass(frozen=True)
class Effect:
    """What a bias does besides its shader, and how long it is; those of two biases that act together add up.

    factor, units: of glPolygonOffset in the depth pass; cull: the faces that the depth pass culls. depth, metres,
    texels: the smallest bias, a sum of units of [0, 1] depth and of lengths along the light; along_normal: the offset
    along the normal at grazing light, in filter radii · texel diagonals.
    """

    factor: float = 0.0
    units: float = 0.0
    cull: Literal["", "front"] = ""
    depth: float = 0.0
    metres: float = 0.0
    texels: float = 0.0
    along_normal: float = 0.0

    def __add__(self, other: "Effect") -> "Effect":
        sums = {key: value + getattr(other, key) for key, value in vars(self).items() if key != "cull"}
        return Effect(cull=self.cull or other.cull, **sums)

    def lengths(self, radius: float, texel_m: float, depth_range_m: float) -> dict[str, float]:
        """A sun's smallest bias along the light and largest offset along the normal, in metres and in texel widths.

        radius: of the filter, in texels.
        """
        lengths = {
            "bias": self.depth * depth_range_m + self.metres + self.texels * texel_m,
            "normal_offset": self.along_normal * radius * math.sqrt(2) * texel_m,
        }
        return {
            f"{name}_{unit}": length / scale
            for unit, scale in (("m", 1.0), ("texels", texel_m))
            for name, length in lengths.items()
            if length
        }


class Bias(Component):
    """Base class of the biases.

    maps: the supported kinds of shadow map; swept: the parameters that a study's `bias_sweep` multiplies; effects: the
    parameters that are fields of its `effect`; comparison: its own shader, a file or its text, of the comparison of a
    texel, by default with the receiver's depth; gradients: whether that needs the depth gradient of the triangle in
    each texel. Several biases that act together are a `Sum`, written with `+`.
    """

    maps: ClassVar[frozenset[MapKind]] = frozenset({"2d", "array"})
    swept: ClassVar[tuple[str, ...]] = ()
    effects: ClassVar[dict[str, str]] = {}
    comparison: ClassVar[str] = ""
    gradients: ClassVar[bool] = False
    shader = "bias/none.glsl"

    @classmethod
    def from_value(cls, value: "Component | str | Call") -> "Bias":
        """The bias or sum of biases of a value in a spec. Raises ValueError with the allowed names."""
        value = parse_value(value) if isinstance(value, str) else value
        if isinstance(value, Call) and value.name == "+":
            return Sum(**value.keywords(["first", "second"]))
        return super().from_value(value)

    @property
    def terms(self) -> "tuple[Bias, ...]":
        """The biases of a sum; else the bias itself."""
        return (self,)

    @property
    def comparing(self) -> "Bias | None":
        """The term that has a comparison of its own."""
        return next((term for term in self.terms if term.comparison), None)

    @property
    def effect(self) -> Effect:
        """What it does besides its shader, and how long it is."""
        return Effect(**{name: getattr(self, key) for name, key in self.effects.items()})

    def scaled(self, factor: float) -> Self:
        """A copy with the `swept` parameters multiplied. Raises ValidationError beyond a parameter's limits."""
        return type(self)(**{**dict(self), **{name: getattr(self, name) * factor for name in self.swept}})


class NoBias(Bias):
    """No bias: shows the acne."""

    name = "none"
    maps = ALL_MAPS


class Constant(Bias):
    """A constant bias, in units of depth, whose length in metres changes with the fit, or in metres along the light."""

    name = "constant"
    shader = "bias/constant.glsl"
    maps = ALL_MAPS
    swept = ("units", "world")
    units: float = param(0.005, "subtracted from the receiver's depth in [0, 1]", ge=0, le=1)
    world: float = param(0.0, "metres along the light; above 0 it replaces units", ge=0, metres=True)

    @property
    def effect(self) -> Effect:
        return Effect(metres=self.world) if self.world > 0 else Effect(depth=self.units)


class BeforeDivide(Bias):
    """A constant subtracted before the division by w, as in published code that calls textureProj.

    The same as `constant` for a directional light, where w is 1. For a spot, w is the distance along its axis in
    metres: as a length along the axis, this bias grows with the distance, `constant` with its square.
    """

    name = "before-divide"
    shader = "bias/before-divide.glsl"
    swept = ("units",)
    effects = {"depth": "units"}
    units: float = param(0.01, "subtracted from the receiver's homogeneous depth", ge=0, le=1)


class Slope(Bias):
    """Slope-scaled depth bias max · (1 − N·L), but at least min, as published in course notes."""

    name = "slope"
    shader = "bias/slope.glsl"
    maps = ALL_MAPS
    swept = ("max", "min")
    effects = {"depth": "min"}
    max: float = param(0.05, "bias in depth at grazing light", ge=0, le=1)
    min: float = param(0.005, "least bias in depth", ge=0, le=1)


class PolygonOffset(Bias):
    """glPolygonOffset in the depth pass: a multiple of the polygon's depth slope, plus steps of the depth format."""

    name = "polygon-offset"
    swept = ("factor", "units")
    effects = {"factor": "factor", "units": "units"}
    factor: float = param(2.0, "multiple of the polygon's largest depth slope per texel", ge=-100, le=100)
    units: float = param(4.0, "multiple of the smallest step of the depth format", ge=-1e6, le=1e6)


class FrontCull(Bias):
    """Front-face culling in the depth pass. Needs closed casters; light leaks at contacts and behind thin casters."""

    name = "front-cull"
    maps = ALL_MAPS

    @property
    def effect(self) -> Effect:
        return Effect(cull="front")


class NormalOffset(Bias):
    """Offset of the receiver along its normal by scale · radius texel diagonals · sin θ (Holbert 2011).

    Engines let it fall in other ways towards light that is square to the surface, by 1 − cos θ or not at all.
    """

    name = "normal-offset"
    shader = "bias/normal-offset.glsl"
    maps = ALL_MAPS
    swept = ("scale",)
    effects = {"along_normal": "scale"}
    scale: float = param(1.0, "multiple of the filter radius", ge=0, le=100)
    ulps: float = param(4.0, "steps of the depth format added to the bias", ge=0, le=1e6)
    falloff: Literal["sine", "versine", "across", "none"] = param(
        "sine",
        "factor by the angle θ between normal and light: sin θ; versine: 1 − cos θ; across: that, less the part of the"
        " offset that is along the light; none: 1",
    )
    normal: Literal["geometric", "shading"] = param(
        "geometric", "normal of the triangle, or that of the smooth surface, as which it is shaded"
    )


class Terminator(Bias):
    """No bias of a depth: shadows are received on the smooth surface that a triangle stands for (Hanika 2021).

    The receiver is moved above the tangent planes at the triangle's corners, and its normal is the one that it is
    shaded by, so that the triangles around it do not shadow it. Flat surfaces stay as they are. To be added to a bias
    against acne: `terminator+texel`.
    """

    name = "terminator"
    maps = ALL_MAPS
    lifts = True


class ReceiverPlane(Bias):
    """Comparison of each texel with the receiver's plane at the texel's centre (after Isidoro 2006)."""

    name = "receiver-plane"
    shader = "bias/receiver-plane.glsl"
    comparison = "comparison/plane.glsl"
    swept = ("slack",)
    effects = {"texels": "slack"}
    gradient: Literal["plane", "derivative"] = param("plane", "from the geometric normal or from screen derivatives")
    limit: float = param(10.0, "tan θ to which the gradient is limited", gt=0, le=1e6)
    slack: float = param(1.5, "texel widths along the ray, for surfaces curved within a texel", ge=0, le=1e6)
    ulps: float = param(4.0, "steps of the depth format added to the bias", ge=0, le=1e6)


class Texel(Bias):
    """Filter radius · texel diagonal · tan θ as a length along the ray; adapts to map size, fit and filter."""

    name = "texel"
    shader = "bias/texel.glsl"
    maps = ALL_MAPS
    swept = ("scale",)
    scale: float = param(
        1.0, "multiple of the depth change of the receiver's plane over the filter radius", ge=0, le=100
    )
    limit: float = param(
        16.0, "largest bias, in filter radii · texel widths; doubled for spot and point lights", gt=0, le=1e6
    )
    ulps: float = param(4.0, "steps of the depth format added to the bias", ge=0, le=1e6)
    grazing: float = param(50.0, "tan θ from which the receiver is offset along its normal instead", ge=0, le=1e6)


class TwoPlanes(Bias):
    """No length to choose: a caster shadows only what is behind it by two planes.

    It must be in front of the receiver's plane at the texel's centre, and its own plane in front of the receiver. On a
    surface that bends smoothly over a texel one of the two never is, and nothing detaches from where it stands. The map
    also stores the slopes of its triangles, 4 bytes a texel.
    """

    name = "two-planes"
    shader = "bias/two-planes.glsl"
    comparison = "comparison/two-planes.glsl"
    gradients = True
    maps = ALL_MAPS


class Sum(Bias):
    """The sum of two biases, `polygon-offset(2,4)+before-divide(0.01)`: the second applies to what the first has left.

    Not in the table of biases; specs form it with `+`. `second` may be a sum, and `first` is none.
    """

    shader = "bias/sum.glsl"
    first: Bias
    second: Bias

    @model_validator(mode="after")
    def _compares_once(self) -> Self:
        own = {term.comparison: term.name for term in self.terms if term.comparison}
        if len(own) > 1:
            raise ValueError(f"found {'+'.join(own.values())}, which both compare texels; allowed: one of them")
        return self

    @property
    def terms(self) -> tuple[Bias, ...]:
        return (self.first, *self.second.terms)

    @property
    def effect(self) -> Effect:
        return self.first.effect + self.second.effect

    def scaled(self, factor: float) -> Self:
        return type(self)(first=self.first.scaled(factor), second=self.second.scaled(factor))

    def written(self, full: bool = False) -> str:
        return "+".join(term.written(full) for term in self.terms)
