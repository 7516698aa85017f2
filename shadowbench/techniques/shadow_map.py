"""Shadow mapping with one 2-D map (Williams 1978; filtering: Reeves, Salesin and Cook 1987).

Presets of engines are biases and filters that these ship or document for a sun, with the files that they come from.
`normal-offset(scale)` is a multiple of the filter's radius r in texel diagonals: n texels at grazing light are
scale = n/(r √2). Where an engine's map has 16 bits, no steps of that format are added to it, as they would be long.
"""

from typing import Literal

import numpy as np
from numpy.typing import NDArray

from shadowbench.geometry.lights import LightView
from shadowbench.gl.device import Device, moderngl
from shadowbench.gl.program import Wrap
from shadowbench.gl.targets import DepthFormat
from shadowbench.maps.biases import Bias, Texel
from shadowbench.maps.caster_map import (
    MAP_GRID,
    MAP_SOFT_GRID,
    FilteredMap,
    MapInputs,
    MapLayout,
    ResolvePass,
    map_uniforms,
)
from shadowbench.maps.filters import Filter, Hardware
from shadowbench.maps.fits import Fit, FittedParams, FittedView
from shadowbench.maps.updates import Always, LastDraw, Update
from shadowbench.plugin.base import Entry, Frame, Stage, Technique, param
from shadowbench.scenes.model import Light, View
from shadowbench.scenes.vectors import Floats

# mrdoob/three.js. LightShadow.js: bias 0, normalBias 0, radius 1, mapSize 512. WebGLShadowMap.js, shadowSide: the back
# faces of materials that show their front; here of all, as by `three:cast=back`. shadowmap_pars_fragment.glsl.js,
# SHADOWMAP_TYPE_PCF: 5 comparisons on a Vogel disc of that radius, turned by interleaved gradient noise.
THREE = "bias=front-cull,filter=pcf-disc(width=1,taps=5,plane=false)"

# BabylonJS/Babylon.js, its documentation of shadows: usePercentageCloserFiltering and a bias of 0.01, which
# shadowMapVertexMetric.fx adds to clip space, which is 2 deep. shadowsFragmentFunctions.fx, computeShadowWithPCF5: the
# default, QUALITY_HIGH.
BABYLON = "bias=constant(0.005),filter=castano(5)"

# godotengine/godot. light_3d.cpp: PARAM_SHADOW_BIAS 0.1, _NORMAL_BIAS 2 texels, _BLUR 1, _PANCAKE_SIZE 20.
# ProjectSettings, directional_shadow: 16_bits, soft_shadow_filter_quality 2 (SOFT_LOW): 4 taps of a Vogel disc of
# radius 2 texels. light_storage.cpp: bias/100 · blur · that radius · bias_scale metres along the light; bias_scale is
# the depth range in metres with the pancakes' 20 (renderer_scene_cull.cpp). scene_forward_clustered.glsl, BIAS_FUNC:
# the part across the light of an offset that falls by 1 − cos θ. Left out here: farther cascades have smaller discs.
GODOT = (
    "depth=d16,bias=normal-offset(0.4714,ulps=0,falloff=across)+constant(0.002)+constant(world=0.04),"
    "filter=pcf-disc(width=2,taps=4,plane=false)"
)

# bevyengine/bevy. DirectionalLight: DEFAULT_SHADOW_DEPTH_BIAS 0.02 m, DEFAULT_SHADOW_NORMAL_BIAS 1.8, of texel
# diagonals (bevy_pbr/src/render/light.rs), at every angle (shadows.wgsl). shadow_sampling.wgsl,
# SHADOW_FILTER_METHOD_GAUSSIAN: 9 comparisons. SHADOW_FORMAT: Depth32Float.
BEVY = "bias=normal-offset(0.6,falloff=none)+constant(world=0.02),filter=castano(5)"

# google/filament. LightManager.h, ShadowOptions: mapSize 1024, constantBias 0.001 m, normalBias 1,
# polygonOffsetConstant 0.5, polygonOffsetSlope 2. ShadowMapManager.cpp: half a texel for normalBias 1; DEPTH16.
# common_shadowing.fs: it falls by sin θ. surface_shadowing.fs, SHADOW_SAMPLING_PCF_LOW: 4 comparisons. Left out here:
# the warp of a single map (lispsm).
FILAMENT = "depth=d16,bias=polygon-offset(2,0.5)+normal-offset(0.177,ulps=0)+constant(world=0.001),filter=castano(3)"

# Unity-Technologies/Graphics, URP. UniversalRenderPipelineAsset.cs: m_ShadowDepthBias 1, m_ShadowNormalBias 1, in
# texels; soft shadows are off. For those of medium quality ShadowUtils.cs, GetShadowBias, multiplies both by 2.5, and
# Shadows.hlsl takes 9 samples of a tent 5 texels wide, weights 1 3 4.5 3 1. ApplyShadowBias moves the casters, along
# their normals by 1 − cos θ; here the receivers. k_ShadowmapBufferBits: 16. A receiver plane without a gradient is a
# bias in texels.
UNITY = (
    "depth=d16,bias=normal-offset(0.589,ulps=0,falloff=versine)+receiver-plane(limit=1e-9,slack=2.5,ulps=0),"
    "filter=castano(5)"
)

ENGINES = ("babylon", "bevy", "filament", "godot", "three", "unity")
"""The engines whose parameters presets of techniques are named after."""


