"""Slices of a camera's frustum, and the part of a directional light's space that each of them needs."""

from dataclasses import dataclass

import numpy as np

from shadowbench.geometry.convex import box_planes, corners, frustum_planes
from shadowbench.geometry.lights import Box, LightSpace
from shadowbench.scenes.model import Camera, Floats

PRACTICAL_WEIGHT = 0.9
"""λ of the practical split where nothing is said."""


def practical_depths(near: float, far: float, count: int, weight: float = PRACTICAL_WEIGHT) -> Floats:
    """(count + 1,) view depths λ · n (f/n)^(i/m) + (1 − λ) (n + (f − n) i/m) (Zhang, Sun, Xu and Lun 2006).

    weight: λ, 1 for equal ratios of depth, 0 for equal lengths.
    """
    share = np.arange(count + 1) / count
    ratios, lengths = near * (far / near) ** share, near + (far - near) * share
    return weight * ratios + (1 - weight) * lengths


@dataclass(frozen=True, eq=False)
class Slice:
    """A camera's frustum between two view depths; the image is square."""

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
        """(N, 3) corners of what it shares with a (2, 3) box; its own where it shares nothing."""
        slope, eye = float(np.tan(self.camera.fov_y / 2)), np.array(self.camera.position)
        planes = frustum_planes(eye, self.camera.basis(), slope, self.near, self.far)
        shared = corners(np.vstack([box_planes(bounds), planes]), extent)
        return shared if len(shared) else self.corners

    @property
    def sphere(self) -> tuple[Floats, float]:
        """(3,) centre and radius of the smallest sphere around it; the radius does not depend on the camera's pose."""
        slope = 2 * np.tan(self.camera.fov_y / 2) ** 2  # squared, of the frustum's edges
        along = min((self.near + self.far) / 2 * (1 + slope), self.far)
        radius = np.hypot(along - self.far, self.far * np.sqrt(slope))
        return np.array(self.camera.position) - self.camera.basis()[2] * along, float(radius)


def slices(camera: Camera, depths: Floats, overlap: float) -> list[Slice]:
    """The slices between view depths, each begun earlier by a share of the one before."""
    lengths = np.diff(depths)
    starts = depths[:-1] - overlap * np.array([0.0, *lengths[:-1]])
    return [Slice(camera, float(near), float(far)) for near, far in zip(starts, depths[1:], strict=True)]


def stretched(box: Box, factor: float) -> Box:
    """The box with its range along the light times a factor, about its middle."""
    middle, half = (box.low[2] + box.high[2]) / 2, (box.high[2] - box.low[2]) / 2 * factor
    return Box(np.array([*box.low[:2], middle - half]), np.array([*box.high[:2], middle + half]))


def snapped(
    space: LightSpace, center: Floats, half: Floats, size: int, padding: float, shift: tuple[float, float]
) -> Box:
    """A box around `center` ± `half`, padded by texels, that moves by whole texels only (Valient 2008).

    center: (3,) in the world; half: (3,) in light space, x and y alike. Its extent is that of `half` alone, and its
    grid, shifted by parts of a texel, that of the light's space: a camera that moves or turns finds the same texels.
    """
    texel = 2 * half[0] / max(size - 2 * padding - 1, 1.0)  # one texel for what snapping moves
    low = np.floor((space.box(center[None]).low - half) / texel - padding)
    span = np.array([size, size, np.ceil(2 * half[2] / texel + 2 * padding + 1)])
    moved = low + np.array([*shift, 0.0])
    return Box(moved * texel, (moved + span) * texel)
