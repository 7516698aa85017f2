"""Penumbrae: variation along their isolines, and widths along lines across the truth's shadow edges.

Such a line starts at an edge pixel and follows the truth's gradient on the receiver's plane, both ways, as long as the
receiver is that plane and the truth does not fall towards the light by more than its error. A width is that between
visibilities of 0.1 and 0.9, after isotonic smoothing by the mean of running maximum and running minimum.
"""

from dataclasses import dataclass
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from shadowbench.scores.masks import LEVELS, Floats, Mask, Single

Indices = NDArray[np.intp]
FloatType = TypeVar("FloatType", bound=np.floating)

SMOOTHING = 1.5  # px, σ of the Gaussian over which the direction of a gradient is found
SEGMENT = 3  # px along the isoline to either side
STRAIGHT = np.float32(np.cos(np.radians(30)))  # least cosine between the gradients at a segment's middle and ends
FLAT = 1e-6  # change of visibility per pixel up to which a gradient has no direction
MOST = 1000  # crossings, taken evenly from the edge pixels in the order of rows
FEWEST = 30  # crossings that a width is the median of
DARK, LIT = 0.1, 0.9  # visibilities between which a penumbra is measured
REACH = 4  # lines are as long to either side as this part of the image
SOFT_PX = 3.0  # px, narrowest penumbra of the truth that counts
WIDE_PX = 4.0  # px, narrowest penumbra that hardening is judged by
RANGE = 3.0  # least ratio of the 90th and the 10th percentile of the widths for hardening
ERRORS = 4.0  # standard errors by which the truth may fall towards the light
FLATNESS = 1e-3  # distance from the plane as a share of that along it
ON_GRID = 1e-4  # px, distance from a row or column of pixels up to which a point is on it, and so reads no other


def smooth_gradient(visibility: Single, valid: Mask) -> Single:
    """(2, H, W) change of visibility per pixel down and to the right, smoothed over the valid pixels."""
    from scipy import ndimage  # the import takes 0.2 s, and hard shadows do not need it

    weight = ndimage.gaussian_filter(valid.astype(np.float32), SMOOTHING)
    smooth = ndimage.gaussian_filter(np.where(valid, visibility, 0), SMOOTHING) / np.maximum(weight, FLAT)
    gradients = [np.gradient(smooth, axis=axis) if smooth.shape[axis] > 1 else 0 * smooth for axis in range(2)]
    return np.stack(gradients).astype(np.float32)


@dataclass(frozen=True, eq=False)
class Isolines:
    """Segments, SEGMENT pixels to either side of P pixels of a penumbra, along which the truth's isolines are straight.

    Where they curve, any smooth error varies along them. tangent: (2, P) unit vectors, in rows and columns.
    """

    rows: NDArray[np.int32]
    columns: NDArray[np.int32]
    tangent: Single

    @classmethod
    def of(cls, gradient: Single, penumbra: Mask) -> "Isolines":
        """gradient: (2, H, W) of the truth; penumbra: (H, W) bool."""
        rows, columns = (index.astype(np.int32) for index in np.nonzero(penumbra & (np.hypot(*gradient) > FLAT)))
        down, right = gradient[:, rows, columns]
        tangent = np.stack([-right, down]) / np.hypot(down, right)
        straight = np.ones(len(rows), np.bool_)
        for side in (np.float32(-SEGMENT), np.float32(SEGMENT)):
            ends = np.stack([rows, columns]).astype(np.float32) + side * tangent
            down_there, right_there = (_sampled(part, ends) for part in gradient)
            along = down_there * down + right_there * right
            least = STRAIGHT * np.sqrt(down_there**2 + right_there**2) * np.sqrt(down**2 + right**2)
            straight &= (along > 0) & (along >= least)
        return cls(rows[straight], columns[straight], np.ascontiguousarray(tangent[:, straight]))

    def variance(self, values: Single, valid: Mask, known: Single) -> float | None:
        """Sample variance of values (H, W) along the segments less the known one (H, W); None without a segment.

        Points count in pairs, so that what is linear along the segment has none.
        """
        from shadowbench.scores import loops

        squares = loops.variances_along(values, valid, self.rows, self.columns, self.tangent, SEGMENT)
        chosen = ~np.isnan(squares)
        if not chosen.any():
            return None
        return float(squares[chosen].mean() - known[self.rows, self.columns][chosen].mean(dtype=np.float64))


