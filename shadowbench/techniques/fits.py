"""Fits: which part of the light's space a map shows. One row each; all but `fixed` pad what they find."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from shadowbench.gl.clock import Changes
from shadowbench.scenes.model import Floats, Light, Placement, Scene, View, bounds_of, used_by
from shadowbench.techniques.convex import box_planes, corners, frustum_planes, hull_points, view_planes
from shadowbench.techniques.lights import Box, LightSpace, LightView, light_space
from shadowbench.techniques.params import Row, param

Reduction = Callable[[LightSpace], Box | None]


class CasterHull:
    """What a fit knows of the geometry, computed once: points that bound it in every direction, and its boxes."""

    def __init__(self, scene: Scene) -> None:
        geometry = scene.geometry
        concerned = geometry.casts | geometry.receives  # a sky that does neither must not widen the map
        faces = geometry.faces[concerned] if concerned.any() else geometry.faces
        vertices = used_by(faces, geometry.vertices)
        self.bounds = bounds_of(vertices)
        self.extent = float(np.abs(self.bounds).max())
        self.points = hull_points(vertices)

    def position_step(self, light: Light) -> float:
        """The local length by which float32 rounds places in the scene, as seen from a light."""
        farthest = self.extent if light.kind == "directional" else max(self.extent, *map(abs, light.position))
        return 2.0**-24 * farthest


@dataclass(frozen=True, eq=False)
class Sight:
    """What a fit may look at: the view, the geometry's hull, and the box of the receivers that are seen."""

    view: View
    placement: Placement
    hull: CasterHull
    seen: Reduction


class Fit(Row):
    """Family of fits. `clamps`: casters in front of near are kept, by depth clamp, since near holds receivers alone."""

    clamps: ClassVar[bool] = True

    @property
    def moves_with(self) -> Changes:
        """What makes the map stale: "light", or "view" where the camera does too."""
        return "view"

    def receivers(self, space: LightSpace, sight: Sight) -> Box | None:
        """What the map must show; None for nothing at all."""
        raise NotImplementedError(self.name)

    def light_view(self, sight: Sight, size: int, padding: float, shift: tuple[float, float]) -> LightView:
        """The view of a map of size² texels: the receivers, padded by texels and shifted by parts of one."""
        space = light_space(sight.view.light)
        box = self.receivers(space, sight) or Box(np.zeros(3), np.ones(3))
        return LightView(space, window(box, space, size, padding, shift), size)


class Fixed(Fit):
    """The published constants: an orthographic box looking at the file's origin, or a 45° perspective.

    What lies in front of its near plane is cut off, and casts nothing.
    """

    name = "fixed"
    clamps = False
    half: float = param(10.0, "half the side of the orthographic box", gt=0, metres=True)
    near: float = param(1.0, "near plane", gt=0, metres=True)
    far: float = param(7.5, "far plane", gt=0, metres=True)
    distance: float = param(4.58, "of a directional light from the origin", metres=True)
    fov: float = param(45.0, "degrees of the perspective", gt=0, le=170)

    def light_view(self, sight: Sight, size: int, padding: float, shift: tuple[float, float]) -> LightView:
        metres, space = sight.placement.length, light_space(sight.view.light)
        half = float(np.tan(np.radians(self.fov) / 2)) if space.perspective else metres(self.half)
        if not space.perspective:
            origin = sight.placement.points((0.0, 0.0, 0.0)) + space.basis[2] * metres(self.distance)
            space = replace(space, origin=origin)
        step = np.array([*shift, 0.0]) * (2 * half / size)
        low, high = np.array([-half, -half, metres(self.near)]), np.array([half, half, metres(self.far)])
        return LightView(space, Box(low + step, high + step), size)

    @property
    def moves_with(self) -> Changes:
        return "light"


class SceneFit(Fit):
    """The tight box of all casters and receivers."""

    name = "scene"

    def receivers(self, space: LightSpace, sight: Sight) -> Box | None:
        if not space.perspective:
            return space.box(sight.hull.points)
        return _region(space, sight, [])

    @property
    def moves_with(self) -> Changes:
        return "light"


class ViewFit(Fit):
    """The camera's frustum within the scene's bounds."""

    name = "view"

    def receivers(self, space: LightSpace, sight: Sight) -> Box | None:
        return _region(space, sight, [view_planes(sight.view)])


class Visible(Fit):
    """The receivers that are seen, by a reduction over the G-buffer (Lauritzen, Salvi and Lefohn 2011)."""

    name = "visible"

    def receivers(self, space: LightSpace, sight: Sight) -> Box | None:
        return sight.seen(space)


def _region(space: LightSpace, sight: Sight, more: list[Floats]) -> Box | None:
    """Box of the scene's bounds within further planes, and within the base frustum of a perspective light."""
    planes = [box_planes(sight.hull.bounds), *more]
    if space.perspective:
        reach = 2 * sight.hull.extent + float(np.abs(space.origin).max())
        planes.append(frustum_planes(space.origin, space.basis, space.half, reach * 1e-6, 4 * reach))
    found = corners(np.vstack(planes), sight.hull.extent)
    return space.box(found) if len(found) else None


def window(box: Box, space: LightSpace, size: int, padding: float, shift: tuple[float, float]) -> Box:
    """What a map shows of a box: clipped to a spot's base window, padded by texels, shifted by parts of one."""
    low, high = box.low.copy(), box.high.copy()
    low[:2], high[:2] = np.clip(low[:2], -space.half, space.half), np.clip(high[:2], -space.half, space.half)
    # A window without an extent (one pixel, a plane seen edge-on) still needs texels of some size.
    extent = np.maximum((high - low)[:2], 1e-6 * max(float(np.abs(box.high - box.low).max()), 1e-6))
    middle = (low + high)[:2] / 2
    texel = extent / max(size - 2 * padding, 1.0)
    low[:2], high[:2] = middle - texel * size / 2 + texel * shift, middle + texel * size / 2 + texel * shift
    # Casters in front of near are kept by depth clamping, so near and far need to hold the receivers alone. They get
    # room for receivers that a bias moves, and for rounding.
    room = padding * float(texel.max()) * (high[2] if space.perspective else 1.0) + 1e-4 * (high[2] - low[2])
    low[2], high[2] = low[2] - room, high[2] + room
    if space.perspective:
        low[2] = max(low[2], high[2] / 1e4)
    return Box(low, high)
