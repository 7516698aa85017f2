"""What maps cover: fits, the part of light space of one map; splits, the view depths between cascades."""

from abc import abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cache
from itertools import chain
from typing import ClassVar, Literal

import numpy as np

from shadowbench.geometry.convex import (
    PRACTICAL_WEIGHT,
    SceneHull,
    box_planes,
    corners,
    frustum_planes,
    practical_depths,
    view_planes,
)
from shadowbench.geometry.lights import Box, LightSpace, LightView, light_space, window
from shadowbench.gl.clock import Changes
from shadowbench.gl.device import moderngl
from shadowbench.gl.program import Program, Sampling, Textures
from shadowbench.gl.targets import Color
from shadowbench.plugin.base import Frame, Stage, TechniqueParams
from shadowbench.plugin.params import Component, param
from shadowbench.scenes.model import Light, Placement, View
from shadowbench.scenes.vectors import Floats


@dataclass(frozen=True, eq=False)
class FitContext:
    """Inputs of a fit: the view, the scene's hull, and a function for the visible receivers' box in each light space.

    The spaces are at most RECTANGLES, rotated about the light's axis. light_radius: of the light by which the filter
    widens; see `Filter.light_radius`.
    """

    view: View
    placement: Placement
    hull: SceneHull
    visible_bounds: Callable[[Sequence[LightSpace]], list[Box]]
    light_radius: float = 0.0


class Fit(Component):
    """Base class of the fits. All but `fixed` pad what they cover by the filter's radius.

    clamps: whether casters in front of the near plane are clamped to it, as near and far bound the receivers only;
    invalidated_by: what invalidates the map, "light" motion, or "view" (camera or light motion).
    """

    clamps: ClassVar[bool] = True
    invalidated_by: ClassVar[Changes] = "view"

    def light_spaces(self, context: FitContext) -> list[LightSpace]:
        """Light spaces, of which the map has the one where the receivers' box has the least area."""
        return [light_space(context.view.light)]

    def receiver_bounds(self, spaces: Sequence[LightSpace], context: FitContext) -> list[Box]:
        """Box of the receivers that the map must cover, in each light space; empty if there are none."""
        raise NotImplementedError(self.name)

    def light_view(self, context: FitContext, size: int, padding: float, shift: tuple[float, float]) -> LightView:
        """The light view of a map of size² texels, fitted to the receivers.

        padding: texels added on each side; shift: offset of the texel grid, in texels.
        """
        spaces = self.light_spaces(context)
        boxes = self.receiver_bounds(spaces, context) or [Box(np.zeros(3), np.ones(3))]
        box, space = min(zip(boxes, spaces, strict=False), key=lambda fitted: fitted[0].area)
        box = widened(box, space, context.hull, context.view.light, context.light_radius)
        return LightView(space, window(box, space, size, padding, shift), size)


class FixedFit(Fit):
    """The published constants: an orthographic box aimed at the file's origin, or a 45° perspective.

    Casters in front of the near plane are clipped, and cast no shadow.
    """

    name = "fixed"
    clamps = False
    invalidated_by = "light"
    half: float = param(10.0, "half the side of the orthographic box", gt=0, metres=True)
    near: float = param(1.0, "near plane", gt=0, metres=True)
    far: float = param(7.5, "far plane", gt=0, metres=True)
    distance: float = param(4.58, "distance of a directional light's box from the origin", metres=True)
    fov: float = param(45.0, "field of view of the perspective, in degrees", gt=0, le=170)

    def light_view(self, context: FitContext, size: int, padding: float, shift: tuple[float, float]) -> LightView:
        metres, space = context.placement.length, light_space(context.view.light)
        half = float(np.tan(np.radians(self.fov) / 2)) if space.perspective else metres(self.half)
        if not space.perspective:
            origin = context.placement.points((0.0, 0.0, 0.0)) + space.basis[2] * metres(self.distance)
            space = replace(space, origin=origin)
        step = np.array([*shift, 0.0]) * (2 * half / size)
        low, high = np.array([-half, -half, metres(self.near)]), np.array([half, half, metres(self.far)])
        return LightView(space, Box(low + step, high + step), size)


