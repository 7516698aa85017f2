"""A small shadow map decides where it is certain; only the other pixels are traced (Hertel et al. 2009)."""

from typing import Self

import numpy as np
from pydantic import model_validator

from shadowbench.geometry.topology import casters_of
from shadowbench.gl.device import Device, moderngl
from shadowbench.gl.program import Sampling, State, Texture, Value
from shadowbench.maps.biases import NoBias
from shadowbench.maps.filters import Contents, Filter
from shadowbench.maps.fits import Fit, FittedParams, ViewFit
from shadowbench.plugin.base import Changes, Entry, Frame, Stage, Technique, param
from shadowbench.scenes.model import LightKind, View
from shadowbench.techniques.cube_map import CubeMap
from shadowbench.techniques.ray_traced import EXTRA_WORK, RayTraced, TracePass, ray_offset, too_large
from shadowbench.techniques.shadow_map import ShadowMap

_CORNERS = 6  # vertices of an edge in silhouette.vert


class Conservative(Filter):
    """Visibility where the map is certain, elsewhere ½. Not in the table of filters."""

    shader = "hybrid/conservative.glsl"
    maps = frozenset({"2d", "cube"})

    @property
    def contents(self) -> Contents:
        return Contents(1, linear=False)

    @property
    def on_plane(self) -> bool:
        return True

    def radius(self, size: int) -> float:
        return 1

    @property
    def reads(self) -> int:
        return 2


class Hybrid(Technique):
    """A small shadow map decides where it is certain, and rays elsewhere: shadows as exact as rays, for less.

    After Hertel, Hormann and Westermann (2009, "A hybrid GPU rendering pipeline for alias-free hard shadows"). The
    silhouette edges that the light sees are drawn into the map too, so that casters thinner than a texel are not
    missed. A receiver is lit or in shadow if the four texels around it agree and have no edge, and no surface close to
    its plane, as at contacts and folds, nor a cut-out in any of these texels that is opaque in one part and clear in
    another. All others, mostly along shadow edges, are traced. Silhouettes are found on the CPU, by compiled code.
    """

    name = "hybrid"
    catalogue = Entry(
        picture_scene="railings",
        exact=True,
        builds_on=(ShadowMap, CubeMap, RayTraced),
        grid={"fit": ("view", "visible"), "size": (512, 1024, 2048)},
    )

    class Params(FittedParams):
        fit: Fit = param(ViewFit(), "part of the scene that the map covers")
        offset: float = param(1e-6, "height of a ray's origin above its surface, as a share of the scene", ge=0, le=1)
        terminator: bool = param(False, "shadows are received on the smooth surface, as with the bias of that name")

        @model_validator(mode="after")
        def _covers_the_scene(self) -> Self:
            if not self.fit.clamps:
                raise ValueError(f"fit={self.fit.name} leaves out casters and receivers, allowed: scene, view, visible")
            return self

    params: Params

    @classmethod
    def draws_on_cpu(cls, params: Params) -> bool:
        return True

    @classmethod
    def lifts(cls, params: Params) -> bool:
        return params.terminator

    @classmethod
    def extra_work(cls, params: Params) -> str | None:
        return EXTRA_WORK

    @classmethod
    def unsupported(cls, params: Params, view: View, device: Device) -> str | None:
        inner = _map_of(params, view.light.hard_kind)
        return inner.declines(inner.params, view, device) or too_large(view.scene, device)

    def build(self, stage: Stage) -> None:
        self.trace = TracePass(stage, ray_offset(stage.scene, self.params.offset))
        self.visibility = stage.texture()
        self.target = stage.stencil_target(self.visibility).target
        self.stage = stage
        self.classifications: dict[LightKind, Classification] = {}
        for light in stage.scene.lights:
            self._classification(light.hard_kind)

    def _classification(self, kind: LightKind) -> "Classification":
        if kind not in self.classifications:
            self.classifications[kind] = Classification(self.stage, _map_of(self.params, kind))
        return self.classifications[kind]

    def draw(self, frame: Frame) -> moderngl.Texture:
        self._classification(frame.light.hard_kind)(frame, self.target)
        with frame.timed("trace", changes="view"):
            self.trace(frame, self.target, State(depth_test="<", depth_write=False))
        return self.visibility

    def facts(self) -> dict[str, float]:
        return {"reads": float(Conservative().reads * self.stage.size.pixels)}


