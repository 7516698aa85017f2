"""The map of a shadow-map technique: casters drawn from the light, what a filter stores, and the pass that looks it up.

A technique with one 2-D map uses `FittedView`, then `CasterMap`, then a `ResolvePass` with the map's textures and with
`map_uniforms` for `map.glsl`. A `FilteredMap` is looked up by `shadow_map.glsl`, with a bias and a filter.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal

import numpy as np

from shadowbench.geometry.convex import SceneHull
from shadowbench.geometry.lights import LightView
from shadowbench.gl.clock import Changes
from shadowbench.gl.device import Device, moderngl
from shadowbench.gl.program import Comparison, Drawable, Program, Sampling, State, Texture, Textures, Value, Wrap
from shadowbench.gl.targets import Color, DepthFormat, Kind, unsupported_map
from shadowbench.maps.biases import Bias, NoBias
from shadowbench.maps.culling import CasterChunks
from shadowbench.maps.filters import Contents, Filter, Kernel
from shadowbench.maps.updates import Always, Update
from shadowbench.plugin.base import Frame
from shadowbench.plugin.params import SubjectParams
from shadowbench.plugin.stage import Stage
from shadowbench.scenes.model import Light
from shadowbench.scenes.vectors import Floats, vec3


class ResolvePass:
    """Runs a fragment shader that includes `receiver.glsl` for every pixel; built once, called each frame.

    `texture` is its render target, by default of the image's size; with one component, the visibility.
    """

    def __init__(
        self,
        stage: Stage,
        fragment: Path | str,
        params: SubjectParams | None = None,
        defines: Mapping[str, int | str] = {},
        includes: Mapping[str, str] = {},
        components: int = 1,
        size: tuple[int, int] | None = None,
    ) -> None:
        self.program = stage.program("fullscreen.vert", fragment, params=params, defines=defines, includes=includes)
        self.texture = stage.texture(size, components)
        self._target = stage.target(self.texture)
        self._triangle = stage.fullscreen(self.program)

    def __call__(
        self, frame: Frame, textures: Mapping[str, tuple[Texture, Sampling]] = {}, **uniforms: Value
    ) -> moderngl.Texture:
        """Draw with these textures besides the G-buffer's, and these uniforms besides `light`; returns `texture`."""
        if self.program.has("pixel_right"):
            right, up, back = frame.camera.basis()
            side = frame.view.pixel
            self.program.set(pixel_right=vec3(right * side), pixel_up=vec3(up * side), forward=vec3(-back))
        if self.program.has("eye"):
            self.program.set(eye=frame.camera.eye)
        if self.program.has("view_far"):
            self.program.set(view_far=frame.view.near_far[1], view_position=frame.camera.position)
        self.program.set(light=frame.light_uniform, **uniforms)
        return self.draw({**frame.surface.inputs, **textures})

    def draw(self, textures: Textures) -> moderngl.Texture:
        """Draw with these textures alone; returns `texture`."""
        self._triangle.draw(self._target, textures)
        return self.texture


