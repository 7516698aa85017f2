"""Building blocks of shadow-map techniques: the fitted light view, the depth pass, and the map's uniforms and samplers.

A technique with one 2-D map uses `FittedView`, then `CasterMap`, then a `ResolvePass` with the map's textures and with
`map_uniforms` for `map.glsl`.
"""

from collections.abc import Mapping, Sequence
from typing import Annotated

import moderngl
import numpy as np

from shadowbench.geometry.hull import SceneHull
from shadowbench.geometry.lights import LightView
from shadowbench.gl.program import Comparison, Program, Ranges, Sampling, State, Texture, Value, Wrap
from shadowbench.gl.targets import DepthFormat, Kind
from shadowbench.scenes.model import Floats, vec3
from shadowbench.techniques.base import Frame, Stage
from shadowbench.techniques.biases import Bias, MapKind, NoBias
from shadowbench.techniques.culling import CasterChunks
from shadowbench.techniques.filters import Filter
from shadowbench.techniques.fits import Fit, FitContext, VisibleFit
from shadowbench.techniques.params import TechniqueParams, one_of, param
from shadowbench.techniques.reduction import VisibleBounds

# Values that `recommend` tries for every map technique. No biases: all cost the same, and their defaults are tuned.
MAP_GRID = {
    "filter": ("hard", "hardware", "pcf(taps=3)", "pcf(taps=5)"),
    "depth": ("d16", "d32f"),  # the smallest and the most precise format
}
_NO_BIAS = NoBias()


class FittedParams(TechniqueParams):
    """Parameters of a technique with one 2-D map that is fitted each frame."""

    fit: Annotated[Fit, one_of(Fit)] = param(VisibleFit(), "part of the scene that the map covers")
    size: int = param(1024, "texels along a side of the map", ge=1, le=65536)


class FittedView:
    """Fits the light view of one 2-D map to each frame. filter_radius: of a lookup, in texels."""

    def __init__(self, stage: Stage, fit: Fit, size: int, filter_radius: float) -> None:
        self.hull = SceneHull(stage.scene)
        self._stage, self._fit, self._size, self._padding = stage, fit, size, filter_radius + 1
        self._bounds = VisibleBounds(stage)

    def __call__(self, frame: Frame) -> LightView:
        """The light view for a frame."""
        context = FitContext(frame.view, self._stage.placement, self.hull, lambda space: self._bounds(frame, space))
        return self._fit.light_view(context, self._size, self._padding, frame.phase.shift)


class CasterMap:
    """A square shadow map: casters rendered from the light into a depth texture and an optional colour texture.

    program: has `in vec3 position`, and `uniform mat4 world_to_clip` for `draw`; its fragment shader writes the colour
    texture with `components` components (2-D maps only), which is cleared to 1. cull: skip casters that cannot shadow
    any receiver in the map; clamp: clamp casters in front of the near plane to it.

    Attributes: `texture`, the depths; `contents`, the colour texture; `step`, the spacing of stored depths near 1;
    `culled`, the number of triangles that the last draw skipped.
    """

    def __init__(
        self,
        stage: Stage,
        program: Program,
        size: int,
        depth: DepthFormat = "d32f",
        kind: Kind = "2d",
        layers: int = 1,
        *,
        components: int = 0,
        bias: Bias = _NO_BIAS,
        clamp: bool = True,
        reversed_depth: bool = False,
        cull: bool = True,
    ) -> None:
        self.program, self.reversed_depth = program, reversed_depth
        depth_target = stage.depth_target(size, depth, kind, layers)
        self.texture, self.step = depth_target.texture, depth_target.step
        self._all_layers, self._layer_targets = depth_target.target, depth_target.layer_targets
        if components:
            self.contents = stage.texture((size, size), components)
            self._all_layers = stage.target(self.contents, depth=depth_target.texture)
        self._casters = stage.casters(program)
        self._chunks = CasterChunks(stage.scene, cull)
        self._bias, self._state = bias, caster_state(bias, clamp, reversed_depth)
        self.culled = 0

    @property
    def stored(self) -> dict[str, tuple[Texture, Sampling]]:
        """The contents as the sampler `map_stored`: bilinear filtering, 1 outside the map."""
        return {"map_stored": (self.contents, Sampling(linear=True, wrap="border", border=1.0))}

    def draw(self, frame: Frame, views: Sequence[LightView], layered: bool = False) -> None:
        """Clear the map and draw the casters into each layer by its light view.

        layered: one draw for all layers, by a program that sets `gl_Layer`.
        """
        if self.program.has("far_distance"):
            self.program.set(far_distance=far_distance(views[0]))
        matrices = [view.to_clip(self.reversed_depth) for view in views]
        regions = [storable_region(view, self._bias) for view in views]
        if layered:
            self.draw_layers(frame, [({"world_to_clip": np.stack(matrices)}, regions)])
        else:
            pairs = zip(matrices, regions, strict=True)
            self.draw_layers(frame, [({"world_to_clip": matrix}, [region]) for matrix, region in pairs])

    def draw_layers(self, frame: Frame, draws: Sequence[tuple[Mapping[str, Value], Sequence[Floats]]]) -> None:
        """Clear the map and draw the casters, once for all layers or once for each.

        draws: for each draw the program's uniforms, and convex regions as (P, 4) planes; casters that cannot shadow
        any point of them are culled.
        """
        targets = self._layer_targets if len(draws) > 1 else (self._all_layers,)
        self._all_layers.clear(1.0, 1.0, 1.0, 1.0, depth=0.0 if self.reversed_depth else 1.0)
        self.culled = 0
        for target, (uniforms, regions) in zip(targets, draws, strict=True):
            ranges: Ranges | None = self._chunks.index_ranges(frame.light_uniform, *regions)
            self.culled += self._chunks.count_culled(ranges)
            self.program.set(**uniforms)
            self._casters.draw(target, state=self._state, ranges=ranges)


