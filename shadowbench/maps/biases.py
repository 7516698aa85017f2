"""Depth biases against self-shadowing (acne): a class each and, where needed, a shader file in `bias/`."""

import math
from typing import Annotated, ClassVar, Literal, Self

from pydantic import BeforeValidator, model_validator

from shadowbench.plugin.grammar import Call, parse_value
from shadowbench.plugin.params import Component, param

MapKind = Literal["2d", "array", "cube"]


class Bias(Component):
    """Base class of the biases.

    maps: the supported kinds of shadow map; swept: the parameters that a study's `bias_sweep` multiplies. Several
    biases that act together are a `Sum`, written with `+`.
    """

    maps: ClassVar[frozenset[MapKind]] = frozenset({"2d", "array"})
    swept: ClassVar[tuple[str, ...]] = ()
    shader = "bias/none.glsl"
    of_number = "constant"

    @classmethod
    def from_value(cls, value: "Component | str | Call") -> "Bias":
        """The bias or sum of biases of a value in a spec. Raises ValueError with the allowed names."""
        value = parse_value(value) if isinstance(value, str) else value
        if isinstance(value, Call) and value.name == "+":
            return Sum(**value.keywords(["first", "second"]))
        return value if isinstance(value, Sum) else super().from_value(value)

    @property
    def terms(self) -> "tuple[Bias, ...]":
        """The biases of a sum; the bias itself otherwise."""
        return (self,)

    def scaled(self, factor: float) -> Self:
        """A copy with the `swept` parameters multiplied. Raises ValidationError beyond a parameter's limits."""
        return type(self)(**{**dict(self), **{name: getattr(self, name) * factor for name in self.swept}})

    @property
    def polygon_offset(self) -> tuple[float, float]:
        """(factor, units) of glPolygonOffset in the depth pass."""
        return (0.0, 0.0)

    @property
    def cull(self) -> Literal["", "front"]:
        """The faces that the depth pass culls."""
        return ""

    @property
    def on_plane(self) -> bool:
        """Whether each texel is compared with the receiver's plane there, and not all with the receiver's depth."""
        return False

    @property
    def depth_units(self) -> float | None:
        """The smallest bias in units of [0, 1] depth; None for a bias that is not fixed in these units."""
        return None

    @property
    def along_light(self) -> tuple[float, float]:
        """The smallest bias in metres and in texel widths along the light, besides `depth_units`."""
        return (0.0, 0.0)

    def along_normal(self, radius: float) -> float:
        """The offset along the normal at grazing light in texel diagonals, for a filter's radius in texels."""
        return 0.0

    def facts(self, radius: float, texel_m: float, depth_range_m: float) -> dict[str, float]:
        """A sun's smallest bias along the light and largest offset along the normal, in metres and in texel widths."""
        metres, texels = self.along_light
        lengths = {
            "bias": (self.depth_units or 0.0) * depth_range_m + metres + texels * texel_m,
            "normal_offset": self.along_normal(radius) * math.sqrt(2) * texel_m,
        }
        found = {name: length for name, length in lengths.items() if length}
        return {f"{name}_m": length for name, length in found.items()} | {
            f"{name}_texels": length / texel_m for name, length in found.items()
        }


class NoBias(Bias):
    """No bias: shows the acne."""

    name = "none"
    maps = frozenset({"2d", "array", "cube"})


class Constant(Bias):
    """A constant bias, in units of depth, whose length in metres changes with the fit, or in metres along the light."""

    name = "constant"
    shader = "bias/constant.glsl"
    maps = frozenset({"2d", "array", "cube"})
    swept = ("units", "world")
    units: float = param(0.005, "subtracted from the receiver's depth in [0, 1]", ge=0, le=1)
    world: float = param(0.0, "metres along the light; above 0 it replaces units", ge=0, metres=True)

    @property
    def depth_units(self) -> float | None:
        return None if self.world > 0 else self.units

    @property
    def along_light(self) -> tuple[float, float]:
        return (self.world, 0.0)


class BeforeDivide(Bias):
    """A constant subtracted before the division by w, as in published code that calls textureProj.

    The same as `constant` for a directional light, where w is 1. For a spot, w is the distance along its axis in
    metres: as a length along the axis, this bias grows with the distance, `constant` with its square.
    """

    name = "before-divide"
    shader = "bias/before-divide.glsl"
    swept = ("units",)
    units: float = param(0.01, "subtracted from the receiver's homogeneous depth", ge=0, le=1)

    @property
    def depth_units(self) -> float | None:
        return self.units


class Slope(Bias):
    """Slope-scaled depth bias max · (1 − N·L), but at least min, as published in course notes."""

    name = "slope"
    shader = "bias/slope.glsl"
    maps = frozenset({"2d", "array", "cube"})
    swept = ("max", "min")
    max: float = param(0.05, "bias in depth at grazing light", ge=0, le=1)
    min: float = param(0.005, "least bias in depth", ge=0, le=1)

    @property
    def depth_units(self) -> float | None:
        return self.min


