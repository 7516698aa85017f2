"""The truth of a view with quantities derived from it alone, shared by all masks scored against it."""

import math
from collections.abc import Callable, Mapping
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from shadowbench.scores.masks import ThresholdedMask, quantise, squared_distance
from shadowbench.scores.penumbrae import Crossings, Isolines, crossings, smooth_gradient
from shadowbench.scores.sums import Mask, Single, mean, total

INTERIOR_PX = 4.0  # distance from the edge beyond which errors count as acne or leak
EDGE_ZONE_PX = 8.0
BOUNDARY_WIDTH = 0.02  # share of the image's diagonal (Cheng et al. 2021)
CONTACT_DISTANCE = 0.02  # share of the scene's diagonal
PENUMBRA = (0.02, 0.98)  # visibility in a penumbra, exclusive
PENUMBRA_MARGIN_PX = 2
UMBRA, FULL_LIGHT = 0.01, 0.99  # visibility below which a pixel is in the umbra, above which in full light
RESOLVED_STEP = 2.0  # standard errors above which a step of the truth is one
SMOOTH = ("shading_cosine", "facet_shadow")
KERNEL_PX = 8  # how far a filter may reach into umbra and full light


class PreparedTruth(ThresholdedMask):
    """The truth of one view, prepared for metrics. Only `valid` pixels, decided receivers, are in any of the sets.

    Derived arrays are computed on first use and kept, about 30 MB at 1024², 45 MB if there is a penumbra.
    """

    def __init__(self, arrays: Mapping[str, Any], positions: Callable[[], NDArray[np.float64]] | None = None) -> None:
        """The truth of (H, W) arrays by name; others than these are ignored.

        visibility, standard_error, receivers, undecided, area, blocker, cosine, diagonal, and where there are smooth
        surfaces shading_cosine and facet_shadow: as of a `Truth`. positions:
        returns (H, W, 3) points of the surfaces in metres, finite everywhere; called once, for a truth with penumbrae;
        None if unknown, so that no width of a penumbra is. Visibility and area are quantised, so that a stored mask of
        the truth has no error. Raises ValueError for arrays of different shapes and values out of range.
        """
        self.undecided: Mask = np.asarray(arrays["undecided"], np.bool_)
        super().__init__(arrays["visibility"], np.asarray(arrays["receivers"], np.bool_) & ~self.undecided)
        self.area: Single = quantise(arrays["area"])
        self.blocker, self.cosine, self.standard_error = (
            np.asarray(arrays[name], np.float32) for name in ("blocker", "cosine", "standard_error")
        )
        self.diagonal = float(arrays["diagonal"])
        self._positions = positions
        none = dict.fromkeys(SMOOTH, np.zeros(self.shape))
        smooth = arrays if "facet_shadow" in arrays else none
        self.shading_cosine: Single = np.ascontiguousarray(smooth["shading_cosine"], np.float32)
        self.facet_shadow: Mask = np.asarray(smooth["facet_shadow"], np.bool_) & ~self.undecided
        for name in (*("area", "blocker", "cosine", "standard_error", "undecided", "valid"), *SMOOTH):
            found = getattr(self, name).shape
            if found != self.shape:
                raise ValueError(f"{name} has shape {found}, visibility {self.shape}; allowed: the same")

    @property
    def image_diagonal(self) -> float:
        """Diagonal in pixels; the edge distance of a mask without an edge if the truth has one."""
        return math.hypot(*self.shape)

    @cached_property
    def pixels(self) -> int:
        """Number of valid pixels."""
        return int(np.count_nonzero(self.valid))

    @cached_property
    def boundary_width(self) -> int:
        """Width in pixels, as in Cheng et al.'s code: 2% of the image's diagonal, rounded, at least 1."""
        return max(1, round(BOUNDARY_WIDTH * self.image_diagonal))

    @cached_property
    def squared_edge_distance(self) -> NDArray[np.int32]:
        """Squared distance to `edge` in pixels; NOWHERE if there is no edge."""
        return squared_distance(self.edge)

    @cached_property
    def boundary(self) -> Mask:
        """Strip of shadow, `boundary_width` pixels wide, along the inside of its edge."""
        return self.shadow & (self.squared_edge_distance < self.boundary_width**2)

    @cached_property
    def edge_zone(self) -> Mask:
        """Valid pixels whose centre is within 8 px of the border between shadow and light."""
        # `edge` lies on the shadow's side of the border, half a pixel from it.
        in_shadow = (EDGE_ZONE_PX - 0.5) ** 2
        in_light = (EDGE_ZONE_PX + 0.5) ** 2
        near_shadow = self.shadow & (self.squared_edge_distance <= in_shadow)
        return near_shadow | (self.lit & (self.squared_edge_distance <= in_light))

    @cached_property
    def lit_interior(self) -> Mask:
        """Lit pixels at least 4 px from shadow and from undecided pixels: darkness here is acne."""
        return self.lit & (squared_distance(self.shadow | self.undecided) >= INTERIOR_PX**2)

    @cached_property
    def shadow_interior(self) -> Mask:
        """Shadowed pixels at least 4 px from light and from undecided pixels: light here has leaked."""
        return self.shadow & (squared_distance(self.lit | self.undecided) >= INTERIOR_PX**2)

    @cached_property
    def contact(self) -> Mask:
        """Shadowed pixels whose occluder is closer than 2% of the scene's diagonal."""
        return self.shadow & (self.blocker < CONTACT_DISTANCE * self.diagonal)

    @cached_property
    def smooth_light(self) -> float:
        """Sum of N·L by smooth normals over the pixels that are lit, or that only the surface's own facets shadow."""
        return total(self.shading_cosine, self.lit | self.facet_shadow)

    @cached_property
    def cosine_sum(self) -> float:
        """Sum of N·L over valid pixels."""
        return total(self.cosine, self.valid)

    @cached_property
    def penumbra(self) -> Mask:
        """Valid pixels within 2 px, along rows and columns, of one whose visibility is between 0.02 and 0.98."""
        inside = self.valid & (self.visibility > PENUMBRA[0]) & (self.visibility < PENUMBRA[1])
        return self.valid & _spread(inside, PENUMBRA_MARGIN_PX)

    @cached_property
    def soft(self) -> bool:
        """Whether there is a penumbra."""
        return bool(self.penumbra.any())

    @cached_property
    def umbra(self) -> Mask:
        """Valid pixels darker than 0.01, at least 8 px along rows and columns from lighter and undecided ones."""
        lighter = self.valid & (self.visibility >= UMBRA)
        return self.valid & ~_spread(lighter | self.undecided, KERNEL_PX)

    @cached_property
    def full_light(self) -> Mask:
        """Valid pixels lighter than 0.99, at least 8 px along rows and columns from darker and undecided ones."""
        darker = self.valid & (self.visibility <= FULL_LIGHT)
        return self.valid & ~_spread(darker | self.undecided, KERNEL_PX)

    @cached_property
    def variance(self) -> Single:
        """Squared standard error of the visibility; 0 where it is 0 or 1.

        All points of the light agree there, and the error bar is 1/N, a bound: errors are several times smaller.
        """
        return np.where((self.visibility > 0) & (self.visibility < 1), self.standard_error**2, 0)

    @cached_property
    def mean_variance(self) -> float:
        """Mean `variance` over valid pixels; 0 if there are none."""
        return mean(self.variance, self.valid) or 0.0

    @cached_property
    def mean_variance_pen(self) -> float:
        """Mean `variance` over the penumbra; 0 if there is none."""
        return mean(self.variance, self.penumbra) or 0.0

    @cached_property
    def step_squared(self) -> Single:
        """Squared change of visibility from pixel to pixel."""
        from shadowbench.scores import loops

        squared: Single = loops.step_squared(self.visibility, self.valid)
        return squared

    @cached_property
    def resolved(self) -> Mask:
        """Pixels at which visibility changes by more than its error."""
        resolved: Mask = self.step_squared > RESOLVED_STEP**2 * self.standard_error**2
        return resolved

    @cached_property
    def _gradient(self) -> Single:
        return smooth_gradient(self.visibility, self.valid)

    @cached_property
    def isolines(self) -> Isolines:
        """Segments of isolines through the penumbra."""
        return Isolines.of(self._gradient, self.penumbra)

    @cached_property
    def crossings(self) -> Crossings | None:
        """Lines across the penumbrae; None without a penumbra or positions."""
        if not self.soft or self._positions is None:
            return None
        positions = self._positions()
        return crossings(self.visibility, self.standard_error, self.valid, self.edge, self._gradient, positions)


def _spread(pixels: Mask, reach: int) -> Mask:
    """(H, W) bool: pixels within `reach` of others along rows and columns, in a square."""
    if not pixels.any():
        return pixels
    from shadowbench.scores import loops

    spread: Mask = loops.greatest(pixels.view(np.uint8), reach).view(bool)
    return spread
