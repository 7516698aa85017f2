"""Building blocks of shadow-map techniques: the fitted light view, the depth pass, and the map's uniforms and samplers.

A technique with one 2-D map uses `FittedView`, then `CasterMap`, then a `ResolvePass` with the map's textures and with
`map_uniforms` for `map.glsl`.
"""

from collections.abc import Mapping, Sequence
from typing import Annotated, Literal

import numpy as np

from shadowbench.geometry.convex import SceneHull
from shadowbench.geometry.lights import LightView
from shadowbench.gl.program import Comparison, Program, Ranges, Sampling, State, Texture, Value, Wrap
from shadowbench.gl.targets import DepthFormat, Kind
from shadowbench.maps.biases import Bias, MapKind, NoBias
from shadowbench.maps.contents import MapContents
from shadowbench.maps.culling import CasterChunks
from shadowbench.maps.filters import Filter
from shadowbench.maps.fits import Fit, FitContext, VisibleFit
from shadowbench.maps.reduction import VisibleBounds
from shadowbench.plugin.base import Frame, Stage
from shadowbench.plugin.params import TechniqueParams, one_of, param
from shadowbench.scenes.model import Light
from shadowbench.scenes.vectors import Floats, vec3

# Values that `recommend` tries for every map technique. No biases: all cost the same, and their defaults are tuned.
MAP_GRID = {
    "filter": ("hard", "hardware", "pcf(taps=3)", "pcf(taps=5)"),
    "depth": ("d16", "d32f"),  # the smallest and the most precise format
}
# The filters in place of these where a light has a size.
MAP_SOFT_GRID = {
    "filter": ("hardware", "pcss(search=8,taps=8)", "pcss(search=8,taps=16)", "pcss", "pcss(search=32,taps=64)"),
}
MapInputs = tuple[dict[str, tuple[Texture, Sampling]], dict[str, Value]]
"""Textures and uniforms of a shader that reads a map."""
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

    def __call__(self, frame: Frame, light_radius: float = 0.0) -> LightView:
        """The light view for a frame. light_radius: see `Filter.light_radius`."""
        context = FitContext(
            frame.view, self._stage.placement, self.hull, lambda space: self._bounds(frame, space), light_radius
        )
        return self._fit.light_view(context, self._size, self._padding, frame.phase.shift)


