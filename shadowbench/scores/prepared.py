"""The truth of a view with quantities derived from it alone, shared by all masks scored against it."""

import math
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from shadowbench.scores.edges import squared_distance
from shadowbench.scores.masks import quantise
from shadowbench.scores.ssim import WindowMoments, window_moments
from shadowbench.scores.thresholded import ThresholdedMask

INTERIOR_PX = 4.0  # distance from the edge beyond which errors count as acne or leak
EDGE_ZONE_PX = 8.0
BOUNDARY_WIDTH = 0.02  # share of the image's diagonal (Cheng et al. 2021)
CONTACT_DISTANCE = 0.02  # share of the scene's diagonal


class PreparedTruth(ThresholdedMask):
    """The truth of one view, prepared for metrics.

    Derived arrays are computed on first use and kept, about 50 MB at 1024². Only `valid` pixels, decided receivers,
    are in any of the sets.
    """

    def __init__(
        self,
        *,
        visibility: ArrayLike,
        receivers: ArrayLike,
        undecided: ArrayLike,
        area: ArrayLike,
        blocker: ArrayLike,
        cosine: ArrayLike,
        diagonal: float,
    ) -> None:
        """All arrays are (H, W).

        visibility: in [0, 1], 1 lit and 0 in shadow. receivers, undecided: bool. area: visibility averaged over the
        pixel, in [0, 1]. blocker: distance towards the light to the nearest occluder, inf if none. cosine: N·L, not
        negative on valid pixels. diagonal: of the scene, > 0, in the unit of `blocker`.
        Visibility and area are quantised, so that a stored mask of the truth has no error. Raises ValueError for arrays
        of different shapes and values out of range.
        """
        self.undecided: NDArray[np.bool_] = np.asarray(undecided, np.bool_)
        super().__init__(visibility, np.asarray(receivers, np.bool_) & ~self.undecided)
        self.area: NDArray[np.float32] = quantise(area)
        self.blocker: NDArray[np.float32] = np.asarray(blocker, np.float32)
        self.cosine: NDArray[np.float32] = np.asarray(cosine, np.float32)
        self.diagonal = float(diagonal)
        for name in ("area", "blocker", "cosine", "undecided", "valid"):
            found = getattr(self, name).shape
            if found != self.shape:
                raise ValueError(f"{name} has shape {found}, visibility {self.shape}; allowed: the same")
        if not (math.isfinite(self.diagonal) and self.diagonal > 0):
            raise ValueError(f"diagonal is {diagonal}; allowed: a length > 0")
        bad = np.count_nonzero(self.valid & ~((self.cosine >= 0) & np.isfinite(self.cosine)))
        if bad:
            raise ValueError(f"cosine is negative, NaN or infinite in {bad} valid pixels")

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
    def boundary(self) -> NDArray[np.bool_]:
        """Strip of shadow, `boundary_width` pixels wide, along the inside of its edge."""
        return self.shadow & (self.squared_edge_distance < self.boundary_width**2)

    @cached_property
    def edge_zone(self) -> NDArray[np.bool_]:
        """Valid pixels whose centre is within 8 px of the border between shadow and light."""
        # `edge` lies on the shadow's side of the border, half a pixel from it.
        in_shadow = (EDGE_ZONE_PX - 0.5) ** 2
        in_light = (EDGE_ZONE_PX + 0.5) ** 2
        near_shadow = self.shadow & (self.squared_edge_distance <= in_shadow)
        return near_shadow | (self.lit & (self.squared_edge_distance <= in_light))

    @cached_property
    def lit_interior(self) -> NDArray[np.bool_]:
        """Lit pixels at least 4 px from shadow and from undecided pixels: darkness here is acne."""
        return self.lit & (squared_distance(self.shadow | self.undecided) >= INTERIOR_PX**2)

    @cached_property
    def shadow_interior(self) -> NDArray[np.bool_]:
        """Shadowed pixels at least 4 px from light and from undecided pixels: light here has leaked."""
        return self.shadow & (squared_distance(self.lit | self.undecided) >= INTERIOR_PX**2)

    @cached_property
    def contact(self) -> NDArray[np.bool_]:
        """Shadowed pixels whose occluder is closer than 2% of the scene's diagonal."""
        return self.shadow & (self.blocker < CONTACT_DISTANCE * self.diagonal)

    @cached_property
    def cosine_sum(self) -> float:
        """Sum of N·L over valid pixels."""
        return float(self.cosine.sum(where=self.valid, dtype=np.float64))

    @cached_property
    def ssim_moments(self) -> WindowMoments:
        """Window moments of the truth for SSIM."""
        return window_moments(self.visibility, self.valid)
