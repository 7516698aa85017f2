"""The truth of a view, and a mask of the same view, with the quantities that several metrics share."""

import math
from collections.abc import Callable, Mapping
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from shadowbench.scores.masks import Mask, Single, ThresholdedMask, greatest, quantise, squared_distance
from shadowbench.scores.penumbrae import FEWEST, Crossings, Isolines, crossings, smooth_gradient

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
_BAND = 16 * 8192  # pixels; NumPy adds up float32 values in float64 by 8192
# The window, constants and border of scikit-image's `structural_similarity(gaussian_weights=True, sigma=1.5,
# use_sample_covariance=False, data_range=1)`, to which SSIM is equal if every pixel is valid.
RADIUS = 5  # int(3.5 sigma + ½)
C1, C2 = 0.01**2, 0.03**2
INSIDE = (slice(RADIUS, -RADIUS), slice(RADIUS, -RADIUS))
"""Pixels whose window lies inside the image; only these have a SSIM."""
_gaussian = np.exp(-0.5 * (np.arange(-RADIUS, RADIUS + 1) / 1.5) ** 2)
WEIGHTS = tuple(map(float, _gaussian / _gaussian.sum()))


class PreparedTruth(ThresholdedMask):
    """The truth of one view, prepared for metrics. Only `valid` pixels, decided receivers, are in any of the sets."""

    def __init__(self, arrays: Mapping[str, Any], positions: Callable[[], NDArray[np.float64]] | None = None) -> None:
        """The truth of the (H, W) arrays of a `Truth`, by name; `irradiance` and `triangle` are ignored.

        positions: returns (H, W, 3) points of the surfaces in metres, finite everywhere; called once, for a truth with
        penumbrae; None if unknown, so that no width of a penumbra is. Visibility and area are quantised, so that a
        stored mask of the truth has no error. Raises ValueError for values out of range.
        """
        self.undecided: Mask = np.asarray(arrays["undecided"], np.bool_)
        super().__init__(arrays["visibility"], np.asarray(arrays["receivers"], np.bool_) & ~self.undecided)
        self.area: Single = quantise(arrays["area"])
        self.blocker, self.cosine, self.standard_error = (
            np.asarray(arrays[name], np.float32) for name in ("blocker", "cosine", "standard_error")
        )
        self.diagonal = float(arrays["diagonal"])
        self._positions = positions
        smooth = arrays if "facet_shadow" in arrays else dict.fromkeys(SMOOTH, np.zeros(self.shape))
        self.shading_cosine: Single = np.ascontiguousarray(smooth["shading_cosine"], np.float32)
        self.facet_shadow: Mask = np.asarray(smooth["facet_shadow"], np.bool_) & ~self.undecided

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
        return total_of(np.positive, self.lit | self.facet_shadow, self.shading_cosine)

    @cached_property
    def cosine_sum(self) -> float:
        """Sum of N·L over valid pixels."""
        return total_of(np.positive, self.valid, self.cosine)

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
        return mean_of(np.positive, self.valid, self.variance) or 0.0

    @cached_property
    def mean_variance_pen(self) -> float:
        """Mean `variance` over the penumbra; 0 if there is none."""
        return mean_of(np.positive, self.penumbra, self.variance) or 0.0

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
    return greatest(pixels, reach)


