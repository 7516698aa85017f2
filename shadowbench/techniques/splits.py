"""Splits: the view depths at which cascades cut the camera's frustum."""

import numpy as np

from shadowbench.geometry.slices import PRACTICAL_WEIGHT, practical_depths
from shadowbench.scenes.model import Floats
from shadowbench.techniques.params import Row, param


class Split(Row):
    """Family of splits."""

    def depths(self, near: float, far: float, count: int) -> Floats:
        """(count + 1,) view depths from near to far, not falling; the slices lie between them."""
        raise NotImplementedError(self.name)


class Practical(Split):
    """λ · n (f/n)^(i/m) + (1 − λ) (n + (f − n) i/m) (Zhang, Sun, Xu and Lun 2006)."""

    name = "practical"
    weight: float = param(PRACTICAL_WEIGHT, "λ: 1 splits by equal ratios of depth, 0 by equal lengths", ge=0, le=1)

    def depths(self, near: float, far: float, count: int) -> Floats:
        return practical_depths(near, far, count, self.weight)


class Shares(Split):
    """Five slices that end at far/50, far/25, far/10, far/2 and far; one that ends before near is empty."""

    name = "fixed"

    def depths(self, near: float, far: float, count: int) -> Floats:
        return np.maximum(near, [near, far / 50, far / 25, far / 10, far / 2, far])
