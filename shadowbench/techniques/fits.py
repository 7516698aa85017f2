"""Fits: which part of the light's space a map shows. One row each; all but `fixed` pad what they find."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from shadowbench.geometry.convex import box_planes, corners, frustum_planes, view_planes
from shadowbench.geometry.hull import SceneHull
from shadowbench.geometry.lights import Box, LightSpace, LightView, light_space, window
from shadowbench.gl.clock import Changes
from shadowbench.scenes.model import Floats, Placement, View
from shadowbench.techniques.params import Row, param

Reduction = Callable[[LightSpace], Box | None]


@dataclass(frozen=True, eq=False)
class FitContext:
    """The inputs of a fit: the view, the scene's hull, and the bounds of the visible receivers in a light space."""

    view: View
    placement: Placement
    hull: SceneHull
    visible_bounds: Reduction


class Fit(Row):
    """Family of fits. `clamps`: casters in front of near are kept, by depth clamp, since near holds receivers alone."""

    clamps: ClassVar[bool] = True

    @property
    def moves_with(self) -> Changes:
        """What makes the map stale: "light", or "view" where the camera does too."""
        return "view"

    def receiver_bounds(self, space: LightSpace, context: FitContext) -> Box | None:
        """What the map must show; None for nothing at all."""
        raise NotImplementedError(self.name)

    def light_view(self, context: FitContext, size: int, padding: float, shift: tuple[float, float]) -> LightView:
        """The view of a map of size² texels: the receivers, padded by texels and shifted by parts of one."""
        space = light_space(context.view.light)
        box = self.receiver_bounds(space, context) or Box(np.zeros(3), np.ones(3))
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

    def light_view(self, context: FitContext, size: int, padding: float, shift: tuple[float, float]) -> LightView:
        metres, space = context.placement.length, light_space(context.view.light)
        half = float(np.tan(np.radians(self.fov) / 2)) if space.perspective else metres(self.half)
        if not space.perspective:
            origin = context.placement.points((0.0, 0.0, 0.0)) + space.basis[2] * metres(self.distance)
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

    def receiver_bounds(self, space: LightSpace, context: FitContext) -> Box | None:
        if not space.perspective:
            return space.box(context.hull.points)
        return _region(space, context, [])

    @property
    def moves_with(self) -> Changes:
        return "light"


class ViewFit(Fit):
    """The camera's frustum within the scene's bounds."""

    name = "view"

    def receiver_bounds(self, space: LightSpace, context: FitContext) -> Box | None:
        return _region(space, context, [view_planes(context.view)])


class Visible(Fit):
    """The receivers that are seen, by a reduction over the G-buffer (Lauritzen, Salvi and Lefohn 2011)."""

    name = "visible"

    def receiver_bounds(self, space: LightSpace, context: FitContext) -> Box | None:
        return context.visible_bounds(space)


def _region(space: LightSpace, context: FitContext, more: list[Floats]) -> Box | None:
    """Box of the scene's bounds within further planes, and within the base frustum of a perspective light."""
    planes = [box_planes(context.hull.bounds), *more]
    if space.perspective:
        reach = 2 * context.hull.extent + float(np.abs(space.origin).max())
        planes.append(frustum_planes(space.origin, space.basis, space.half, reach * 1e-6, 4 * reach))
    found = corners(np.vstack(planes), context.hull.extent)
    return space.box(found) if len(found) else None
