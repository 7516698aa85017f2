"""Cascaded shadow maps: one map per slice of the camera's frustum (Engel 2006; Zhang, Sun, Xu and Lun 2006)."""

import math
from functools import cached_property
from typing import Annotated, Literal, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import model_validator

from shadowbench.geometry.convex import SceneHull, Slice, slices
from shadowbench.geometry.lights import Box, LightSpace, LightView, light_space, snapped, stretched, window
from shadowbench.gl.device import Device
from shadowbench.gl.library import moderngl
from shadowbench.gl.program import Sampling, Texture, Value
from shadowbench.gl.targets import DepthFormat, unsupported_map
from shadowbench.maps.biases import Bias, Texel
from shadowbench.maps.filters import Filter, Hardware
from shadowbench.maps.fits import widened
from shadowbench.maps.passes import (
    MAP_GRID,
    MAP_SOFT_GRID,
    CasterMap,
    contents_of,
    counted_reads,
    map_includes,
    map_textures,
    map_uniforms,
    penumbra_uniforms,
    unsupported_components,
)
from shadowbench.maps.presets import BEVY, GODOT, UNITY
from shadowbench.maps.resolve import ResolvePass
from shadowbench.maps.splits import PracticalSplit, Split
from shadowbench.plugin.base import Entry, Frame, Stage, Technique, TechniqueParams, param
from shadowbench.plugin.params import one_of
from shadowbench.scenes.model import View
from shadowbench.scenes.vectors import Floats

_SPHERES = "count=4,box=sphere,stable=true"  # as in all engines