def kernel_weights(kernel: Kernel, width: float, taps: int) -> Floats:
    """(taps,) weights of the texels of a kernel of a width in texels, at most `taps`; their sum is 1.

    A Gaussian has a standard deviation of a quarter of its width.
    """
    width = min(max(width, 1.0), taps)
    at = np.abs(np.arange(taps) - taps // 2)
    inside = np.clip((width + 1) / 2 - at, 0.0, 1.0)  # a box covers its outermost texels in part
    weights: Floats = inside * np.exp(-8 * (at / width) ** 2) if kernel == "gaussian" else inside
    return weights / float(weights.sum())


# Values that `recommend` tries for every map technique. Of biases the cheapest without acne, and the most accurate.
MAP_GRID = {
    "bias": ("texel", "two-planes"),
    "filter": ("hard", "hardware", "pcf(taps=3)", "pcf(taps=5)"),
    "depth": ("d16", "d32f"),  # the smallest and the most precise format
}
# The filters in place of these where a light has a size.
MAP_SOFT_GRID = {
    "filter": ("hardware", "pcss(search=8,taps=8)", "pcss(search=8,taps=16)", "pcss", "pcss(search=32,taps=64)"),
}
MapInputs = tuple[Textures, dict[str, Value]]
"""Textures and uniforms of a shader that reads a map."""
_NO_BIAS, _ALWAYS = NoBias(), Always()


@dataclass(frozen=True)
class MapLayout:
    """How a map is laid out, drawn and read.

    kind, layers: one square map, an array of `layers`, or the six faces of a cube. clamp: clamps casters in front of
    the near plane to it; cull: skips casters that cannot shadow any receiver in the map; reversed_depth: 1 at near and
    0 at far. wrap: outside the map; far_rule: receivers beyond the far plane are lit, or with none in shadow. update:
    when it is redrawn.
    """

    size: int
    depth: DepthFormat = "d32f"
    kind: Kind = "2d"
    layers: int = 1
    clamp: bool = True
    cull: bool = True
    reversed_depth: bool = False
    wrap: Wrap = "border"
    far_rule: Literal["lit", "none"] = "lit"
    update: Update = _ALWAYS

    def unsupported(self, device: Device, bias: Bias, filter: Filter) -> str | None:
        """Why bias, filter or device does not support such a map; None if all do."""
        names = {"2d": "a 2-D map", "array": "an array of maps", "cube": "a cube map"}
        parts: tuple[Bias | Filter, ...] = (*bias.terms, filter)
        for part in parts:
            if self.kind not in part.maps:
                return f"{part.name} has no meaning for {names[self.kind]}"
        if (own := bias.comparing) and own.gradients and not filter.compares:
            return f"{own.name} compares texels, which {filter.name} does not"
        return unsupported_map(device, self.size, self.depth, self.kind, self.layers)


class MapContents:
    """A filter's contents of a map of one or more layers; its shader's `filter_contents` writes them with the depth.

    texture, sampling: the contents, of the map's kind, and how they are read; far: (4,) contents where no caster is,
    which also surround the map; reads: texels read by the blur, and by the first mip level.
    """

    def __init__(
        self,
        stage: Stage,
        params: SubjectParams,
        contents: Contents,
        layout: MapLayout,
        defines: Mapping[str, int],
        includes: Mapping[str, str],
    ) -> None:
        self._contents, self._layout = contents, layout
        self._taps = contents.blur | 1  # texels that the kernel touches: an odd number
        size, kind, layers = layout.size, layout.kind, layout.layers
        stored = contents.components, contents.dtype
        self.texture = stage.map_texture((size, size), kind, layers, *stored, contents.mips)
        far = ResolvePass(stage, "contents-far.frag", params, defines, includes, contents.components, (1, 1))
        values = np.frombuffer(far.draw({}).read(), dtype=np.float32)
        x, y, z, w = np.pad(values, (0, 4 - contents.components)).tolist()
        self.far = x, y, z, w
        self.sampling = Sampling(linear=contents.linear, wrap=layout.wrap, border=self.far, mips=contents.mips)
        self.reads = layers * size**2 * (2 * self._taps * (contents.blur > 1) + contents.mips)
        self._passes: list[tuple[Drawable, list[moderngl.Framebuffer], Color, Sampling]] = []
        if contents.blur > 1:  # separable, through a scratch texture that has the rows beyond a layer's edges too
            scratch = stage.map_texture((size, size + self._taps - 1), "array", layers, *stored)
            around = Sampling(linear=True) if kind == "cube" else Sampling(wrap="border", border=self.far)
            for along, source, target, sampling in (
                ("rows", self.texture, scratch, around),
                ("columns", scratch, self.texture, Sampling()),
            ):
                defines, includes = {"TAPS": self._taps, "SIZE": size}, {"blur": along, "map": kind}
                program = stage.program("fullscreen.vert", "blur.frag", defines=defines, includes=includes)
                targets = [stage.target(target, layer=layer) for layer in range(layers)]
                self._passes.append((stage.fullscreen(program), targets, source, sampling))

    def prepare(self, texels: Sequence[float] = ()) -> None:
        """Blur the layers and compute their mip levels.

        texels: width of each layer's texels, if they differ; the blur has the width in the scene that it has in the
        layer of the finest ones.
        """
        shares = min(texels) / np.array(texels) if texels else np.ones(self._layout.layers)
        blur, kernel = self._contents.blur, self._contents.kernel
        weights = [kernel_weights(kernel, share * blur, self._taps) for share in shares]
        # Rows of all layers before the columns of any, as a cube's faces read their neighbours.
        for drawable, targets, source, sampling in self._passes:
            for layer, target in enumerate(targets):
                drawable.program.set(weights=weights[layer], layer=layer)
                drawable.draw(target, {"source": (source, sampling)})
        if self._contents.mips:
            self.texture.build_mipmaps()


class CasterMap:
    """A shadow map: casters rendered from the light into a depth texture, and what a filter stores besides.

    program: has `in vec3 position`, and for `draw` `uniform mat4 world_to_clip`; with `contents` its fragment shader is
    `contents.frag`.

    Attributes: `texture`, the depths; `textures`, the samplers of map.glsl; `step`, the spacing of stored depths near
    1; `culled`, the number of triangles that the last draw skipped.
    """

    def __init__(
        self,
        stage: Stage,
        program: Program,
        layout: MapLayout,
        bias: Bias = _NO_BIAS,
        contents: MapContents | None = None,
        gradients: Color | None = None,
    ) -> None:
        self.program, self.layout, self.contents, self.gradients = program, layout, contents, gradients
        of = layout.size, layout.depth, layout.kind, layout.layers
        depth_target = layout.update.kept(stage, "map", lambda: stage.depth_target(*of))
        self.texture, self.step = depth_target.texture, depth_target.step
        self._all_layers, self._layer_targets = depth_target.target, depth_target.layer_targets
        self._far = (1.0, 1.0, 1.0, 1.0)
        if contents is not None:
            self._far = contents.far
        if stored := [*([contents.texture] if contents else []), *([gradients] if gradients else [])]:
            self._all_layers = stage.target(*stored, depth=self.texture)
            self._layer_targets = tuple(
                stage.target(*stored, depth=self.texture, layer=layer) for layer in range(len(self._layer_targets))
            )
        # Of triangles with the same depth at a texel, the last drawn decides what a filter stores besides.
        self._chunks = chunks = CasterChunks(stage.scene, layout.cull, contents is None, program.cut is not None)
        self._casters = stage.casters(program)
        if chunks.reordered:
            ordered = stage.drawable(program, {"position": chunks.vertices}, indices=chunks.faces)
            self._casters = replace(ordered, count=chunks.faces.size, cut=self._casters.cut)
        effect, reversed_depth = bias.effect, layout.reversed_depth
        sign = -1 if reversed_depth else 1
        self._state = State(
            depth_test=">=" if reversed_depth else "<=",
            cull=effect.cull,
            polygon_offset=(sign * effect.factor, sign * effect.units),
            depth_clamp=layout.clamp,
            zero_to_one=reversed_depth,
        )
        # A negative polygon offset may move casters beyond the far plane in front of it.
        self._sides = 5 if min(effect.factor, effect.units) >= 0 else 4
        self.culled = 0

    @property
    def textures(self) -> Textures:
        border = 0.0 if self.layout.reversed_depth else 1.0
        compare: Comparison = ">=" if self.layout.reversed_depth else "<="
        wrap = self.layout.wrap
        samplers: dict[str, tuple[Texture, Sampling]] = {
            "map_depths": (self.texture, Sampling(wrap=wrap, border=border)),
            "map_compare": (self.texture, Sampling(linear=True, wrap=wrap, border=border, compare=compare)),
        }
        if self.contents is not None:
            samplers["map_contents"] = self.contents.texture, self.contents.sampling
        if self.gradients is not None:
            samplers["map_gradients"] = self.gradients, Sampling(wrap="repeat" if wrap == "repeat" else "edge")
        return samplers

    def draw(self, frame: Frame, views: Sequence[LightView], layered: bool = False) -> None:
        """Clear the map and draw the casters into each layer by its light view.

        layered: one draw for all layers, by a program that sets `gl_Layer`.
        """
        matrices = [view.to_clip(self.layout.reversed_depth) for view in views]
        depths = [view.to_linear for view in views]
        regions = [view.planes[: self._sides] for view in views]
        draws: list[tuple[dict[str, Value], list[Floats]]] = [
            ({"world_to_clip": matrix, "caster_to_linear": depth}, [region])
            for matrix, depth, region in zip(matrices, depths, regions, strict=True)
        ]
        if layered:
            draws = [({"world_to_clip": np.stack(matrices), "caster_to_linear": np.stack(depths)}, regions)]
        self.draw_layers(frame, draws)

    def draw_layers(self, frame: Frame, draws: Sequence[tuple[Mapping[str, Value], Sequence[Floats]]]) -> None:
        """Clear the map and draw the casters, once for all layers or once for each.

        draws: for each draw the program's uniforms, and convex regions as (P, 4) planes; casters that cannot shadow
        any point of them are culled.
        """
        targets = self._layer_targets if len(draws) > 1 else (self._all_layers,)
        self.culled = 0
        for target, (uniforms, regions) in zip(targets, draws, strict=True):
            ranges = self._chunks.index_ranges(frame.light_uniform, *regions)
            self.culled += self._chunks.count_culled(ranges)
            self.program.set(**uniforms)
            # Each layer on its own, just before it is drawn: tiled renderers then clear a tile as they draw it.
            target.clear(*self._far, depth=0.0 if self.layout.reversed_depth else 1.0)
            self._casters.draw(target, state=self._state, ranges=ranges)


class FilteredMap(CasterMap):
    """A map that `shadow_map.glsl` looks up with the bias and the filter of a technique's parameters.

    params: with size, bias and filter; parallel: whether all light rays are, known to the compiler; vertex, geometry:
    shaders of the casters; more: defines of all shaders. `defines` and `includes` are what `shadow_map.glsl` is
    composed of, besides the bias and the filter; `last` are the frame, textures and uniforms of the last lookup.
    """

    def __init__(
        self,
        stage: Stage,
        params: Any,
        layout: MapLayout,
        hull: SceneHull,
        parallel: bool = False,
        vertex: str = "casters.vert",
        geometry: str | None = None,
        more: Mapping[str, int] = {},
    ) -> None:
        self._stage, self._params, self.hull = stage, params, hull
        self.bias: Bias = params.bias
        self.filter: Filter = params.filter
        stored, contents, kept = self.filter.contents, None, layout.update.kept
        cube, own = layout.kind == "cube", self.bias.comparing
        self.stores_gradients = own is not None and own.gradients
        self.defines = {
            "LAYERS": layout.layers,
            "ARRAY": int(layout.kind == "array"),
            "PARALLEL": int(parallel),
            "REVERSED": int(layout.reversed_depth),
            "LIT_BEYOND": int(layout.far_rule == "lit"),
            "CUBE": int(cube),
            "CONTENTS": int(stored is not None),
            "GRADIENTS": int(self.stores_gradients),
            "GRADIENT_OF_RECEIVER": int(self.filter.on_plane and own is None),
            "MIPMAPPED": int(stored is not None and stored.mips),
            **more,
        }
        comparison = own.comparison if own else f"comparison/{'plane' if self.filter.on_plane else 'depth'}.glsl"
        self.includes = {"projection": "cube" if cube else "matrix", "map": layout.kind, "comparison": comparison}
        if stored is not None:
            composed = params, stored, layout, self.defines, self.includes
            contents = kept(stage, "contents", lambda: MapContents(stage, *composed))
        folder = "cube-map/" if cube else ""
        fragment = f"{folder}depth.frag" if contents is None else f"{folder}contents.frag"
        program = stage.program(vertex, fragment, geometry, params=params, defines=self.defines, includes=self.includes)
        slopes, side = None, (layout.size, layout.size)
        if self.stores_gradients:
            slopes = kept(stage, "slopes", lambda: stage.map_texture(side, layout.kind, layout.layers, 1, "u4"))
        super().__init__(stage, program, layout, self.bias, contents, slopes)
        self._prepared, self._confidence = False, None
        if params.history.of_texels:
            folder = "cascades" if layout.kind == "array" else "shadow-map"
            self._confidence = self.resolve_pass(f"{folder}/confidence.frag")

    def resolve_pass(self, fragment: str, components: int = 1, **defines: int) -> ResolvePass:
        """A pass over the pixels by a shader that includes `shadow_map.glsl`. defines: in place of the map's."""
        return ResolvePass(self._stage, fragment, self._params, self.defines | defines, self.includes, components)

    def light_radius(self, light: Light) -> float:
        """Of the light by which the filter widens; see `Filter.light_radius`."""
        return self.filter.light_radius(light, self._stage.placement)

    def prepare(self, frame: Frame, changes: Changes, redrawn: bool, texels: Sequence[float] = ()) -> None:
        """Blur what the filter stores in a map that was redrawn, if it does. texels: see `MapContents.prepare`."""
        self._prepared = redrawn
        if self.contents and redrawn:
            with frame.timed("blur", changes=changes):
                self.contents.prepare(texels)

    def inputs(self, light: Light, uniforms: Mapping[str, Value]) -> MapInputs:
        """Textures and uniforms of `shadow_map.glsl`. uniforms: of its projection."""
        return self.textures, {
            "filter_radius": self.filter.radius(self.layout.size),
            "depth_step": self.step,
            "position_step": self.hull.position_step(light),
            **uniforms,
        }

    def look_up(self, resolve: ResolvePass, frame: Frame, inputs: MapInputs) -> moderngl.Texture:
        """The visibility that a resolve pass finds."""
        textures, uniforms = inputs
        self.last = frame, textures, uniforms
        if resolve.program.has("light_radius"):  # of `penumbra.glsl`
            radius, nearest = self.light_radius(frame.light), 1.0
            if radius > 0.0:  # else all penumbrae have a width of 0
                sun = frame.light.kind == "directional"
                nearest = self.hull.highest_caster(frame.light) if sun else self.hull.nearest_caster(frame.light)
            uniforms = {**uniforms, "light_radius": radius, "nearest_caster": nearest}
        return resolve(frame, textures, **uniforms)

    def confidence(self) -> moderngl.Texture:
        """As of `Technique.confidence`, of the last lookup."""
        assert self._confidence is not None
        frame, textures, uniforms = self.last
        with frame.timed("confidence", changes="view"):
            return self._confidence(frame, textures, **uniforms)

    def debug(self, fragment: str) -> moderngl.Texture:
        """Four components of each pixel by another shader, with the inputs of the last lookup."""
        frame, textures, uniforms = self.last
        return self.resolve_pass(fragment, components=4)(frame, textures, **uniforms)

    def facts(self, pixels: int) -> dict[str, float]:
        """Culled triangles, and texture reads: the filter's of each pixel, and those that prepare what it stores."""
        prepared = self.contents.reads if self.contents and self._prepared else 0
        reads = self.filter.reads * (1 + self.stores_gradients)  # of a texel's depth, and of its gradient
        return {"culled_triangles": self.culled, "reads": reads * pixels + prepared}


def map_uniforms(light_views: Sequence[LightView], reversed_depth: bool = False) -> dict[str, Value]:
    """Uniforms of `map/matrix.glsl` for the light views of a map's layers, all of one light."""
    to_map = np.stack([view.to_map(reversed_depth) for view in light_views])
    return {
        "world_to_map": to_map,
        "map_to_world": np.linalg.inv(to_map).astype(np.float64),
        "world_to_linear": np.stack([view.to_linear for view in light_views]),
        "texel_width": np.array([view.texel for view in light_views]),
        "depth_scale": np.array([view.depth_scale for view in light_views]),
        "light_axis": vec3(light_views[0].space.basis[2]),
    }