@dataclass(frozen=True, eq=False)
class Crossings:
    """Lines across a truth's penumbrae, C of those that were tried.

    lines: (2, C, K) rows and columns of points a pixel apart, from dark to lit; first, last: (C,) the part of each line
    that is used; along: (C, K) metres; width, width_px: (C,) of the truth, in metres and in pixels; pixel: (C,) metres
    along the line that a pixel covers.
    """

    tried: int
    lines: Single
    first: Indices
    last: Indices
    along: Single
    width: Floats
    width_px: Floats
    pixel: Floats

    def widths_of(self, visibility: Single) -> Floats:
        """(C,) widths of a mask (H, W) in metres, at least a pixel's."""
        widths = _widths(_sampled(visibility, self.lines), self.first, self.last, self.along)[0]
        return np.maximum(widths, self.pixel)

    def hardening(self, widths: Floats) -> tuple[float, float] | None:
        """Theil–Sen line (Theil 1950, Sen 1968) of (C,) widths over the truth's: slope, and intercept over its median.

        Over penumbrae wider than WIDE_PX; None if there are too few or their widths vary too little.
        """
        wide = self.width_px > WIDE_PX
        true, drawn = self.width[wide], widths[wide]
        if len(true) < FEWEST or np.percentile(true, 90) < RANGE * np.percentile(true, 10):
            return None
        one, other = np.triu_indices(len(true))
        apart = true[one] != true[other]
        one, other = one[apart], other[apart]
        slope = float(np.median((drawn[one] - drawn[other]) / (true[one] - true[other])))
        middle = float(np.median(true))
        return slope, float(np.median(drawn) - slope * middle) / middle