class ShadowMap(Technique):
    """One depth map from the light, compared with the depth of every visible receiver.

    Orthographic for a directional light, perspective for a spot. Fails where a texel covers more than a pixel
    (stairs), where the bias is too small (acne) or too large (leaks, peter-panning), and outside the map.
    """

    name = "shadow-map"
    lights = frozenset({"directional", "spot"})
    phased = True
    catalogue = Entry(
        grid={
            "fit": (*(f"visible(oriented={turn})" for turn in ("false", "true")), "view(oriented=true)", "scene"),
            **MAP_GRID,
        },
        soft_grid=MAP_SOFT_GRID,
        variants=tuple(f"fit={name}" for name in sorted(Fit.table)),
    )
    presets = {
        "course": "fit=scene,bias=slope,filter=pcf(taps=3)",
        "constant": "fit=scene,bias=constant(0.005),filter=hard",
        "webgl": "fit=scene,bias=constant(0.001),filter=hard,size=512",
        "offset": "fit=scene,bias=polygon-offset(2,4),filter=hardware",
        "dither": "fit=scene,bias=polygon-offset(2,4)+before-divide(0.01),filter=dither-4",
        "fixed": "fit=fixed,bias=slope,filter=pcf(taps=3)",
        # Engines, with one map: those with cascades cover what the camera sees.
        "three": f"fit=scene,size=512,{THREE}",
        "babylon": f"fit=scene,size=1024,{BABYLON}",
        "godot": f"fit=view,size=4096,{GODOT}",
        "bevy": f"fit=view,size=2048,{BEVY}",
        "filament": f"fit=view,size=1024,{FILAMENT}",
        "unity": f"fit=view,size=2048,{UNITY}",
    }

    class Params(FittedParams):
        depth: DepthFormat = param("d32f", "depth format")
        reversed: bool = param(False, "reversed depth, 1 at near and 0 at far; needs clip control")
        bias: Bias = param(Texel(), "bias against self-shadowing")
        filter: Filter = param(Hardware(), "filter of the depth comparisons")
        wrap: Wrap = param("border", "wrap mode outside the map; border is lit")
        far_rule: Literal["lit", "none"] = param("lit", "receivers beyond the map's far plane: lit, or none: in shadow")
        cull: bool = param(True, "skips casters that cannot shadow any receiver in the map")
        update: Update = param(Always(), "when the map is redrawn")

        @property
        def layout(self) -> MapLayout:
            """The layout of the map."""
            return MapLayout(
                self.size,
                self.depth,
                clamp=self.fit.clamps,
                cull=self.cull,
                reversed_depth=self.reversed,
                wrap=self.wrap,
                far_rule=self.far_rule,
                update=self.update,
            )

    params: Params

    @classmethod
    def unsupported(cls, params: Params, view: View, device: Device) -> str | None:
        if view.light.kind == "point":
            return "a point light shines all round, one 2-D map sees less than half of it"
        if params.reversed and not device.clip_control:
            return "reversed depth needs clip control (OpenGL 4.5)"
        return params.layout.unsupported(device, params.bias, params.filter)

    def build(self, stage: Stage) -> None:
        self.build_map(stage)
        self.resolves: dict[bool, ResolvePass] = {}  # for light rays that are parallel, or not
        for light in stage.scene.lights:
            self._resolve_pass(light)

    def _resolve_pass(self, light: Light) -> ResolvePass:
        parallel = light.kind == "directional"
        if parallel not in self.resolves:
            self.resolves[parallel] = self.map.resolve_pass("shadow-map/resolve.frag", PARALLEL=int(parallel))
        return self.resolves[parallel]

    def build_map(self, stage: Stage) -> None:
        """What `draw_map` needs."""
        self.stage, params = stage, self.params
        self.fitted = FittedView(stage, params.fit, params.size, params.filter.reach(params.size))
        self.map = FilteredMap(stage, params, params.layout, self.fitted.hull)
        self.last = LastDraw[LightView](stage, params.update)

    def draw(self, frame: Frame) -> moderngl.Texture:
        inputs = self.draw_map(frame)
        with frame.timed("resolve", changes="view"):
            return self.map.look_up(self._resolve_pass(frame.light), self.last.looked_up(frame), inputs)

    def draw_map(self, frame: Frame) -> MapInputs:
        """Fit and draw the map; the textures and uniforms of shadow_map.glsl."""
        params, moves = self.params, self.params.fit.invalidated_by
        with frame.timed("fit", changes=moves):
            redraws = self.last.redraws(frame, lambda: self._window(frame))
            self.light_view = self.last.window
        with frame.timed("depth", changes=moves):
            if redraws:
                self.map.draw(frame, [self.light_view])
        self.map.prepare(frame, moves, redraws)
        return self.map.inputs(self.last.looked_up(frame).light, map_uniforms([self.light_view], params.reversed))

    def _window(self, frame: Frame) -> tuple[LightView, Floats]:
        view = self.fitted(frame, self.map.light_radius(frame.light))
        return view, view.to_map()

    def confidence(self) -> moderngl.Texture:
        return self.map.confidence()

    def map_image(self) -> NDArray[np.float32] | None:
        depths = self.map.texture.read()[0, ::-1].astype(np.float64)
        return self.light_view.linear(depths, self.params.reversed).astype(np.float32)

    def facts(self) -> dict[str, float]:
        scale, params = self.stage.placement.scale, self.params
        texel, depth_range = max(self.light_view.texel) / scale, (self.light_view.far - self.light_view.near) / scale
        facts = {"texel_m": texel, "depth_range_m": depth_range} | self.map.facts(self.stage.size.pixels)
        if self.light_view.space.perspective:
            return facts
        return facts | params.bias.effect.lengths(params.filter.radius(params.size), texel, depth_range)