class SceneFit(Fit):
    """The bounding box of all casters and receivers."""

    name = "scene"
    invalidated_by = "light"

    def receiver_bounds(self, spaces: Sequence[LightSpace], context: FitContext) -> list[Box]:
        points = _scene(spaces[0], context)
        return [space.box(points) for space in spaces if len(points)]


class ViewFit(Fit):
    """The bounding box of the scene's bounds inside the camera's frustum."""

    name = "view"
    oriented: bool = param(False, "rotates the map about the light's axis, to the rectangle of least area")

    def light_spaces(self, context: FitContext) -> list[LightSpace]:
        (level,) = super().light_spaces(context)
        if not self.oriented:
            return [level]
        outlines = _region(level, context, view_planes(context.view)), _scene(level, context)
        rotated = (level.oriented(points, RECTANGLES // 2) for points in outlines if len(points))
        return [level, *chain.from_iterable(rotated)]

    def receiver_bounds(self, spaces: Sequence[LightSpace], context: FitContext) -> list[Box]:
        points = _region(spaces[0], context, view_planes(context.view))
        return [space.box(points) for space in spaces if len(points)]


class VisibleFit(ViewFit):
    """The bounding box of the visible receivers, reduced from the G-buffer (Lauritzen, Salvi and Lefohn 2011).

    Oriented, it is the least of those with a side of the scene's hull, or of its bounds inside the camera's frustum.
    """

    name = "visible"
    oriented: bool = param(True, "rotates the map about the light's axis, to a rectangle of little area")

    def receiver_bounds(self, spaces: Sequence[LightSpace], context: FitContext) -> list[Box]:
        return context.visible_bounds(spaces)


class FittedParams(TechniqueParams):
    """Parameters of a technique with one 2-D map that is fitted each frame."""

    fit: Fit = param(VisibleFit(), "part of the scene that the map covers")
    size: int = param(1024, "texels along a side of the map", ge=1, le=65536)


class FittedView:
    """Fits the light view of one 2-D map to each frame. filter_radius: of a lookup, in texels."""

    def __init__(self, stage: Stage, fit: Fit, size: int, filter_radius: float) -> None:
        self.hull = SceneHull(stage.scene)
        self._stage, self._fit, self._size, self._padding = stage, fit, size, filter_radius + 1
        self._bounds = cache(lambda oriented: VisibleBounds(stage, oriented))
        if isinstance(fit, VisibleFit):
            self._bounds(fit.oriented)  # built here; for a fit of a plug-in that asks for it, in the first frame

    def __call__(self, frame: Frame, light_radius: float = 0.0) -> LightView:
        """The light view for a frame. light_radius: see `Filter.light_radius`."""

        def visible_bounds(spaces: Sequence[LightSpace]) -> list[Box]:
            return self._bounds(len(spaces) > 1)(frame, spaces)

        context = FitContext(frame.view, self._stage.placement, self.hull, visible_bounds, light_radius)
        return self._fit.light_view(context, self._size, self._padding, frame.phase.shift)


def widened(box: Box, space: LightSpace, hull: SceneHull, light: Light, light_radius: float) -> Box:
    """A box of receivers, and of the casters between them and any point of a light of a radius.

    light_radius: see `Filter.light_radius`.
    """
    if light_radius == 0.0:
        return box
    low, high = box.low.copy(), box.high.copy()
    if space.perspective:
        # In units of the distance; a caster at the distance b is seen from a receiver at d within radius (1/b − 1/d).
        reach = light_radius * (1 / hull.nearest_caster(light) - 1 / high[2])
        low[:2], high[:2] = low[:2] - reach, high[:2] + reach
        return Box(low, high)
    casters = space.box(hull.points)
    reach = light_radius * max(high[2] - casters.low[2], 0.0)
    low[:2] = np.maximum(low[:2] - reach, np.minimum(low, casters.low)[:2])
    high[:2] = np.minimum(high[:2] + reach, np.maximum(high, casters.high)[:2])
    return Box(low, high)


def _scene(space: LightSpace, context: FitContext) -> Floats:
    """(N, 3) hull points of all casters and receivers, for a spot corners of their bounds inside its cone."""
    return _region(space, context) if space.perspective else context.hull.points


def _region(space: LightSpace, context: FitContext, *more: Floats) -> Floats:
    """(N, 3) corners of the scene's bounds inside `more` planes and inside a spot's cone."""
    planes = [box_planes(context.hull.bounds), *more]
    if space.perspective:
        reach = 2 * context.hull.extent + float(np.abs(space.origin).max())
        planes.append(frustum_planes(space.origin, space.basis, space.half, reach * 1e-6, 4 * reach))
    return corners(np.vstack(planes), context.hull.extent)


class Split(Component):
    """Base class of the split schemes. slices: how many a scheme always has; None if any number."""

    slices: ClassVar[int | None] = None

    @abstractmethod
    def depths(self, near: float, far: float, count: int) -> Floats:
        """(count + 1,) non-decreasing view depths in metres from near, which bound the slices."""


class PracticalSplit(Split):
    """The practical split λ · n (f/n)^(i/m) + (1 − λ) (n + (f − n) i/m) (Zhang, Sun, Xu and Lun 2006)."""

    name = "practical"
    weight: float = param(PRACTICAL_WEIGHT, "λ: 1 is the logarithmic split, 0 the uniform one", ge=0, le=1)

    def depths(self, near: float, far: float, count: int) -> Floats:
        return practical_depths(near, far, count, self.weight)


class FixedSplit(Split):
    """Five slices that end at far/50, far/25, far/10, far/2 and far; a slice that ends before near is empty."""

    name = "fixed"
    slices = 5

    def depths(self, near: float, far: float, count: int) -> Floats:
        return np.maximum(near, [near, far / 50, far / 25, far / 10, far / 2, far])


class ShareSplit(Split):
    """Four slices that end at shares of far, as engines set them. One that ends before the slice in front is empty."""

    name = "shares"
    slices = 4
    first: float = param(0.1, "end of the first slice as a share of far", gt=0, le=1)
    second: float = param(0.2, "end of the second slice", gt=0, le=1)
    third: float = param(0.5, "end of the third slice", gt=0, le=1)

    def depths(self, near: float, far: float, count: int) -> Floats:
        ends = np.array([0.0, self.first, self.second, self.third, 1.0]) * far
        return np.maximum.accumulate(np.maximum(near, ends))


class EndSplit(Split):
    """Four slices that end at given view depths. Receivers beyond the last are lit where no map shows them."""

    name = "ends"
    slices = 4
    first: float = param(10.0, "end of the first slice", gt=0, metres=True)
    second: float = param(28.0, "end of the second slice", gt=0, metres=True)
    third: float = param(78.0, "end of the third slice", gt=0, metres=True)
    last: float = param(150.0, "end of the last slice", gt=0, metres=True)

    def depths(self, near: float, far: float, count: int) -> Floats:
        return np.maximum.accumulate(np.maximum(near, [near, self.first, self.second, self.third, self.last]))


RECTANGLES = 3
"""Largest number of rectangles: with the distance along the axis seven directions, in two layers of four."""
_REACHES = 8, 16  # texels along a side that the first step and each further step reduce to one
_ROUNDING = 1e-5  # of the largest coordinate: exceeds float32 rounding of a few operations, and of depths in 24 bits


class MinMaxReduction:
    """Reduces textures of one size in steps of 8×8, then 16×16 texels; built once, called each frame.

    inputs: of the first step, `values` (the sampler `values`) or those of `VisibleBounds`, which reads the result of
    the one before; layers: of four values each.
    """

    def __init__(
        self, stage: Stage, size: tuple[int, int], *inputs: Literal["values", "sample", "receivers"], layers: int = 1
    ) -> None:
        def program(reach: int, **more: int) -> Program:
            defines = {"REACH": reach, "GROUPS": layers, **more}
            return stage.program("fullscreen.vert", "fit/bounds.frag", defines=defines)

        self.firsts = [program(_REACHES[0], **{f"FROM_{name.upper()}": 1}) for name in inputs]
        self._drawables = [stage.fullscreen(first) for first in self.firsts]
        self._later = stage.fullscreen(program(_REACHES[1]))
        self._steps: list[tuple[moderngl.Framebuffer, tuple[Color, Color]]] = []
        while max(size) > 1 or len(self._steps) < 2:  # the first step must not write what it reads
            reach = _REACHES[int(bool(self._steps))]
            size = -(-size[0] // reach), -(-size[1] // reach)
            low, high = (stage.map_texture(size, "array", layers, 4, "f4") for _ in range(2))
            target = stage.target(*[low] * layers, *[high] * layers, layer=[*range(layers)] * 2)
            self._steps.append((target, (low, high)))

    def __call__(self, textures: Textures) -> tuple[Floats, Floats]:
        """(4 · layers,) minima and maxima. The read-back stalls until the device has finished, as in CPU SDSM."""
        result: Textures = {}
        for first in self._drawables:
            drawable, sources = first, {**textures, **result}
            for target, (low, high) in self._steps:
                drawable.draw(target, sources)
                result = {"lows": (low, Sampling()), "highs": (high, Sampling())}
                drawable, sources = self._later, {**result}
        *_, (_, bounds) = self._steps
        lowest, highest = (np.frombuffer(texture.read(), np.float32) for texture in bounds)  # type: ignore[call-arg]
        return lowest.astype(np.float64), highest.astype(np.float64)


class VisibleBounds:
    """Bounding boxes of the visible receivers in light spaces, from the G-buffer.

    oriented: whether there are several, at most RECTANGLES, rotated about the light's axis. The depths of all pixels
    are read, and the positions and normals of one pixel in 64 and of those that may lie outside the former's boxes.
    """

    def __init__(self, stage: Stage, oriented: bool = False) -> None:
        self._layers = (2 * RECTANGLES + 4) // 4 if oriented else 1
        self._bounds = MinMaxReduction(stage, stage.size, "sample", "receivers", layers=self._layers)

    def __call__(self, frame: Frame, spaces: Sequence[LightSpace]) -> list[Box]:
        """A box for each space; empty if no receiver is visible."""
        space = spaces[0]
        rows = np.concatenate([np.eye(3), *(other.basis[:2] @ space.basis.T for other in spaces[1:])])
        directions = np.tile(np.eye(4)[2], (4 * self._layers, 1))
        directions[: len(rows), :3] = rows
        for program in self._bounds.firsts:
            program.set(
                light=frame.light_uniform,
                world_to_light=space.matrix,
                perspective=float(space.perspective),
                cos_half_angle=frame.light.cos_half_angle,
                directions=directions.reshape(-1, 4, 4),
            )
        to_light = _pixel_to_light(frame.view, space)
        reach = np.abs(to_light[:3, 2]) + np.abs(to_light[:3, :2]) @ frame.view.size
        rounding = _ROUNDING * float((reach + np.abs(to_light[:3, 3])).max())
        self._bounds.firsts[-1].set(pixel_to_light=to_light, rounding=rounding, eye=frame.camera.eye)
        low, high = self._bounds(frame.surface.inputs)
        places = [[0, 1, 2], *([at, at + 1, 2] for at in range(3, len(rows), 2))]
        return [Box(low[place], high[place]) for place in places if low[2] <= high[2]]


def _pixel_to_light(view: View, space: LightSpace) -> Floats:
    """(4, 4) from (pixel · spread, depth, 1) to light space, z being the distance along the axis.

    pixel: column and row from the lower left; depth: as a share of the far plane's; spread: the depth, or 1 where rays
    are parallel.
    """
    camera, far = view.camera, view.near_far[1]
    right, up, back = camera.basis()
    (width, height), half = view.size, camera.half_height(far)
    corner = half / height * ((1 - width) * right + (1 - height) * up)  # the centre of the pixel at the lower left
    depth, start = -back * far + camera.converging * corner, camera.position + (1 - camera.converging) * corner
    columns = np.column_stack([*(axis * half * 2 / height for axis in (right, up)), depth, start])
    result: Floats = np.diag([1.0, 1.0, -1.0, 1.0]) @ space.matrix @ np.vstack([columns, [0.0, 0.0, 0.0, 1.0]])
    return result
