"""Light space, and light views: the part of light space that a shadow map covers."""

from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from shadowbench.scenes.model import Light
from shadowbench.scenes.vectors import Floats, perpendicular_basis, unit

_SAME = 0.01  # radians between two angles, of which the better stands for both


@dataclass(frozen=True, eq=False)
class Box:
    """Bounds in light space, (x, y, distance along the axis); for a spot, x and y are divided by the distance."""

    low: Floats
    high: Floats

    @property
    def area(self) -> float:
        """Of the rectangle in x and y."""
        return float(np.prod((self.high - self.low)[:2]))


@dataclass(frozen=True, eq=False)
class LightSpace:
    """A coordinate system that depends on the light only, so that a moving camera cannot rotate the map, or `rotated`.

    basis: (3, 3) rows right, up, back, with −back the light's direction; perspective: True for a spot; half: tangent of
    its half angle, inf for a directional light.
    """

    basis: Floats
    origin: Floats
    perspective: bool
    half: float

    @cached_property
    def matrix(self) -> Floats:
        """(4, 4) world to light space."""
        matrix = np.eye(4)
        matrix[:3, :3] = self.basis
        matrix[:3, 3] = -self.basis @ self.origin
        return matrix

    def coords(self, points: Floats) -> Floats:
        """(N, 3) coordinates, as in `Box`, of (N, 3) points, which for a spot must be in front of it."""
        x, y, back = ((points - self.origin) @ self.basis.T).T
        flat = np.column_stack([x, y]) / (-back[:, None] if self.perspective else 1.0)
        return np.column_stack([flat, -back])

    def box(self, points: Floats) -> Box:
        """Bounds of (N, 3) points, which for a spot must be in front of it."""
        coords = self.coords(points)
        return Box(coords.min(axis=0), coords.max(axis=0))

    def rotated(self, angle: float) -> "LightSpace":
        """This space with x and y rotated about the light's axis."""
        cosine, sine = np.cos(angle), np.sin(angle)
        turn = np.array([[cosine, sine, 0.0], [-sine, cosine, 0.0], [0.0, 0.0, 1.0]])
        return replace(self, basis=turn @ self.basis)

    def oriented(self, points: Floats, count: int = 1) -> "list[LightSpace]":
        """This space rotated to sides of the hull of (N, 3) points, up to `count`, by the area of their box there.

        At no angle is it less than in the first: a least rectangle has a side on the hull's (Freeman and Shapira 1975).
        """
        from scipy.spatial import ConvexHull, QhullError  # the import takes 0.3 s

        flat = self.coords(points)[:, :2]
        with suppress(QhullError):  # of points on a line, all differences have its direction
            flat = flat[ConvexHull(flat).vertices]
        hull = flat @ np.array([1.0, 1j])
        angles = (np.angle(np.roll(hull, 1) - hull) + np.pi / 4) % (np.pi / 2) - np.pi / 4
        rotated = np.exp(-1j * angles)[:, None] * hull
        order = np.lexsort((np.abs(angles), np.ptp(rotated.real, axis=1) * np.ptp(rotated.imag, axis=1)))
        _, first = np.unique(np.round(angles[order] / _SAME), return_index=True)
        return [self.rotated(angle) for angle in angles[order][np.sort(first)[:count]]]


def light_space(light: Light) -> LightSpace:
    """The light space of a light that has a direction; that of a disc or rectangle is a spot's at its centre."""
    angle = light.frustum_angle
    perspective = angle is not None
    basis = perpendicular_basis(-unit(light.direction), (0.0, 1.0, 0.0))
    origin = np.array(light.position if perspective else (0.0, 0.0, 0.0))
    return LightSpace(basis, origin, perspective, float("inf") if angle is None else float(np.tan(angle / 2)))