class BoxBlur:
    """A separable box blur of taps² texels of a square texture, in place; 1 tap does nothing."""

    def __init__(self, stage: Stage, texture: moderngl.Texture, taps: int) -> None:
        self._passes = []
        if taps > 1:
            program = stage.program("fullscreen.vert", "blur.frag", defines={"TAPS": taps})
            scratch = stage.texture(texture.size, texture.components)
            self._draw = stage.fullscreen(program)
            self._passes = [
                (stage.target(scratch), texture, (1.0, 0.0)),
                (stage.target(texture), scratch, (0.0, 1.0)),
            ]

    def __call__(self) -> None:
        """Blur the texture."""
        for target, source, direction in self._passes:
            self._draw.program.set(direction=direction)
            self._draw.draw(target, {"source": (source, Sampling())})


def unsupported_components(kind: MapKind, bias: Bias, filter: Filter) -> str | None:
    """Why bias or filter does not support a kind of map; None if both do."""
    names = {"2d": "a 2-D map", "array": "an array of maps", "cube": "a cube map"}
    parts: tuple[Bias | Filter, ...] = (*bias.terms, filter)
    return next((f"{part.name} has no meaning for {names[kind]}" for part in parts if kind not in part.maps), None)


def caster_state(bias: Bias, clamp: bool = True, reversed_depth: bool = False) -> State:
    """Render state of the depth pass. `clamp` clamps casters in front of the near plane to it."""
    factor, units = bias.polygon_offset
    sign = -1 if reversed_depth else 1
    return State(
        depth_test=">=" if reversed_depth else "<=",
        cull=bias.cull,
        polygon_offset=(sign * factor, sign * units),
        depth_clamp=clamp,
        zero_to_one=reversed_depth,
    )


def storable_region(light_view: LightView, bias: Bias) -> Floats:
    """(P, 4) planes of the region whose casters a map may store: its sides and its far plane.

    Without the far plane for a negative polygon offset, which may move casters in front of it.
    """
    return light_view.planes if min(bias.polygon_offset) >= 0 else light_view.planes[:4]


def far_distance(view: LightView) -> float:
    """The uniform `far_distance` of `linear_depth.glsl`: w at the far plane."""
    return view.far if view.space.perspective else 1.0


def map_uniforms(light_views: Sequence[LightView], reversed_depth: bool = False) -> dict[str, Value]:
    """Uniforms of `map.glsl` for the light views of a map's layers, all of one light."""
    to_map = np.stack([view.to_map(reversed_depth) for view in light_views])
    return {
        "world_to_map": to_map,
        "map_to_world": np.linalg.inv(to_map).astype(np.float64),
        "texel_width": np.array([view.texel for view in light_views]),
        "depth_scale": np.array([view.depth_scale for view in light_views]),
        "light_axis": vec3(light_views[0].space.basis[2]),
    }


def map_textures(
    texture: Texture, wrap: Wrap = "border", reversed_depth: bool = False
) -> dict[str, tuple[Texture, Sampling]]:
    """The two samplers of a map: raw depths and hardware comparison. The border is as deep as the far plane."""
    border = 0.0 if reversed_depth else 1.0
    compare: Comparison = ">=" if reversed_depth else "<="
    return {
        "map_depths": (texture, Sampling(wrap=wrap, border=border)),
        "map_compare": (texture, Sampling(linear=True, wrap=wrap, border=border, compare=compare)),
    }