class Comparison(ThresholdedMask):
    """A mask and the truth of its view: the argument of every metric.

    visibility: (H, W) in [0, 1], quantised here, so that a stored mask scores the same; values outside `prepared.valid`
    are ignored. Raises ValueError as `quantise` does, and for a shape other than that of `prepared`.
    """

    def __init__(self, visibility: ArrayLike, prepared: PreparedTruth) -> None:
        super().__init__(visibility, prepared.valid)
        self.truth = prepared
        if self.shape != prepared.shape:
            raise ValueError(f"visibility has shape {self.shape}; allowed: the truth's {prepared.shape}")

    @property
    def boundary(self) -> NDArray[np.bool_]:
        """Strip of shadow, as wide as the truth's, along the inside of its edge."""
        return self.shadow & (self.squared_edge_distance < self.truth.boundary_width**2)

    @cached_property
    def edge_distances(self) -> NDArray[np.float64] | None:
        """(E,) pixels from the edge pixels of either mask to the other's edge; if only one has any, the diagonal.

        None if neither has one.
        """
        both = self.truth.squared_edge_distance[self.edge], self.squared_edge_distance[self.truth.edge]
        if not all(squared.size for squared in both):
            return np.array([self.truth.image_diagonal]) if any(squared.size for squared in both) else None
        pooled: NDArray[np.float64] = np.sqrt(np.concatenate(both), dtype=np.float64)
        return pooled

    @property
    def signed_error(self) -> NDArray[np.float32]:
        """(H, W) difference from the truth's visibility, above 0 where the mask is lighter; meaningful where valid."""
        error: NDArray[np.float32] = self.visibility - self.truth.visibility
        return error

    @cached_property
    def mean_ssim(self) -> tuple[float | None, float | None]:
        """Mean SSIM (Wang et al. 2004) over valid pixels INSIDE, and over those in the truth's edge zone."""
        from shadowbench.scores import loops

        truth = self.truth
        similarity = loops.ssim_map(self.visibility, truth.visibility, truth.valid, WEIGHTS, C1, C2)
        inside, at_edge = (mean_of(np.positive, where[INSIDE], similarity) for where in (truth.valid, truth.edge_zone))
        return inside, at_edge

    @cached_property
    def penumbra_widths(self) -> NDArray[np.float64] | None:
        """(C,) widths of the mask's penumbrae at the truth's crossings, in metres; None if unknown."""
        across = self.truth.crossings
        return None if across is None else across.widths_of(self.visibility)

    @property
    def width_ratios(self) -> NDArray[np.float64] | None:
        """(C,) log₂ of the mask's over the truth's widths, above 0 where too wide; None if unknown or too few."""
        across, widths = self.truth.crossings, self.penumbra_widths
        if across is None or widths is None or len(widths) < FEWEST:
            return None
        ratios: NDArray[np.float64] = np.log2(widths / across.width)
        return ratios

    @property
    def width_bias(self) -> float | None:
        """Median of `width_ratios`; None where they are."""
        ratios = self.width_ratios
        return None if ratios is None else float(np.median(ratios))

    @cached_property
    def hardening(self) -> tuple[float, float] | None:
        """Slope and relative intercept of the mask's widths over the truth's (see `Crossings.hardening`)."""
        across, widths = self.truth.crossings, self.penumbra_widths
        return None if across is None or widths is None else across.hardening(widths)


def overlap(mask: Mask, truth: Mask) -> float | None:
    """Intersection over union of two sets; None if both are empty."""
    return ratio(int(np.count_nonzero(mask & truth)), int(np.count_nonzero(mask | truth)))


def share(wrong: Mask, region: Mask) -> float | None:
    """Share of a region that is `wrong`; None if it is empty."""
    return ratio(int(np.count_nonzero(wrong & region)), int(np.count_nonzero(region)))


def mean_of(function: Callable[..., Single], where: Mask, *images: Single) -> float | None:
    """Mean of a function of images over a set of pixels; None if it is empty."""
    return ratio(total_of(function, where, *images), int(np.count_nonzero(where)))


def total_of(function: Callable[..., Single], where: Mask, *images: Single) -> float:
    """Sum of a function of images over a set of pixels, in float64 and by bands, which stay in the cache."""
    # The last digits of a float32 sum would depend on its order, and so on the processor.
    flat, counted, sum_ = [image.ravel() for image in images], where.ravel(), 0.0
    for first in range(0, where.size, _BAND):
        band = slice(first, first + _BAND)
        values = function(*(image[band] for image in flat))
        sum_ = values.sum(where=counted[band], dtype=np.float64, initial=sum_)
    return float(sum_)


def ratio(part: float, whole: float) -> float | None:
    """A quotient; None for a denominator of 0."""
    return float(part / whole) if whole > 0 else None
