"""Slices of the camera's frustum for cascades, and light-space boxes of their maps."""

from dataclasses import dataclass

import numpy as np

from shadowbench.geometry.convex import box_planes, corners, frustum_planes
from shadowbench.geometry.lights import Box, LightSpace
from shadowbench.scenes.model import Camera
from shadowbench.scenes.vectors import Floats

PRACTICAL_WEIGHT = 0.9
"""Default λ of the practical split."""


def practical_depths(near: float, far: float, count: int, weight: float = PRACTICAL_WEIGHT) -> Floats:
    """(count + 1,) view depths of the practical split, λ · n (f/n)^(i/m) + (1 − λ) (n + (f − n) i/m).

    weight: λ, 1 for the logarithmic split, 0 for the uniform one (Zhang, Sun, Xu and Lun 2006).
    """
    share = np.arange(count + 1) / count
    ratios, lengths = near * (far / near) ** share, near + (far - near) * share
    return weight * ratios + (1 - weight) * lengths


@dataclass(frozen=True, eq=False)
class Slice:
    """The camera's frustum between two view depths, for a square image."""

    camera: Camera
    near: float
    far: float

    @property
    def corners(self) -> Floats:
        """(8, 3) corners, the near ones first."""
        right, up, back = self.camera.basis()
        slope = np.tan(self.camera.fov_y / 2)
        rays = np.array([x * slope * right + y * slope * up - back for x in (-1, 1) for y in (-1, 1)])
        return np.array(self.camera.position) + np.vstack([self.near * rays, self.far * rays])

    def corners_within(self, bounds: Floats, extent: float) -> Floats:
        """(N, 3) corners of the slice's intersection with a (2, 3) box; its own corners if that is empty."""
        slope, eye = float(np.tan(self.camera.fov_y / 2)), np.array(self.camera.position)
        planes = frustum_planes(eye, self.camera.basis(), slope, self.near, self.far)
        shared = corners(np.vstack([box_planes(bounds), planes]), extent)
        return shared if len(shared) else self.corners

    @property
    def sphere(self) -> tuple[Floats, float]:
        """(3,) centre and radius of the smallest bounding sphere; the radius is independent of the camera's pose."""
        slope = 2 * np.tan(self.camera.fov_y / 2) ** 2  # squared slope of the frustum's edges
        along = min((self.near + self.far) / 2 * (1 + slope), self.far)
        radius = np.hypot(along - self.far, self.far * np.sqrt(slope))
        return np.array(self.camera.position) - self.camera.basis()[2] * along, float(radius)


def slices(camera: Camera, depths: Floats, overlap: float) -> list[Slice]:
    """The slices between view depths, each extended towards the camera by `overlap` of the previous slice's length."""
    lengths = np.diff(depths)
    starts = depths[:-1] - overlap * np.array([0.0, *lengths[:-1]])
    return [Slice(camera, float(near), float(far)) for near, far in zip(starts, depths[1:], strict=True)]


def stretched(box: Box, factor: float) -> Box:
    """The box with its depth range scaled about its middle."""
    middle, half = (box.low[2] + box.high[2]) / 2, (box.high[2] - box.low[2]) / 2 * factor
    return Box(np.array([*box.low[:2], middle - half]), np.array([*box.high[:2], middle + half]))


def snapped(
    space: LightSpace, center: Floats, half: Floats, size: int, padding: float, shift: tuple[float, float]
) -> Box:
    """A box that contains center ± half and moves by whole texels only (Valient 2008).

    center: (3,) in world space; half: (3,) in light space, with equal x and y; padding: texels added on each side;
    shift: offset of the texel grid, in texels. The box's size depends on `half` only, and its texel grid is fixed in
    light space: a camera that moves or turns gets the same texels.
    """
    texel = 2 * half[0] / max(size - 2 * padding - 1, 1.0)  # one texel of margin for snapping
    low = np.floor((space.box(center[None]).low - half) / texel - padding)
    span = np.array([size, size, np.ceil(2 * half[2] / texel + 2 * padding + 1)])
    moved = low + np.array([*shift, 0.0])
    return Box(moved * texel, (moved + span) * texel)