@dataclass(frozen=True, eq=False)
class LightView:
    """The part of light space that a map of size² texels covers: a box from near to far along the light's axis."""

    space: LightSpace
    box: Box
    size: int

    @property
    def near(self) -> float:
        """Distance along the axis with depth 0."""
        return float(self.box.low[2])

    @property
    def far(self) -> float:
        """Distance along the axis with depth 1."""
        return float(self.box.high[2])

    @property
    def texel(self) -> tuple[float, float]:
        """Width and height of a texel in local lengths; for a spot at unit distance."""
        width, height = (self.box.high - self.box.low)[:2] / self.size
        return float(width), float(height)

    @property
    def depth_scale(self) -> float:
        """Depth per length: 1/(far − near); for a spot f·n/(f − n), to be divided by the squared distance."""
        span = self.far - self.near
        return self.far * self.near / span if self.space.perspective else 1 / span

    @property
    def planes(self) -> Floats:
        """(5, 4) planes of the map's four sides and its far plane, with n·x + d ≥ 0 inside."""
        x, y, depth, w = self.to_map()
        planes = np.array([x, w - x, y, w - y, w - depth])
        unit_planes: Floats = planes / np.linalg.norm(planes[:, :3], axis=1, keepdims=True)
        return unit_planes

    def _unit_depth(self, reversed_depth: bool) -> Floats:
        """(4, 4) world to x, y in [−1, 1] and depth in [0, 1], before the division by w."""
        (left, bottom, near), (right, top, far) = self.box.low, self.box.high
        matrix = np.zeros((4, 4))
        shift = [-(right + left) / (right - left), -(top + bottom) / (top - bottom)]
        matrix[0, 0], matrix[1, 1] = 2 / (right - left), 2 / (top - bottom)
        if self.space.perspective:
            matrix[:2, 2] = -np.array(shift)
            matrix[2, 2:] = -far / (far - near), -far * near / (far - near)
            matrix[3, 2] = -1
        else:
            matrix[:2, 3] = shift
            matrix[2, 2:] = -1 / (far - near), -near / (far - near)
            matrix[3, 3] = 1
        if reversed_depth:
            matrix[2] = matrix[3] - matrix[2]
        return matrix @ self.space.matrix

    def to_map(self, reversed_depth: bool = False) -> Floats:
        """(4, 4) world to map space: after the division by w, x, y and depth are in [0, 1]."""
        matrix = self._unit_depth(reversed_depth)
        matrix[:2] = (matrix[:2] + matrix[3]) / 2
        return matrix

    def to_clip(self, reversed_depth: bool = False) -> Floats:
        """(4, 4) world to clip space: depth −1 to 1, or with reversed depth 1 to 0 for zero-to-one clip control."""
        matrix = self._unit_depth(reversed_depth)
        if not reversed_depth:
            matrix[2] = 2 * matrix[2] - matrix[3]
        return matrix

    @property
    def to_linear(self) -> Floats:
        """(4,) whose dot product with a position (w = 1) is its linear depth: 0 at near, 1 at far."""
        back, span = self.space.basis[2], self.far - self.near
        return np.array([*(-back / span), (back @ self.space.origin - self.near) / span])

    def linear(self, depths: Floats, reversed_depth: bool = False) -> Floats:
        """Stored depths as linear depths along the axis, 0 at near and 1 at far."""
        depths = 1 - depths if reversed_depth else depths
        if not self.space.perspective:
            return depths
        distance = self.far * self.near / (self.far - depths * (self.far - self.near))
        return (distance - self.near) / (self.far - self.near)


def window(box: Box, space: LightSpace, size: int, padding: float, shift: tuple[float, float]) -> Box:
    """The box that a map of size² texels covers to show `box`: clipped to a spot's cone, padded, shifted by texels."""
    low, high = box.low.copy(), box.high.copy()
    low[:2], high[:2] = np.clip(low[:2], -space.half, space.half), np.clip(high[:2], -space.half, space.half)
    # A box without an extent (one pixel, a plane seen edge-on) still needs texels of some size.
    extent = np.maximum((high - low)[:2], 1e-6 * max(float(np.abs(box.high - box.low).max()), 1e-6))
    middle = (low + high)[:2] / 2
    texel = extent / max(size - 2 * padding, 1.0)
    low[:2], high[:2] = middle - texel * size / 2 + texel * shift, middle + texel * size / 2 + texel * shift
    # Near and far bound the receivers only, as depth clamping keeps casters in front of near. They get a margin for
    # receivers that a bias offsets, and for rounding.
    margin = padding * float(texel.max()) * (high[2] if space.perspective else 1.0) + 1e-4 * (high[2] - low[2])
    low[2], high[2] = low[2] - margin, high[2] + margin
    if space.perspective:
        low[2] = max(low[2], high[2] / 1e4)
    return Box(low, high)


def stretched(box: Box, factor: float) -> Box:
    """The box with its depth range scaled about its middle."""
    middle, half = (box.low[2] + box.high[2]) / 2, (box.high[2] - box.low[2]) / 2 * factor
    return Box(np.array([*box.low[:2], middle - half]), np.array([*box.high[:2], middle + half]))


def snapped(
    space: LightSpace, center: Floats, half: Floats, size: int, padding: float, shift: tuple[float, float]
) -> Box:
    """A box that contains center ± half, padded and shifted by texels, and moves by whole ones only (Valient 2008).

    center: (3,) in world space; half: (3,) in light space, with equal x and y, on which alone the box's size depends. A
    camera that moves or turns gets the same texels.
    """
    texel = 2 * half[0] / max(size - 2 * padding - 1, 1.0)  # one texel of margin for snapping
    low = np.floor((space.box(center[None]).low - half) / texel - padding)
    span = np.array([size, size, np.ceil(2 * half[2] / texel + 2 * padding + 1)])
    moved = low + np.array([*shift, 0.0])
    return Box(moved * texel, (moved + span) * texel)
