"""Shadow mapping with one 2-D map (Williams 1978; filtering: Reeves, Salesin and Cook 1987)."""

import math
from functools import cached_property
from typing import Annotated, Literal

import numpy as np
from numpy.typing import NDArray

from shadowbench.gl.device import Device
from shadowbench.gl.library import moderngl
from shadowbench.gl.program import Wrap
from shadowbench.gl.targets import DepthFormat, unsupported_map
from shadowbench.maps.biases import Bias, Texel
from shadowbench.maps.filters import Filter, Hardware
from shadowbench.maps.fits import Fit
from shadowbench.maps.passes import (
    MAP_GRID,
    MAP_SOFT_GRID,
    CasterMap,
    FittedParams,
    FittedView,
    MapInputs,
    contents_of,
    counted_reads,
    map_includes,
    map_textures,
    map_uniforms,
    penumbra_uniforms,
    unsupported_components,
)
from shadowbench.maps.presets import BABYLON, BEVY, FILAMENT, GODOT, THREE, UNITY
from shadowbench.maps.resolve import ResolvePass
from shadowbench.plugin.base import Entry, Frame, Stage, Technique, TechniqueParams, param
from shadowbench.plugin.params import one_of
from shadowbench.scenes.model import View


class ShadowMap(Technique):
    """One depth map from the light, compared with the depth of every visible receiver.

    Orthographic for a directional light, perspective for a spot. Fails where a texel covers more than a pixel
    (stairs), where the bias is too small (acne) or too large (leaks, peter-panning), and outside the map.
    """

    name = "shadow-map"
    lights = frozenset({"directional", "spot"})
    phased = True
    catalogue = Entry(
        grid={"fit": ("visible", "view", "scene"), **MAP_GRID},
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
        """Parameters of shadow-map."""

        depth: DepthFormat = param("d32f", "depth format")
        reversed: bool = param(False, "reversed depth, 1 at near and 0 at far; needs clip control")
        bias: Annotated[Bias, one_of(Bias)] = param(Texel(), "bias against self-shadowing")
        filter: Annotated[Filter, one_of(Filter)] = param(Hardware(), "filter of the depth comparisons")
        wrap: Wrap = param("border", "wrap mode outside the map; border is lit")
        far_rule: Literal["lit", "none"] = param("lit", "receivers beyond the map's far plane: lit, or none: in shadow")
        cull: bool = param(True, "skips casters that cannot shadow any receiver in the map")

    params: Params

    @classmethod
    def unsupported(cls, params: TechniqueParams, view: View, device: Device) -> str | None:
        assert isinstance(params, cls.Params)
        if view.light.kind == "point":
            return "a point light shines all round, one 2-D map sees less than half of it"
        if params.reversed and not device.clip_control:
            return "reversed depth needs clip control (OpenGL 4.5)"
        return unsupported_components("2d", params.bias, params.filter) or unsupported_map(
            device, params.size, params.depth
        )

    def build(self, stage: Stage) -> None:
        self.build_map(stage)
        parallel = {light.kind == "directional" for light in stage.scene.lights}
        self.resolves = {one: self._resolve_pass(one) for one in parallel}

    def _resolve_pass(self, parallel: bool) -> ResolvePass:
        """For light rays that are parallel, or not."""
        includes = self.includes | {"projection": "orthographic"} if parallel else self.includes
        return ResolvePass(self.stage, "shadow-map/resolve.frag", self.params, includes=includes)

    def build_map(self, stage: Stage) -> None:
        """What `draw_map` needs."""
        params = self.params
        self.stage = stage
        self.fitted = FittedView(stage, params.fit, params.size, params.filter.reach(params.size))
        self.includes = map_includes("perspective", "2d", params.bias, params.filter, params.reversed, params.far_rule)
        self.contents = contents_of(stage, params, params.filter, params.size, includes=self.includes)
        fragment = "contents.frag" if self.contents else "depth.frag"
        self.map = CasterMap(
            stage,
            stage.program("casters.vert", fragment, params=params, includes=self.includes),
            params.size,
            params.depth,
            contents=self.contents,
            bias=params.bias,
            clamp=params.fit.clamps,
            reversed_depth=params.reversed,
            cull=params.cull,
        )

    def draw(self, frame: Frame) -> moderngl.Texture:
        textures, uniforms = self.draw_map(frame)
        with frame.timed("resolve", changes="view"):
            parallel = frame.light.kind == "directional"
            if parallel not in self.resolves:  # a light that is not the scene's
                self.resolves[parallel] = self._resolve_pass(parallel)
            resolve = self.resolves[parallel]
            light_radius = self.params.filter.light_radius(frame.light, self.stage.placement)
            penumbra = penumbra_uniforms(resolve.program, light_radius, self.fitted.hull, frame.light)
            self.last = frame, textures, uniforms
            return resolve(frame, textures, **uniforms, **penumbra)

    def draw_map(self, frame: Frame) -> MapInputs:
        """Fit and draw the map; the textures and uniforms of shadow_map.glsl."""
        params, moves = self.params, self.params.fit.invalidated_by
        with frame.timed("fit", changes=moves):
            self.light_view = self.fitted(frame, params.filter.light_radius(frame.light, self.stage.placement))
        with frame.timed("depth", changes=moves):
            self.map.draw(frame, [self.light_view])
        textures = map_textures(self.map.texture, params.wrap, params.reversed)
        if self.contents:
            with frame.timed("blur", changes=moves):
                self.contents.prepare()
            textures |= self.contents.sampler(params.wrap)
        return textures, {
            "filter_radius": params.filter.radius(params.size),
            "depth_step": self.map.step,
            "position_step": self.fitted.hull.position_step(frame.light),
            **map_uniforms([self.light_view], params.reversed),
        }

    @cached_property
    def _texels(self) -> ResolvePass:
        return ResolvePass(self.stage, "shadow-map/texels.frag", self.params, includes=self.includes, components=4)

    def texels(self) -> moderngl.Texture:
        frame, textures, uniforms = self.last
        return self._texels(frame, textures, **uniforms)

    def map_image(self) -> NDArray[np.float32] | None:
        depths = self.map.texture.read()[0, ::-1].astype(np.float64)
        return self.light_view.linear(depths, self.params.reversed).astype(np.float32)

    def facts(self) -> dict[str, float]:
        scale = self.stage.placement.scale
        facts = {
            "texel_m": max(self.light_view.texel) / scale,
            "depth_range_m": (self.light_view.far - self.light_view.near) / scale,
        }
        facts["culled_triangles"] = self.map.culled
        facts |= counted_reads(self.params.filter, self.contents, math.prod(self.stage.size))
        if self.light_view.space.perspective:
            return facts
        radius = self.params.filter.radius(self.params.size)
        return facts | self.params.bias.facts(radius, facts["texel_m"], facts["depth_range_m"])