def crossings(
    visibility: Single, standard_error: Single, valid: Mask, edge: Mask, gradient: Single, positions: Floats
) -> Crossings:
    """Lines across the penumbrae of a truth, from its `edge` pixels; (H, W) arrays, gradient: (2, H, W)."""
    rows, columns = np.nonzero(edge[1:-1, 1:-1])
    chosen = np.linspace(0, len(rows) - 1, min(len(rows), MOST)).round().astype(np.intp)
    starts = np.stack([rows[chosen], columns[chosen]]) + 1
    normal, direction, flat = _across(starts, gradient, positions)
    starts, normal, direction = starts[:, flat], normal[flat], direction[:, flat]

    reach = max(1, max(visibility.shape) // REACH)
    steps = np.arange(-reach, reach + 1)
    points = (starts[..., np.newaxis] + steps * direction[..., np.newaxis]).astype(np.float32)
    lines = np.where(np.abs(points - np.round(points)) <= ON_GRID, np.round(points), points)
    away = np.stack([_sampled(positions[..., axis], points) for axis in range(3)], axis=-1)
    away -= positions[tuple(starts)][:, np.newaxis]
    distance = np.linalg.norm(away, axis=-1)
    usable = _sampled(valid.astype(np.float64), lines) > 1 - ON_GRID**2 / 2  # no other pixel has any weight
    usable &= np.abs(np.einsum("ckx,cx->ck", away, normal)) <= FLATNESS * distance
    truth = _sampled(visibility, lines)
    slack = ERRORS * _sampled(standard_error, lines) + 1 / LEVELS
    lit_side = _run(usable[:, reach:], truth[:, reach:], slack[:, reach:])
    dark_side = _run(usable[:, reach::-1], -truth[:, reach::-1], slack[:, reach::-1])
    first, last = reach - dark_side, reach + lit_side
    along = (np.sign(steps) * distance).astype(np.float32)
    width, width_px = _widths(truth, first, last, along)
    ends = truth[np.arange(len(first)), first], truth[np.arange(len(last)), last]
    accepted = (ends[0] < DARK) & (ends[1] > LIT) & (width_px >= SOFT_PX)
    pixel = (along[:, reach + 1] - along[:, reach - 1]) / 2
    return Crossings(
        len(chosen),
        lines[:, accepted],
        first[accepted],
        last[accepted],
        along[accepted],
        np.maximum(width, pixel)[accepted],
        width_px[accepted],
        pixel[accepted].astype(np.float64),
    )


def _across(starts: Indices, gradient: Single, positions: Floats) -> tuple[Floats, Floats, Mask]:
    """(S, 3) normal of the plane at each start, (2, S) steps of a pixel along the gradient, and where it is flat."""
    here = positions[tuple(starts)]
    ways = ((1, 0), (-1, 0), (0, 1), (0, -1))
    neighbours = [positions[starts[0] + down, starts[1] + right] - here for down, right in ways]
    down, right = (neighbours[0] - neighbours[1]) / 2, (neighbours[2] - neighbours[3]) / 2
    normal = np.cross(down, right)
    with np.errstate(invalid="ignore", divide="ignore"):
        normal /= np.linalg.norm(normal, axis=1, keepdims=True)
        # Steepest in metres: the gradient by pixels, times the inverse of the plane's metric in pixels.
        metric = np.einsum("isx,jsx->sij", np.stack([down, right]), np.stack([down, right]))
        slope = gradient[(slice(None), *starts)].astype(np.float64)
        direction = np.stack(
            [
                metric[:, 1, 1] * slope[0] - metric[:, 0, 1] * slope[1],
                metric[:, 0, 0] * slope[1] - metric[:, 0, 1] * slope[0],
            ]
        )
        direction /= np.hypot(*direction)
    flat = np.isfinite(normal).all(axis=1) & np.isfinite(direction).all(axis=0)
    for neighbour in neighbours:
        off = np.abs(np.einsum("sx,sx->s", neighbour, normal))
        flat &= off <= FLATNESS * np.linalg.norm(neighbour, axis=1)
    return normal, direction, flat


def _run(usable: Mask, rising: Single, slack: Single) -> Indices:
    """(C,) index up to which points (C, K) are usable, as the first is, and `rising` falls by no more than `slack`."""
    good = usable & (rising >= np.maximum.accumulate(rising, axis=1) - slack)
    length: Indices = np.logical_and.accumulate(good, axis=1).sum(axis=1)
    return length - 1


def _widths(profiles: Single, first: Indices, last: Indices, along: Single) -> tuple[Floats, Floats]:
    """(C,) distances between visibilities DARK and LIT on profiles (C, K), in metres and in steps."""
    index = np.clip(np.arange(profiles.shape[1]), first[:, np.newaxis], last[:, np.newaxis])
    used = np.take_along_axis(profiles, index, axis=1)
    highest = np.maximum.accumulate(used, axis=1)
    lowest = np.minimum.accumulate(used[:, ::-1], axis=1)[:, ::-1]
    isotonic: Single = (highest + lowest) * np.float32(0.5)
    (dark, dark_metres), (lit, lit_metres) = (_place(isotonic, level, first, last, along) for level in (DARK, LIT))
    return lit_metres - dark_metres, lit - dark


def _place(rising: Single, level: float, first: Indices, last: Indices, along: Single) -> tuple[Floats, Floats]:
    """(C,) where rising profiles reach a level, in steps and in metres, between `first` and `last`; else `last`."""
    rows = np.arange(len(rising))
    reached = rising >= level
    after = np.clip(np.where(reached.any(axis=1), np.argmax(reached, axis=1), last), first, last)
    before = np.maximum(after - 1, first)
    low, high = rising[rows, before].astype(np.float64), rising[rows, after].astype(np.float64)
    share = np.minimum(np.divide(level - low, high - low, out=np.ones_like(low), where=high > low), 1)
    metres = along[rows, before] + share * (along[rows, after] - along[rows, before])
    return before + share * (after - before), metres


def _sampled(values: NDArray[FloatType], lines: Single) -> NDArray[FloatType]:
    """(C, K) bilinear samples at (2, C, K) rows and columns, 0 outside the image."""
    from scipy import ndimage  # the import takes 0.2 s, and hard shadows do not need it

    sampled: NDArray[FloatType] = ndimage.map_coordinates(values, lines, order=1, mode="constant")
    return sampled
