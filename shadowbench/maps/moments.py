"""Filterable shadow maps: what they store is blurred and filtered before it is compared."""

import math
from typing import Literal

from shadowbench.maps.biases import ALL_MAPS
from shadowbench.maps.filters import Contents, Filter, Kernel
from shadowbench.plugin.params import param

Bits = Literal[16, 32]


class Filterable(Filter):
    """Base class of filters whose contents are blurred: reads once per pixel, however wide the blur."""

    maps = ALL_MAPS
    blur: int = param(5, "texels along a side of the blur's kernel; 1 for none", ge=1, le=64)
    kernel: Kernel = param("box", "weights of the blur; a Gaussian's standard deviation is a quarter of its width")
    mips: bool = param(False, "mip levels, with a footprint from the receiver's plane")

    def radius(self, size: int) -> float:
        return 1.0  # of the bilinear read; a symmetric blur leaves the mean depth of a plane as it is

    def reach(self, size: int) -> float:
        return self.blur / 2 + 1

    @property
    def reads(self) -> int:
        return 1


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
        return Contents(2, _float(self.bits), blur=self.blur, kernel=self.kernel, mips=self.mips)


class ESM(Filterable):
    """Exponential shadow map: the mean of e^(c·depth) over that of the receiver (Annen et al. 2008).

    Leaks at contacts, and wherever the kernel holds texels deeper than the receiver.
    """

    name = "esm"
    shader = "filter/esm.glsl"
    c: float = param(80.0, "sharpness; e^c overflows beyond 87", gt=0, le=87)

    @property
    def contents(self) -> Contents:
        return Contents(1, blur=self.blur, kernel=self.kernel, mips=self.mips)


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
        return Contents(self.components, _float(self.bits), blur=self.blur, kernel=self.kernel, mips=self.mips)


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
        dtype: Literal["f4", "nu2"] = "f4" if self.bits == 32 else "nu2"
        return Contents(4, dtype, blur=self.blur, kernel=self.kernel, mips=self.mips)


def _float(bits: Bits) -> Literal["f2", "f4"]:
    return "f2" if bits == 16 else "f4"
