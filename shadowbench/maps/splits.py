"""Split schemes: the view depths at which cascades split the camera's frustum."""

from abc import abstractmethod
from typing import ClassVar

import numpy as np

from shadowbench.geometry.convex import PRACTICAL_WEIGHT, practical_depths
from shadowbench.plugin.params import Component, param
from shadowbench.scenes.vectors import Floats


class Split(Component):
    """Base class of the split schemes. slices: how many a scheme always has; None if any number."""

    slices: ClassVar[int | None] = None
    of_number = "practical"

    @abstractmethod
    def depths(self, near: float, far: float, count: int) -> Floats:
        """(count + 1,) non-decreasing view depths from near to far, which bound the slices."""


class PracticalSplit(Split):
    """The practical split λ · n (f/n)^(i/m) + (1 − λ) (n + (f − n) i/m) (Zhang, Sun, Xu and Lun 2006)."""

    name = "practical"
    weight: float = param(PRACTICAL_WEIGHT, "λ: 1 is the logarithmic split, 0 the uniform one", ge=0, le=1)

    def depths(self, near: float, far: float, count: int) -> Floats:
        return practical_depths(near, far, count, self.weight)


class FixedSplit(Split):
    """Five slices that end at far/50, far/25, far/10, far/2 and far; a slice that ends before near is empty."""

    name = "fixed"
    slices = 5

    def depths(self, near: float, far: float, count: int) -> Floats:
        return np.maximum(near, [near, far / 50, far / 25, far / 10, far / 2, far])


class ShareSplit(Split):
    """Four slices that end at shares of far, as engines set them. One that ends before the slice in front is empty."""

    name = "shares"
    slices = 4
    first: float = param(0.1, "end of the first slice as a share of far", gt=0, le=1)
    second: float = param(0.2, "end of the second slice", gt=0, le=1)
    third: float = param(0.5, "end of the third slice", gt=0, le=1)

    def depths(self, near: float, far: float, count: int) -> Floats:
        ends = np.array([0.0, self.first, self.second, self.third, 1.0]) * far
        return np.maximum.accumulate(np.maximum(near, ends))