class Cascades(Technique):
    """A depth map for each slice of the camera's frustum, so that texels are small near the camera.

    A receiver is looked up in the first cascade whose box contains it, or in the cascade of its view depth. Worse than
    one map fitted to the visible receivers if all of them are at about the same distance, since empty slices take their
    share of the texels. The change of resolution between two cascades is visible; a blend only softens it. Without
    depth_clamp, casters in front of the map's depth range, which z_mult stretches, cast no shadow, and a bias in units
    of depth grows with the range. With stable, shadows do not shimmer while the camera moves or turns, except on pixels
    that change cascades; they do when its near and far planes or its field of view change. A bias from screen
    derivatives fails where two cascades meet. Casters are drawn once per cascade.
    """

    name = "cascades"
    lights = frozenset({"directional"})
    phased = True
    catalogue = Entry(
        picture_scene="deep-street",
        grid={"count": (2, 3, 5), **MAP_GRID},
        soft_grid=MAP_SOFT_GRID,
        variants=("box=scene", "box=tight", "box=sphere,stable=true"),
    )
    # Engines end their cascades at distances, here shares of the camera's far plane. Godot: light_3d.cpp,
    # PARAM_SHADOW_SPLIT_*_OFFSET of 100 m; four share directional_shadow/size, 4096. Bevy: CascadeShadowConfigBuilder,
    # 10 m to 150 m by equal factors, overlap_proportion 0.2 (of the end, here of the length), DirectionalLightShadowMap
    # 2048. Unity: UniversalRenderPipelineAsset.cs, m_Cascade4Split of 50 m, selected by spheres; four share 2048.
    presets = {
        "godot": f"{_SPHERES},split=shares(0.1,0.2,0.5),select=depth,size=2048,{GODOT}",
        "bevy": f"{_SPHERES},split=shares(0.0667,0.1644,0.4055),select=depth,blend=0.2,size=2048,{BEVY}",
        "unity": f"{_SPHERES},split=shares(0.067,0.2,0.467),size=1024,{UNITY}",
    }

    class Params(TechniqueParams):
        """Parameters of cascades."""

        count: int = param(5, "number of cascades", ge=1, le=8)
        split: Annotated[Split, one_of(Split)] = param(PracticalSplit(), "view depths at which the frustum is split")
        box: Literal["scene", "tight", "sphere"] = param(
            "scene",
            "map bounds: of the slice's part inside the scene's bounds, of the slice, or of its bounding sphere",
        )
        stable: bool = param(False, "moves a map by whole texels only; needs box=sphere")
        depth_clamp: bool = param(True, "clamps casters in front of the near plane to it")
        z_mult: float = param(
            10.0, "without depth_clamp, factor on the map's depth range, about its middle", ge=1, le=1e4
        )
        select: Literal["box", "depth"] = param(
            "box", "the first cascade whose box contains the point, or by view depth"
        )
        blend: float = param(
            0.0, "width of the border that fades into the next cascade, as a share of a cascade", ge=0, le=0.5
        )
        size: int = param(1024, "texels along a side of each map", ge=1, le=65536)
        depth: DepthFormat = param("d32f", "depth format")
        bias: Annotated[Bias, one_of(Bias)] = param(Texel(), "bias against self-shadowing")
        filter: Annotated[Filter, one_of(Filter)] = param(Hardware(), "filter of the depth comparisons")
        layers: Literal["geometry", "passes"] = param(
            "passes", "one draw for all maps by geometry shader, or one per map"
        )
        cull: bool = param(True, "skips casters that cannot shadow any receiver in the map")

        @model_validator(mode="after")
        def _agree(self) -> Self:
            if self.split.slices not in (None, self.count):
                raise ValueError(f"split={self.split.name}: found count={self.count}; allowed: {self.split.slices}")
            if self.stable and self.box != "sphere":
                raise ValueError(f"stable=true: found box={self.box}; allowed: sphere")
            return self

    params: Params

    @classmethod
    def unsupported(cls, params: TechniqueParams, view: View, device: Device) -> str | None:
        assert isinstance(params, cls.Params)
        if view.light.kind != "directional":
            return f"a {view.light.kind} light shines from a place; cascades follow a directional one"
        incompatible = unsupported_components("array", params.bias, params.filter)
        return incompatible or unsupported_map(device, params.size, params.depth, "array", params.count)

    @classmethod
    def view_slices(cls, params: TechniqueParams) -> int:
        assert isinstance(params, cls.Params)
        return params.count

    def build(self, stage: Stage) -> None:
        params = self.params
        self.stage = stage
        self.hull = SceneHull(stage.scene)
        self.defines = {"LAYERS": params.count, "BLENDED": int(params.blend > 0)}
        self.includes = map_includes("orthographic", "array", params.bias, params.filter)
        self.contents = contents_of(stage, params, params.filter, params.size, "array", params.count, self.includes)
        fragment = "contents.frag" if self.contents else "depth.frag"
        if params.layers == "geometry":
            texts: tuple[str, ...] = ("cascades/layers.vert", fragment, "cascades/layers.geom")
        else:
            texts = ("casters.vert", fragment)
        program = stage.program(*texts, params=params, defines=self.defines, includes=self.includes)
        self.map = CasterMap(
            stage,
            program,
            params.size,
            params.depth,
            "array",
            params.count,
            contents=self.contents,
            bias=params.bias,
            clamp=params.depth_clamp,
            cull=params.cull,
        )
        self.resolve = self._pass("resolve")

    def _pass(self, name: str, components: int = 1) -> ResolvePass:
        fragment = f"cascades/{name}.frag"
        return ResolvePass(self.stage, fragment, self.params, self.defines, self.includes, components)

    def draw(self, frame: Frame) -> moderngl.Texture:
        self.last = frame
        self.light_radius = self.params.filter.light_radius(frame.light, self.stage.placement)
        with frame.timed("fit", changes="view"):
            self.slices = self._slices(frame)
            space = light_space(frame.light)
            self.margins: list[Floats] = []
            self.light_views = [self._light_view(space, part, frame) for part in self.slices]
        with frame.timed("depth", changes="view"):
            self.map.draw(frame, self.light_views, layered=self.params.layers == "geometry")
        if self.contents:
            with frame.timed("blur", changes="view"):
                self.contents.prepare([max(view.texel) for view in self.light_views])
        with frame.timed("resolve", changes="view"):
            penumbra = penumbra_uniforms(self.resolve.program, self.light_radius, self.hull, frame.light)
            return self.resolve(frame, self._textures, **self._uniforms(frame), **penumbra)

    @property
    def _textures(self) -> dict[str, tuple[Texture, Sampling]]:
        textures = map_textures(self.map.texture)
        return textures | self.contents.sampler("border") if self.contents else textures

    def _slices(self, frame: Frame) -> list[Slice]:
        params = self.params
        depths = params.split.depths(*frame.view.near_far, params.count)
        # Selected by depth, a cascade must contain the receivers that the previous one blends into it. Selected by box,
        # only a cascade that contains the receiver is blended.
        return slices(frame.camera, depths, params.blend if params.select == "depth" else 0.0)

    def _light_view(self, space: LightSpace, part: Slice, frame: Frame) -> LightView:
        params, padding, shift = self.params, self.params.filter.reach(self.params.size) + 1, frame.phase.shift
        if params.stable:  # the window's size must not depend on the camera's pose
            center, radius = part.sphere
            scene = space.box(self.hull.points)
            reach = self.light_radius * float(scene.high[2] - scene.low[2])
            half = np.array([radius + reach, radius + reach, radius * self._depth_factor])
            placed = snapped(space, center, half, params.size, padding, shift)
            added = np.full(4, reach)
        else:
            box = self._box(space, part)
            wide = widened(box, space, self.hull, frame.light, self.light_radius)
            placed = window(wide, space, params.size, padding, shift)
            added = np.concatenate([(box.low - wide.low)[:2], (wide.high - box.high)[:2]])
        self.margins.append(added / np.tile((placed.high - placed.low)[:2], 2))
        return LightView(space, placed, params.size)

    def _box(self, space: LightSpace, part: Slice) -> Box:
        """The receivers' box of a slice."""
        params = self.params
        if params.box != "sphere":
            hull = self.hull
            points = part.corners if params.box == "tight" else part.corners_within(hull.bounds, hull.extent)
            return stretched(space.box(points), self._depth_factor)
        center, radius = part.sphere
        half = np.array([radius, radius, radius * self._depth_factor])
        middle = space.box(center[None]).low
        return Box(middle - half, middle + half)

    @property
    def _depth_factor(self) -> float:
        # With depth clamping a longer range would only cost depth precision and enlarge biases in units of depth.
        return 1.0 if self.params.depth_clamp else self.params.z_mult

    def _uniforms(self, frame: Frame) -> dict[str, Value]:
        values = map_uniforms(self.light_views) | {
            "filter_radius": self.params.filter.radius(self.params.size),
            "depth_step": self.map.step,
        }
        values["position_step"] = self.hull.position_step(frame.light)
        if self.params.select == "box":
            values["filter_margin"] = self.params.filter.reach(self.params.size)
            values["light_margin"] = np.array(self.margins)
        if self.params.select == "depth":
            forward = -frame.camera.basis()[2]
            values["view_depth"] = (*map(float, forward), -float(forward @ frame.camera.position))
            values["starts"] = np.array([part.near for part in self.slices])
            values["ends"] = np.array([part.far for part in self.slices])
        return values

    @cached_property
    def _tint(self) -> ResolvePass:
        return self._pass("tint", 4)

    def tint(self) -> moderngl.Texture:
        return self._tint(self.last, self._textures, **self._uniforms(self.last))

    @cached_property
    def _texels(self) -> ResolvePass:
        return self._pass("texels", 4)

    def texels(self) -> moderngl.Texture:
        return self._texels(self.last, self._textures, **self._uniforms(self.last))

    def map_image(self) -> NDArray[np.float32]:
        return np.hstack(list(self.map.texture.read()[:, ::-1]))

    def facts(self) -> dict[str, float]:
        scale = self.stage.placement.scale
        facts: dict[str, float] = {"culled_triangles": self.map.culled}
        pixels = math.prod(self.stage.size) * (2 if self.params.blend else 1)  # blended, each reads two cascades
        facts |= counted_reads(self.params.filter, self.contents, pixels)
        if self.params.blend and self.contents is None:
            facts["reads"] = self.params.filter.reads * pixels
        for number, (part, light_view) in enumerate(zip(self.slices, self.light_views, strict=True), start=1):
            facts[f"far_{number}_m"] = part.far / scale
            facts[f"texel_{number}_m"] = max(light_view.texel) / scale
            radius, depth_range = self.params.filter.radius(self.params.size), light_view.far - light_view.near
            bias = self.params.bias.facts(radius, facts[f"texel_{number}_m"], depth_range / scale)
            for name, value in bias.items():
                length, _, unit = name.rpartition("_")
                facts[f"{length}_{number}_{unit}"] = value
        return facts