class Classification:
    """Draws a map and the silhouette edges and cut-outs in it, and what they say of each pixel.

    Edges of a cut-out triangle are always among them: of a texel without one, the triangle covers all or nothing.
    """

    def __init__(self, stage: Stage, map: ShadowMap | CubeMap) -> None:
        from shadowbench.geometry.facing import wall_weights  # Numba takes 0.4 s to import

        self._map = map
        map.build_map(stage)
        self._changes: Changes = "light" if isinstance(map, CubeMap) else map.params.fit.invalidated_by
        casters = casters_of(stage.scene)
        self._edges, self._closed = casters.edges, casters.closed_edges
        self._exact, self._weights = stage.scene.geometry.vertices, wall_weights
        self._vertices = self._exact.astype(np.float32)
        kind = map.map.layout.kind
        geometry = stage.scene.geometry
        cut_out = geometry.faces[geometry.casts & geometry.is_cut_out]
        self._edge_program, *interior = (
            stage.program(f"hybrid/{part}.vert", f"hybrid/{part}.frag", params=map.params, includes={"map": kind})
            for part in (("silhouette", "interior") if len(cut_out) else ("silhouette",))
        )
        self._upload = stage.stream(self._edge_program, {"a": 3, "b": 3})
        cut_outs = (stage.casters(program).cut for program in interior)
        self._interiors = [drawable for drawable in cut_outs if drawable is not None]
        pairs = np.sort(np.concatenate([cut_out[:, [0, 1]], cut_out[:, [1, 2]], cut_out[:, [2, 0]]]), axis=1)
        self._edges_of_cutouts = np.unique(pairs, axis=0)
        self._edge_map = stage.depth_target(map.params.size, "d32f", kind)
        self._program = stage.program(
            "fullscreen.vert",
            "hybrid/classify.frag",
            params=map.params,
            defines=map.map.defines,
            includes=map.map.includes,
        )
        self._triangle = stage.fullscreen(self._program)

    def __call__(self, frame: Frame, target: moderngl.Framebuffer) -> None:
        """Draw visibility into a target, ½ where the map is unsure, where the target's depth is then 1, else 0."""
        textures, uniforms = self._map.draw_map(frame)
        with frame.timed("silhouettes", changes=self._changes):
            self._draw_silhouettes(frame, textures["map_contents"])
        with frame.timed("classify", changes="view"):
            target.clear(depth=1.0)
            self._program.set(light=frame.light_uniform, **uniforms)
            if self._program.has("cos_half_angle"):
                self._program.set(cos_half_angle=frame.light.cos_half_angle)
            inputs = {**frame.surface.inputs, **textures, "silhouette": (self._edge_map.texture, Sampling())}
            self._triangle.draw(target, inputs, State(depth_test="<="))

    def _draw_silhouettes(self, frame: Frame, depths: tuple[Texture, Sampling]) -> None:
        """Draw the linear depth of the nearest edge or cut-out in each texel that `depths` do not hide, 1 for none."""
        light = np.array(frame.light_uniform)
        seen = self._edges[self._weights(self._exact, self._edges, light, 0, self._closed) != 0]
        chosen = np.concatenate([seen[:, 1:3], self._edges_of_cutouts])
        ends = np.concatenate([self._vertices[chosen[:, 0]], self._vertices[chosen[:, 1]]], axis=1)
        edges = self._upload(np.repeat(ends, _CORNERS, axis=0))
        self._edge_map.target.clear(depth=1.0)
        targets = self._edge_map.layer_targets or (self._edge_map.target,)
        for target, uniforms in zip(targets, self._layers(frame), strict=True):
            for drawn in (edges, *self._interiors):
                drawn.program.set(**uniforms)
                drawn.draw(target, {"map_contents": depths}, State(depth_test="<=", depth_clamp=True))

    def _layers(self, frame: Frame) -> list[dict[str, Value]]:
        """Uniforms of silhouette.vert and silhouette.frag, for each layer of the map."""
        if isinstance(self._map, ShadowMap):
            view = self._map.light_view
            return [{"world_to_clip": view.to_clip(), "caster_to_linear": view.to_linear}]
        common: dict[str, Value] = {"light_position": frame.light.position, "map_far": self._map.far, "near": 0.0}
        return [common | {"face": face} for face in range(6)]


def _map_of(params: Hybrid.Params, kind: LightKind) -> ShadowMap | CubeMap:
    """The map that classifies: a point light's is a cube, whose faces have half as many texels along a side."""
    if kind == "point":
        return CubeMap(CubeMap.Params(size=max(params.size // 2, 2), bias=NoBias(), filter=Conservative()))
    return ShadowMap(ShadowMap.Params(fit=params.fit, size=params.size, bias=NoBias(), filter=Conservative()))
