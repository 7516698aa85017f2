"""Smooth gradients of visibility, and variation along the isolines of a penumbra."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Single = NDArray[np.float32]
Mask = NDArray[np.bool_]

SMOOTHING = 1.5  # px, σ of the Gaussian over which the direction of a gradient is found
REACH = 3  # px along the isoline to either side
STRAIGHT = np.float32(np.cos(np.radians(30)))  # least cosine between the gradients at a segment's middle and ends
FLAT = 1e-6  # change of visibility per pixel up to which a gradient has no direction


def smooth_gradient(visibility: Single, valid: Mask) -> Single:
    """(2, H, W) change of visibility per pixel down and to the right, smoothed over the valid pixels."""
    from scipy import ndimage  # the import takes 0.2 s, and hard shadows do not need it

    weight = ndimage.gaussian_filter(valid.astype(np.float32), SMOOTHING)
    smooth = ndimage.gaussian_filter(np.where(valid, visibility, 0), SMOOTHING) / np.maximum(weight, FLAT)
    gradients = [np.gradient(smooth, axis=axis) if smooth.shape[axis] > 1 else 0 * smooth for axis in range(2)]
    return np.stack(gradients).astype(np.float32)


@dataclass(frozen=True, eq=False)
class Isolines:
    """Segments of REACH pixels to either side of P pixels of a penumbra, along which the truth's isolines are straight.

    Where they curve, as around pinholes, any smooth error, such as a blur, varies along a segment. rows, columns: (P,)
    pixels; tangent: (2, P) unit vectors along the segments, in rows and columns.
    """

    rows: NDArray[np.int32]
    columns: NDArray[np.int32]
    tangent: Single

    @classmethod
    def of(cls, gradient: Single, penumbra: Mask) -> "Isolines":
        """gradient: (2, H, W) of the truth; penumbra: (H, W) bool."""
        from shadowbench.scores import loops

        rows, columns = (index.astype(np.int32) for index in np.nonzero(penumbra & (np.hypot(*gradient) > FLAT)))
        down, right = gradient[:, rows, columns]
        tangent = np.stack([-right, down]) / np.hypot(down, right)
        straight = loops.straight(gradient, rows, columns, tangent, np.float32(REACH), STRAIGHT)
        return cls(rows[straight], columns[straight], np.ascontiguousarray(tangent[:, straight]))

    def variance(self, values: Single, valid: Mask, known: Single) -> float | None:
        """Mean square by which values (H, W) differ from their mean along the segment, less the known variance (H, W).

        As of a sample's variance, n/(n − 1) times: independent values keep theirs. Points count in pairs, so that what
        is linear along the segment has none. Segments with no more than half a pair are left out; None if all are.
        """
        from shadowbench.scores import loops

        squares = loops.variances_along(values, valid, self.rows, self.columns, self.tangent, REACH)
        chosen = ~np.isnan(squares)
        if not chosen.any():
            return None
        return float(squares[chosen].mean() - known[self.rows, self.columns][chosen].mean(dtype=np.float64))
