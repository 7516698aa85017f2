"""Biases: what keeps a surface from shadowing itself. A row and, where it needs one, a shader file in `bias/`."""

from typing import Annotated, ClassVar, Literal, Self

from pydantic import BeforeValidator, model_validator

from shadowbench.techniques.grammar import Call, parse_value
from shadowbench.techniques.params import Row, param

MapKind = Literal["2d", "array", "cube"]


class Bias(Row):
    """Family of biases. `maps`: the map kinds that a row serves; `swept`: what a study's `bias_sweep` multiplies.

    Several that act together are a `Sum`, written with `+`.
    """

    maps: ClassVar[frozenset[MapKind]] = frozenset({"2d", "array"})
    swept: ClassVar[tuple[str, ...]] = ()
    shader = "bias/none.glsl"

    @classmethod
    def from_value(cls, value: "Row | str | Call") -> "Bias":
        """The bias, or the sum of biases, that a spec's value names; raises ValueError with the names allowed."""
        value = parse_value(value) if isinstance(value, str) else value
        if isinstance(value, Call) and value.name == "+":
            return Sum(**value.keywords(["first", "second"]))
        return value if isinstance(value, Sum) else super().from_value(value)

    @property
    def terms(self) -> "tuple[Bias, ...]":
        """The biases that act together."""
        return (self,)

    def scaled(self, factor: float) -> Self:
        """The same with what is `swept` multiplied; raises ValidationError beyond a parameter's limits."""
        return type(self)(**{**dict(self), **{name: getattr(self, name) * factor for name in self.swept}})

    @property
    def polygon_offset(self) -> tuple[float, float]:
        """(factor, units) of the depth pass."""
        return (0.0, 0.0)

    @property
    def cull(self) -> Literal["", "front"]:
        """Which faces the depth pass leaves out."""
        return ""

    @property
    def depth_units(self) -> float | None:
        """A bias that is fixed in [0, 1] depth, at its least; None for one that is not."""
        return None


class NoBias(Bias):
    """No bias: shows what acne costs."""

    name = "none"
    maps = frozenset({"2d", "array", "cube"})


class Constant(Bias):
    """The same everywhere: in units of depth, which in metres change with the fit, or in metres along the light."""

    name = "constant"
    shader = "bias/constant.glsl"
    maps = frozenset({"2d", "array", "cube"})
    swept = ("units", "world")
    units: float = param(0.005, "depth in [0, 1] that is subtracted from the receiver's", ge=0, le=1)
    world: float = param(0.0, "metres; takes the place of units where it is above 0", ge=0, metres=True)

    @property
    def depth_units(self) -> float | None:
        return None if self.world > 0 else self.units


class BeforeDivide(Bias):
    """Subtracted before the division by w, as published code that calls textureProj does.

    For a directional light, w being 1, the same as `constant`. For a spot w is the distance along its axis in metres:
    as a length along the axis the bias grows with that distance, not with its square as `constant` does.
    """

    name = "before-divide"
    shader = "bias/before-divide.glsl"
    swept = ("units",)
    units: float = param(0.01, "homogeneous depth that is subtracted from the receiver's", ge=0, le=1)

    @property
    def depth_units(self) -> float | None:
        return self.units


class Slope(Bias):
    """max · (1 − N·L), but at least min: as course notes publish it."""

    name = "slope"
    shader = "bias/slope.glsl"
    maps = frozenset({"2d", "array", "cube"})
    swept = ("max", "min")
    max: float = param(0.05, "depth at grazing light", ge=0, le=1)
    min: float = param(0.005, "depth at steep light", ge=0, le=1)

    @property
    def depth_units(self) -> float | None:
        return self.min


class PolygonOffset(Bias):
    """glPolygonOffset in the depth pass: by the polygon's own slope, plus units of the smallest step of the format."""

    name = "polygon-offset"
    swept = ("factor", "units")
    factor: float = param(2.0, "times the polygon's steepest depth slope a texel", ge=-100, le=100)
    units: float = param(4.0, "times the smallest step of the depth format", ge=-1e6, le=1e6)

    @property
    def polygon_offset(self) -> tuple[float, float]:
        return (self.factor, self.units)


class FrontCull(Bias):
    """The depth pass draws back faces only: for closed casters; thin ones and contact leak."""

    name = "front-cull"
    maps = frozenset({"2d", "array", "cube"})

    @property
    def cull(self) -> Literal["", "front"]:
        return "front"


class NormalOffset(Bias):
    """Moves the receiver along its normal by scale · radius texel diagonals · sin θ (Holbert 2011)."""

    name = "normal-offset"
    shader = "bias/normal-offset.glsl"
    maps = frozenset({"2d", "array", "cube"})
    swept = ("scale",)
    scale: float = param(1.0, "times the filter's reach", ge=0, le=100)
    ulps: float = param(4.0, "steps of the depth format on top", ge=0, le=1e6)


class ReceiverPlane(Bias):
    """Every texel is compared with the receiver's own plane above its centre (after Isidoro 2006)."""

    name = "receiver-plane"
    shader = "bias/receiver-plane.glsl"
    swept = ("slack",)
    gradient: Literal["plane", "derivative"] = param("plane", "from the geometric normal, or by screen derivatives")
    limit: float = param(10.0, "tan θ that the gradient is limited to", gt=0, le=1e6)
    slack: float = param(1.5, "texel widths along the ray, for surfaces that bend within a texel", ge=0, le=1e6)
    ulps: float = param(4.0, "steps of the depth format on top", ge=0, le=1e6)


class Texel(Bias):
    """Filter radius · texel diagonal · tan θ as a length along the ray: follows size, fit and filter."""

    name = "texel"
    shader = "bias/texel.glsl"
    maps = frozenset({"2d", "array", "cube"})
    swept = ("scale",)
    scale: float = param(1.0, "times the depth that the slope makes of the filter's reach", ge=0, le=100)
    limit: float = param(16.0, "most, in filter radii · texel widths; twice that under a lamp", gt=0, le=1e6)
    ulps: float = param(4.0, "steps of the depth format on top", ge=0, le=1e6)
    grazing: float = param(50.0, "tan θ from which the receiver moves along its normal instead", ge=0, le=1e6)


class Sum(Bias):
    """Biases that act together, `polygon-offset(2,4)+before-divide(0.01)`: offsets, moves and depths add up.

    No row of the family's table, but what specs join of them; `second` may be a sum again.
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
