"""A small shadow map decides where it is certain; only the other pixels are traced (Hertel et al. 2009)."""

from typing import Literal

import moderngl

from shadowbench.gl.device import Device
from shadowbench.gl.program import State
from shadowbench.scenes.model import LightKind, View
from shadowbench.techniques.base import Frame, Stage, Technique, TechniqueParams, param
from shadowbench.techniques.biases import NoBias
from shadowbench.techniques.cube_map import CUBE, CubeMap
from shadowbench.techniques.filters import Filter
from shadowbench.techniques.maps import FittedParams
from shadowbench.techniques.ray_traced import RayTraced
from shadowbench.techniques.shadow_map import ShadowMap
from shadowbench.techniques.tracing import TracePass, ray_offset, too_large

UNSURE = 0.5  # visibility of pixels that the map does not answer


class Conservative(Filter):
    """Visibility where all texels around the receiver agree, elsewhere ½. Not in the table of filters."""

    shader = "hybrid/conservative.glsl"
    maps = frozenset({"2d", "cube"})
    texels: int = 2

    def radius(self, size: int) -> float:
        return self.texels

    @property
    def reads(self) -> int:
        return self.texels**2


class Hybrid(Technique):
    """A small shadow map decides where it is certain, and rays elsewhere: shadows as exact as rays, for less.

    After Hertel, Hormann and Westermann (2009, "A hybrid GPU rendering pipeline for alias-free hard shadows"). A
    receiver is lit if no texel around it stores a depth before its plane, in shadow if all do. The others, along
    shadow edges and on curved surfaces, are traced. Casters thinner than a texel may be missed: `size` and `texels` buy
    them back.
    """

    name = "hybrid"
    picture_scene = "railings"
    exact = True
    builds_on = (ShadowMap, CubeMap, RayTraced)
    grid = {"fit": ("visible", "view"), "size": (512, 1024, 2048), "texels": (1, 2)}

    class Params(FittedParams):
        """Parameters of hybrid."""

        texels: int = param(2, "the map must agree over 2·texels × 2·texels texels", ge=1, le=8)
        rest: Literal["trace", "embree"] = param("trace", "traces the other pixels: in a shader, or on the CPU")
        offset: float = param(1e-6, "height of a ray's origin above its surface, as a share of the scene", ge=0, le=1)

    params: Params

    @classmethod
    def draws_on_cpu(cls, params: TechniqueParams) -> bool:
        assert isinstance(params, cls.Params)
        return params.rest == "embree"

    @classmethod
    def extra_work(cls, params: TechniqueParams) -> str | None:
        return "walks a tree in the shader, which counts of work do not see"

    @classmethod
    def unsupported(cls, params: TechniqueParams, view: View, device: Device) -> str | None:
        assert isinstance(params, cls.Params)
        inner = _map_of(params, view.light.hard_kind)
        return inner.declines(inner.params, view, device) or too_large(view.scene, device)

    def build(self, stage: Stage) -> None:
        if self.params.rest == "embree":
            self.embree = RayTraced(RayTraced.Params(offset=self.params.offset))
            self.embree.build(stage)
            self.visibility = self.embree.visibility
        else:
            self.trace = TracePass(stage, ray_offset(stage.scene, self.params.offset))
            self.visibility = stage.texture()
        self.target = stage.stencil_target(self.visibility).target
        kinds = {light.hard_kind for light in stage.scene.lights}
        self.classifications = {kind: Classification(stage, _map_of(self.params, kind)) for kind in kinds}
        self.stage = stage

    def draw(self, frame: Frame) -> moderngl.Texture:
        kind = frame.light.hard_kind
        if kind not in self.classifications:  # a light that is not the scene's
            self.classifications[kind] = Classification(self.stage, _map_of(self.params, kind))
        self.classifications[kind](frame, self.target)
        if self.params.rest == "embree":
            self.embree.trace_pixels(frame, only=UNSURE)
        else:
            with frame.timed("trace", changes="view"):
                self.trace(frame, self.target, State(depth_test="<", depth_write=False))
        return self.visibility

    def facts(self) -> dict[str, float]:
        return self.embree.facts() if self.params.rest == "embree" else {}


class Classification:
    """Draws a map, and what it says of each pixel."""

    def __init__(self, stage: Stage, map: ShadowMap | CubeMap) -> None:
        self._map = map
        map.build_map(stage)
        shader, defines = ("classify-cube", CUBE) if isinstance(map, CubeMap) else ("classify", {})
        self._program = stage.program("fullscreen.vert", f"hybrid/{shader}.frag", params=map.params, defines=defines)
        self._triangle = stage.fullscreen(self._program)

    def __call__(self, frame: Frame, target: moderngl.Framebuffer) -> None:
        """Draw visibility into a target, ½ where the map is unsure, where the target's depth is then 1, else 0."""
        textures, uniforms = self._map.draw_map(frame)
        with frame.timed("classify", changes="view"):
            target.clear(depth=1.0)
            self._program.set(light=frame.light_uniform, **uniforms)
            self._triangle.draw(target, {**frame.surface.inputs, **textures}, State(depth_test="<="))


def _map_of(params: Hybrid.Params, kind: LightKind) -> ShadowMap | CubeMap:
    """The map that classifies: a point light's is a cube, whose faces have half as many texels along a side."""
    certain = Conservative(texels=params.texels)
    if kind == "point":
        return CubeMap(CubeMap.Params(size=max(params.size // 2, 1), bias=NoBias(), filter=certain))
    return ShadowMap(ShadowMap.Params(fit=params.fit, size=params.size, bias=NoBias(), filter=certain))