class PolygonOffset(Bias):
    """glPolygonOffset in the depth pass: a multiple of the polygon's depth slope, plus steps of the depth format."""

    name = "polygon-offset"
    swept = ("factor", "units")
    factor: float = param(2.0, "multiple of the polygon's largest depth slope per texel", ge=-100, le=100)
    units: float = param(4.0, "multiple of the smallest step of the depth format", ge=-1e6, le=1e6)

    @property
    def polygon_offset(self) -> tuple[float, float]:
        return (self.factor, self.units)


class FrontCull(Bias):
    """Front-face culling in the depth pass. Needs closed casters; light leaks at contacts and behind thin casters."""

    name = "front-cull"
    maps = frozenset({"2d", "array", "cube"})

    @property
    def cull(self) -> Literal["", "front"]:
        return "front"


class NormalOffset(Bias):
    """Offset of the receiver along its normal by scale · radius texel diagonals · sin θ (Holbert 2011).

    Engines let it fall in other ways towards light that is square to the surface, by 1 − cos θ or not at all.
    """

    name = "normal-offset"
    shader = "bias/normal-offset.glsl"
    maps = frozenset({"2d", "array", "cube"})
    swept = ("scale",)
    scale: float = param(1.0, "multiple of the filter radius", ge=0, le=100)
    ulps: float = param(4.0, "steps of the depth format added to the bias", ge=0, le=1e6)
    falloff: Literal["sine", "versine", "across", "none"] = param(
        "sine",
        "factor by the angle θ between normal and light: sin θ; versine: 1 − cos θ; across: that, less the part of the"
        " offset that is along the light; none: 1",
    )

    def along_normal(self, radius: float) -> float:
        return self.scale * radius


class ReceiverPlane(Bias):
    """Comparison of each texel with the receiver's plane at the texel's centre (after Isidoro 2006)."""

    name = "receiver-plane"
    shader = "bias/receiver-plane.glsl"
    swept = ("slack",)
    gradient: Literal["plane", "derivative"] = param("plane", "from the geometric normal or from screen derivatives")
    limit: float = param(10.0, "tan θ to which the gradient is limited", gt=0, le=1e6)
    slack: float = param(1.5, "texel widths along the ray, for surfaces curved within a texel", ge=0, le=1e6)
    ulps: float = param(4.0, "steps of the depth format added to the bias", ge=0, le=1e6)

    @property
    def on_plane(self) -> bool:
        return True

    @property
    def along_light(self) -> tuple[float, float]:
        return (0.0, self.slack)


class Texel(Bias):
    """Filter radius · texel diagonal · tan θ as a length along the ray; adapts to map size, fit and filter."""

    name = "texel"
    shader = "bias/texel.glsl"
    maps = frozenset({"2d", "array", "cube"})
    swept = ("scale",)
    scale: float = param(
        1.0, "multiple of the depth change of the receiver's plane over the filter radius", ge=0, le=100
    )
    limit: float = param(
        16.0, "largest bias, in filter radii · texel widths; doubled for spot and point lights", gt=0, le=1e6
    )
    ulps: float = param(4.0, "steps of the depth format added to the bias", ge=0, le=1e6)
    grazing: float = param(50.0, "tan θ from which the receiver is offset along its normal instead", ge=0, le=1e6)


class Sum(Bias):
    """The sum of two biases, `polygon-offset(2,4)+before-divide(0.01)`: the second applies to what the first has left.

    Not in the table of biases; specs form it with `+`. `second` may be a sum.
    """

    shader = "bias/sum.glsl"
    first: Annotated[Bias, BeforeValidator(Bias.from_value)]
    second: Annotated[Bias, BeforeValidator(Bias.from_value)]

    @model_validator(mode="after")
    def _has_one_form(self) -> Self:
        if isinstance(self.first, Sum):
            raise ValueError("first: found a sum; allowed: one bias")
        return self

    @property
    def terms(self) -> tuple[Bias, ...]:
        return (self.first, *self.second.terms)

    @property
    def on_plane(self) -> bool:
        return any(term.on_plane for term in self.terms)

    def scaled(self, factor: float) -> Self:
        return type(self)(first=self.first.scaled(factor), second=self.second.scaled(factor))

    @property
    def polygon_offset(self) -> tuple[float, float]:
        factors, units = zip(*(term.polygon_offset for term in self.terms), strict=True)
        return (sum(factors), sum(units))

    @property
    def cull(self) -> Literal["", "front"]:
        return next((term.cull for term in self.terms if term.cull), "")

    @property
    def depth_units(self) -> float | None:
        fixed = [term.depth_units for term in self.terms if term.depth_units is not None]
        return sum(fixed) if fixed else None

    @property
    def along_light(self) -> tuple[float, float]:
        metres, texels = zip(*(term.along_light for term in self.terms), strict=True)
        return (sum(metres), sum(texels))

    def along_normal(self, radius: float) -> float:
        return sum(term.along_normal(radius) for term in self.terms)
