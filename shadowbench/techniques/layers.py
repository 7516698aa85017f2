"""Upper bound on the number of caster layers that a light ray crosses, from the silhouette alone."""

import numpy as np

from shadowbench.geometry.topology import Singles
from shadowbench.scenes.model import Light
from shadowbench.scenes.vectors import Floats, perpendicular_basis, unit

_ROUNDING = 1e-6  # of the largest coordinate: exceeds the float32 rounding of a silhouette


class LayerBound:
    """Bounds the layers by the silhouette edges that a half-plane through the light crosses.

    On a curve between two light rays, the number of layers changes only at silhouette edges, at each by its weight. The
    curves are half-planes of parallel rays, which come from where there are no casters, or for a light with a position
    half-planes bounded by a line through it, on which they come from the ray that meets the fewest triangles' boxes.
    """

    def __init__(self, triangles: Floats) -> None:
        """Triangles: (F, 3, 3) corners of the casters."""
        low, high = (triangles.min(axis=1), triangles.max(axis=1)) if len(triangles) else np.zeros((2, 0, 3))
        self._low: Floats = low.T
        self._high: Floats = high.T

    def __call__(self, light: Light, edges: Singles) -> float:
        """Upper bound on the layers along any ray of the light.

        edges: (N, 6) edges a → b of the silhouette with the casters to their left as seen from the light, each as often
        as its weight.
        """
        a, b = edges[:, :3].astype(np.float64), edges[:, 3:].astype(np.float64)
        rounding = _ROUNDING * float(max(np.abs(edges).max(initial=0.0), np.abs(light.position).max()))
        if light.kind == "directional":
            basis = perpendicular_basis(-unit(light.direction), (0.0, 1.0, 0.0))
            start, end = a @ basis[0], b @ basis[0]
            rising = end >= start - rounding
            return float(_most_at_once(start[rising] - rounding, end[rising] + rounding))
        axis, sign, crossed = self._emptiest(np.array(light.position), rounding)
        return crossed + _most_around(a - light.position, b - light.position, axis, sign, rounding)

    def _emptiest(self, point: Floats, rounding: float) -> tuple[int, int, int]:
        """Of the six rays from a point along the axes, the one that meets the fewest boxes: axis, sign and number."""
        above, below = self._low <= point[:, None] + rounding, self._high >= point[:, None] - rounding
        met = {}
        for axis in range(3):
            i, j = (axis + 1) % 3, (axis + 2) % 3
            beside = above[i] & below[i] & above[j] & below[j]
            met[axis, 1], met[axis, -1] = int((beside & below[axis]).sum()), int((beside & above[axis]).sum())
        (axis, sign), fewest = min(met.items(), key=lambda item: item[1])
        return axis, sign, fewest


def _most_around(a: Floats, b: Floats, axis: int, sign: int, rounding: float) -> int:
    """Number of edges a → b, counter-clockwise about an axis through the origin, that a half-plane crosses at most.

    An edge within `rounding` of the axis counts for every half-plane, and so does one of either direction that is as
    narrow, where it is.
    """
    i, j = (axis + 1) % 3, (axis + 2) % 3
    p, q = a[:, [i, j]], b[:, [i, j]]
    along = q - p
    steps = np.clip(-(p * along).sum(axis=1) / np.maximum((along**2).sum(axis=1), np.finfo(float).tiny), 0.0, 1.0)
    distance = np.hypot(*(p + steps[:, None] * along).T)
    near = distance <= 4 * rounding
    p, q, distance = p[~near], q[~near], distance[~near]
    start = np.arctan2(p[:, 1], p[:, 0])
    turn = (np.arctan2(q[:, 1], q[:, 0]) - start + np.pi) % (2 * np.pi) - np.pi
    slack = 2 * rounding / distance
    counted = sign * turn >= -slack
    start, turn, slack = start[counted], turn[counted], slack[counted]
    first = np.minimum(start, start + turn) - slack
    last = first + np.abs(turn) + 2 * slack
    turns = 2 * np.pi * np.array([[-1], [0], [1]])  # an interval may extend beyond −π or π
    return int(near.sum()) + _most_at_once((first + turns).ravel(), (last + turns).ravel())


def _most_at_once(first: Floats, last: Floats) -> int:
    """Largest number of intervals that share a point."""
    order = np.argsort(np.concatenate([first, last]), kind="stable")  # where one ends as another begins, both count
    return int(np.cumsum(np.where(order < len(first), 1, -1)).max(initial=0))
