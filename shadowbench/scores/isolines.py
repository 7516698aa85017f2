"""Gradients of visibility over valid pixels, and variation along the isolines of a penumbra."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

Single = NDArray[np.float32]
Mask = NDArray[np.bool_]

SMOOTHING = 1.5  # px, σ of the Gaussian over which the direction of a gradient is found
REACH = 3  # px along the isoline to either side
STRAIGHT = np.float32(np.cos(np.radians(30)))  # least cosine between the gradients at a segment's middle and ends
FLAT = 1e-6  # change of visibility per pixel up to which a gradient has no direction


def step_squared(visibility: Single, valid: Mask) -> Single:
    """(H, W) squared gradient by central differences, per pixel; along an axis only where both neighbours are valid."""
    squared = np.zeros(visibility.shape, np.float32)
    for axis in range(2):
        values, counted = np.moveaxis(visibility, axis, 0), np.moveaxis(valid, axis, 0)
        step = np.where(counted[2:] & counted[:-2], (values[2:] - values[:-2]) / 2, 0)
        np.moveaxis(squared, axis, 0)[1:-1] += step * step
    return squared


def smooth_gradient(visibility: Single, valid: Mask) -> Single:
    """(2, H, W) change of visibility per pixel down and to the right, smoothed over the valid pixels."""
    weight = ndimage.gaussian_filter(valid.astype(np.float32), SMOOTHING)
    smooth = ndimage.gaussian_filter(np.where(valid, visibility, 0), SMOOTHING) / np.maximum(weight, FLAT)
    return np.stack([np.gradient(smooth, axis=axis).astype(np.float32) for axis in range(2)])


@dataclass(frozen=True, eq=False)
class Isolines:
    """Segments of REACH pixels to either side of P pixels of a penumbra, along which the truth's isolines are straight.

    Where isolines curve within that length, as around pinholes, a segment leaves its isoline and any smooth error, such
    as a blur, varies along it.

    rows, columns: (P,) pixels; ahead, behind: (REACH, 2, P) rows and columns of points on the segment; weight_ahead,
    weight_behind: (REACH, P) how far they lie on valid pixels, in [0, 1].
    """

    rows: NDArray[np.intp]
    columns: NDArray[np.intp]
    ahead: Single
    behind: Single
    weight_ahead: Single
    weight_behind: Single

    @classmethod
    def of(cls, gradient: Single, valid: Mask, penumbra: Mask) -> "Isolines":
        """gradient: (2, H, W) of the truth; penumbra: (H, W) bool."""
        rows, columns = np.nonzero(penumbra & (np.hypot(*gradient) > FLAT))
        down, right = gradient[:, rows, columns]
        tangent = np.stack([-right, down]) / np.hypot(down, right)
        steps = np.arange(1, REACH + 1, dtype=np.float32)[:, np.newaxis, np.newaxis] * tangent
        here = np.stack([rows, columns]).astype(np.float32)
        ahead, behind = here + steps, here - steps
        straight = _straight(gradient, np.stack([down, right]), np.stack([ahead[-1], behind[-1]]))
        rows, columns, ahead, behind = rows[straight], columns[straight], ahead[..., straight], behind[..., straight]
        counted = valid.astype(np.float32)
        return cls(rows, columns, ahead, behind, _sampled(counted, ahead), _sampled(counted, behind))

    def variance(self, values: Single, valid: Mask, known: Single) -> float | None:
        """Mean square by which values (H, W) differ from their mean along the segment, less the known variance (H, W).

        As of a sample's variance, n/(n − 1) times: independent values keep theirs. Points count in pairs, so that what
        is linear along the segment has none. Segments with no more than half a pair are left out; None if all are.
        """
        counted = np.where(valid, values, 0)
        # A point's value is its sample over its weight, and a pair counts by the product of its two weights.
        pairs = self.weight_behind * _sampled(counted, self.ahead) + self.weight_ahead * _sampled(counted, self.behind)
        number = 1 + 2 * (self.weight_ahead * self.weight_behind).sum(axis=0)
        chosen = number > 2
        if not chosen.any():
            return None
        here = values[self.rows, self.columns]
        away, number = (here - (here + pairs.sum(axis=0)) / number)[chosen], number[chosen]
        squares = away.astype(np.float64) ** 2 * number / (number - 1)
        return float(squares.mean() - known[self.rows, self.columns][chosen].mean(dtype=np.float64))


def _straight(gradient: Single, here: Single, ends: Single) -> Mask:
    """(P,) whether the gradients at both ends (2, 2, P) of segments have about the direction of that `here` (2, P)."""
    there = np.stack([_sampled(part, ends) for part in gradient], axis=1)
    along = (there * here).sum(axis=1)
    least = STRAIGHT * np.linalg.norm(there, axis=1) * np.linalg.norm(here, axis=0)
    straight: Mask = ((along >= least) & (along > 0)).all(axis=0)
    return straight


def _sampled(values: Single, points: Single) -> Single:
    """(K, P) bilinear samples at (K, 2, P) rows and columns, 0 outside the image."""
    return np.stack([ndimage.map_coordinates(values, part, order=1, mode="constant") for part in points])