class CasterMap:
    """A square shadow map: casters rendered from the light into a depth texture, and what a filter stores besides.

    program: has `in vec3 position`, and for `draw` `uniform mat4 world_to_clip`; with `contents` its fragment shader is
    `contents.frag`. cull: skip casters that cannot shadow any receiver in the map; clamp: clamp casters in front of the
    near plane to it.

    Attributes: `texture`, the depths; `step`, the spacing of stored depths near 1; `culled`, the number of triangles
    that the last draw skipped.
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
        contents: MapContents | None = None,
        bias: Bias = _NO_BIAS,
        clamp: bool = True,
        reversed_depth: bool = False,
        cull: bool = True,
    ) -> None:
        self.program, self.reversed_depth = program, reversed_depth
        depth_target = stage.depth_target(size, depth, kind, layers)
        self.texture, self.step = depth_target.texture, depth_target.step
        self._all_layers, self._layer_targets = depth_target.target, depth_target.layer_targets
        self._far = (1.0, 1.0, 1.0, 1.0)
        if contents is not None:
            self._far = contents.far
            self._all_layers = stage.target(contents.texture, depth=self.texture)
            self._layer_targets = tuple(
                stage.target(contents.texture, depth=self.texture, layer=layer)
                for layer in range(len(self._layer_targets))
            )
        # Of triangles with the same depth at a texel, the last drawn decides what a filter stores besides.
        self._chunks = chunks = CasterChunks(stage.scene, cull, reorder=contents is None)
        self._casters = (
            stage.drawable(program, {"position": chunks.vertices}, indices=chunks.faces)
            if chunks.reordered
            else stage.casters(program)
        )
        self._bias, self._state = bias, caster_state(bias, clamp, reversed_depth)
        self.culled = 0

    def draw(self, frame: Frame, views: Sequence[LightView], layered: bool = False) -> None:
        """Clear the map and draw the casters into each layer by its light view.

        layered: one draw for all layers, by a program that sets `gl_Layer`.
        """
        matrices = [view.to_clip(self.reversed_depth) for view in views]
        depths = [view.to_linear for view in views]
        regions = [storable_region(view, self._bias) for view in views]
        if layered:
            uniforms = {"world_to_clip": np.stack(matrices), "caster_to_linear": np.stack(depths)}
            self.draw_layers(frame, [(uniforms, regions)])
        else:
            self.draw_layers(
                frame,
                [
                    ({"world_to_clip": matrix, "caster_to_linear": depth}, [region])
                    for matrix, depth, region in zip(matrices, depths, regions, strict=True)
                ],
            )

    def draw_layers(self, frame: Frame, draws: Sequence[tuple[Mapping[str, Value], Sequence[Floats]]]) -> None:
        """Clear the map and draw the casters, once for all layers or once for each.

        draws: for each draw the program's uniforms, and convex regions as (P, 4) planes; casters that cannot shadow
        any point of them are culled.
        """
        targets = self._layer_targets if len(draws) > 1 else (self._all_layers,)
        self.culled = 0
        for target, (uniforms, regions) in zip(targets, draws, strict=True):
            ranges: Ranges | None = self._chunks.index_ranges(frame.light_uniform, *regions)
            self.culled += self._chunks.count_culled(ranges)
            self.program.set(**uniforms)
            # Each layer on its own, just before it is drawn: tiled renderers then clear a tile as they draw it.
            target.clear(*self._far, depth=0.0 if self.reversed_depth else 1.0)
            self._casters.draw(target, state=self._state, ranges=ranges)


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


def map_includes(
    projection: Literal["orthographic", "perspective", "cube"],
    kind: MapKind,
    bias: Bias,
    filter: Filter,
    reversed_depth: bool = False,
    far_rule: str = "lit",
) -> dict[str, str]:
    """The files that `shadow_map.glsl` is composed of, besides the bias and the filter."""
    comparison, contents = "flat", filter.contents
    if bias.on_plane or filter.on_plane:
        comparison = "plane-cube" if kind == "cube" else "plane"
    return {
        "projection": projection,
        "map": kind,
        "depths": "reversed" if reversed_depth else "standard",
        "far_rule": far_rule,
        "radius": filter.radius_shader,
        "comparison": comparison,
        "gradient": "of-receiver" if comparison == "plane" and not bias.on_plane else "of-bias",
        "contents": "depth" if contents is None else "mipmapped" if contents.mips else "stored",
    }


def contents_of(
    stage: Stage,
    params: TechniqueParams,
    filter: Filter,
    size: int,
    kind: Kind = "2d",
    layers: int = 1,
    includes: Mapping[str, str] = {},
) -> MapContents | None:
    """What a filter stores in a map of `size`² texels besides depth; None if nothing."""
    stored = filter.contents
    return None if stored is None else MapContents(stage, params, stored, size, kind, layers, includes)


def counted_reads(filter: Filter, contents: MapContents | None, pixels: int) -> dict[str, float]:
    """The fact `reads` of a filter that reads the map to prepare it; empty for another, whose reads are per pixel."""
    return {} if contents is None else {"reads": filter.reads * pixels + contents.reads}


def penumbra_uniforms(program: Program, light_radius: float, hull: SceneHull, light: Light) -> dict[str, Value]:
    """Uniforms of `penumbra.glsl`, if a program includes it."""
    if not program.has("light_radius"):
        return {}
    # Without a radius all penumbrae have a width of 0, and the search for the nearest caster is of no use.
    if light_radius == 0.0:  # all penumbrae have a width of 0, and the search for the nearest caster is of no use
        return {"light_radius": 0.0, "nearest_caster": 1.0}
    nearest = hull.highest_caster(light) if light.kind == "directional" else hull.nearest_caster(light)
    return {"light_radius": light_radius, "nearest_caster": nearest}


def storable_region(light_view: LightView, bias: Bias) -> Floats:
    """(P, 4) planes of the region whose casters a map may store: its sides and its far plane.

    Without the far plane for a negative polygon offset, which may move casters in front of it.
    """
    return light_view.planes if min(bias.polygon_offset) >= 0 else light_view.planes[:4]


def map_uniforms(light_views: Sequence[LightView], reversed_depth: bool = False) -> dict[str, Value]:
    """Uniforms of `projection/matrix.glsl` for the light views of a map's layers, all of one light."""
    to_map = np.stack([view.to_map(reversed_depth) for view in light_views])
    return {
        "world_to_map": to_map,
        "map_to_world": np.linalg.inv(to_map).astype(np.float64),
        "world_to_linear": np.stack([view.to_linear for view in light_views]),
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
