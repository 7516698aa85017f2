"""Which parts' shadow volumes are counted in front of the receivers and which behind, and where their walls may end."""

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from shadowbench.geometry.convex import box_planes, corners, view_planes
from shadowbench.geometry.lights import LightSpace, LightView
from shadowbench.maps.culling import box_corners, may_shadow, visible_region
from shadowbench.scenes.geometry import bounds_of
from shadowbench.scenes.model import Light, View
from shadowbench.scenes.vectors import Floats, perpendicular_basis, unit

Count = Literal["z-pass", "z-fail"]

_AT_EYE = 1e-6  # near plane as a share of far, for a frustum that begins at the eye
_MARGIN = 1e-3  # of the extent of eye and visible region: walls end this far outside
_SHALLOWEST = 1e-3  # sine of the least angle of the light's rays with the plane at which walls end


@dataclass(frozen=True, eq=False)
class Batch:
    """Parts that are counted alike.

    behind: with their caps, behind the receivers, or without, in front of them; far_plane: (4,) plane at which the
    walls end, zeros if at infinity; parts: (P,) bool; others: (P,) bool, parts that must not be drawn with them.
    """

    behind: bool
    far_plane: Floats
    parts: NDArray[np.bool_]
    others: NDArray[np.bool_]


def batches_of(view: View, boxes: Floats, count: Count, cull: bool) -> list[Batch]:
    """The parts that may shadow a visible receiver, in batches.

    Counting in front of the receivers needs no caps, and no walls beyond the receivers. It is wrong for a volume that
    the eye is in, or whose cap is between the eye and the near plane: with z-fail, parts that may have such a volume
    are counted behind the receivers. boxes: (P, 2, 3) bounds of the parts; cull: False keeps all parts.
    """
    xyz, w = view.light.homogeneous
    light, far = (*xyz, w), view.near_far[1]
    region = visible_region(replace(view, camera=replace(view.camera, near=_AT_EYE * far)))
    kept = may_shadow(boxes, light, region) if cull else np.ones(len(boxes), dtype=bool)
    behind = kept & may_shadow(boxes, light, _before_near(view)) if count == "z-fail" else np.zeros_like(kept)
    extent = float(np.abs([*view.scene.geometry.bounds, view.camera.position]).max())
    planes = _surrounding(np.vstack([corners(region, extent), view.camera.position]))
    first = _first_passed(planes, boxes, light)
    infinity = np.zeros(4)
    batches = [Batch(True, infinity, behind, ~behind)]
    for i, plane in enumerate([*planes, infinity]):
        parts = kept & ~behind & (first == i)
        batches.append(Batch(False, plane, parts, kept & ~parts))
    return [batch for batch in batches if batch.parts.any()]


def _before_near(view: View) -> Floats:
    """(P, 4) planes of the region between the eye and the near plane, and of its shaft towards the light."""
    near, far = view.near_far
    planes = view_planes(replace(view, camera=replace(view.camera, near=_AT_EYE * far, far=near)))
    points = corners(planes, float(np.abs(view.camera.position).max()) + far)
    return np.vstack([planes, box_planes(bounds_of(points)), _shaft(view.light, points)])


def _shaft(light: Light, points: Floats) -> Floats:
    """(P, 4) planes of a region that has all light rays to the points; P = 0 if it cannot be bounded."""
    xyz, w = light.homogeneous
    toward = np.array(xyz) - w * points.mean(axis=0)
    if w and ((points - xyz) @ toward >= 0).any():
        return np.empty((0, 4))
    basis = perpendicular_basis(unit(toward), (0.0, 1.0, 0.0))
    space = LightSpace(basis, w * np.array(xyz), bool(w), float("inf"))
    return LightView(space, space.box(points), 1).planes


def _surrounding(points: Floats) -> Floats:
    """(6, 4) planes of the bounding box of (N, 3) points, enlarged by a margin."""
    low, high = bounds_of(points)
    margin = _MARGIN * float((high - low).max())
    return box_planes(np.array([low - margin, high + margin]))


def _first_passed(planes: Floats, boxes: Floats, light: tuple[float, ...]) -> NDArray[np.intp]:
    """(P,) index of the plane that is soonest behind all light rays through each box; len(planes) if there is none."""
    points = box_corners(boxes)
    away = light[3] * points - np.array(light[:3])
    length = np.linalg.norm(away, axis=2, keepdims=True)
    approach = -(away @ planes[:, :3].T) / np.maximum(length, np.finfo(float).tiny)
    distance = np.maximum(points @ planes[:, :3].T + planes[:, 3], 0.0)
    with np.errstate(divide="ignore", invalid="ignore"):
        way = np.where(approach > _SHALLOWEST, distance / approach, np.inf).max(axis=1)
    beyond = np.column_stack([way, np.full(len(boxes), np.finfo(float).max)])
    soonest: NDArray[np.intp] = beyond.argmin(axis=1)
    return soonest
