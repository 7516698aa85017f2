"""Cascaded shadow maps: one map per slice of the camera's frustum (Engel 2006; Zhang, Sun, Xu and Lun 2006)."""

from typing import Literal, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import model_validator

from shadowbench.geometry.convex import SceneHull, Slice, slices
from shadowbench.geometry.lights import Box, LightSpace, LightView, light_space, snapped, stretched, window
from shadowbench.gl.device import Device, moderngl
from shadowbench.gl.program import Value
from shadowbench.gl.targets import DepthFormat
from shadowbench.maps.biases import Bias, Texel
from shadowbench.maps.caster_map import MAP_GRID, MAP_SOFT_GRID, FilteredMap, MapLayout, map_uniforms
from shadowbench.maps.filters import Filter, Hardware
from shadowbench.maps.fits import PracticalSplit, Split, widened
from shadowbench.maps.updates import Always, LastDraw, Update
from shadowbench.plugin.base import Entry, Frame, Stage, Technique, TechniqueParams, param
from shadowbench.scenes.model import View
from shadowbench.scenes.vectors import Floats
from shadowbench.techniques.shadow_map import BABYLON, BEVY, GODOT, THREE, UNITY

_SPHERES = "box=sphere,stable=true"


class Cascades(Technique):
    """A depth map for each slice of the camera's frustum, so that texels are small near the camera.

    A receiver is looked up in the first cascade whose box contains it, or in the cascade of its view depth. Worse than
    one map fitted to the visible receivers if all of them are at about the same distance, since empty slices take their
    share of the texels. The change of resolution between two cascades is visible; a blend only softens it. Without
    depth_clamp, casters in front of the map's depth range, which z_mult stretches, cast no shadow. With stable, shadows
    do not shimmer while the camera moves or turns, except on pixels that change cascades. Casters are drawn once per
    cascade.
    """

    name = "cascades"
    lights = frozenset({"directional"})
    phased = True
    catalogue = Entry(
        picture_scene="deep-street",
        grid={"count": (2, 3, 5), **MAP_GRID, "bias": ("texel(ulps=6)", "two-planes")},
        soft_grid=MAP_SOFT_GRID,
        steady={"box": "sphere", "stable": True},
        variants=("box=scene", "box=tight", "box=sphere,stable=true"),
    )
    # Engines end their cascades at distances; those of Godot and Unity are here shares of the camera's far plane.
    # Godot: light_3d.cpp, PARAM_SHADOW_SPLIT_*_OFFSET of 100 m; four share directional_shadow/size, 4096. Bevy:
    # CascadeShadowConfigBuilder, overlap_proportion 0.2 (of the end, here of the length), DirectionalLightShadowMap
    # 2048. Unity: UniversalRenderPipelineAsset.cs, m_Cascade4Split of 50 m, selected by spheres; four share 2048.
    # three: examples/jsm/csm/CSM.js, centres rounded to texels. All these have windows of a constant size that move by
    # texels, Babylon only with stabilizeCascades, false in cascadedShadowGenerator.ts. Maps of all of them are level.
    presets = {
        "godot": f"count=4,{_SPHERES},split=shares(0.1,0.2,0.5),select=depth,size=2048,{GODOT}",
        "bevy": f"count=4,{_SPHERES},split=ends(10,28,78,150),select=depth,blend=0.2,size=2048,{BEVY}",
        "unity": f"count=4,{_SPHERES},split=shares(0.067,0.2,0.467),size=1024,{UNITY}",
        "three": f"count=3,{_SPHERES},split=practical(0.5),select=depth,size=2048,{THREE}",
        "babylon": f"count=4,box=tight,oriented=false,split=practical(0.5),select=depth,blend=0.1,{BABYLON}",
    }

    class Params(TechniqueParams):
        count: int = param(5, "number of cascades", ge=1, le=8)
        split: Split = param(PracticalSplit(), "view depths at which the frustum is split")
        box: Literal["scene", "tight", "sphere"] = param(
            "scene",
            "map bounds: of the slice's part inside the scene's bounds, of the slice, or of its bounding sphere",
        )
        oriented: bool = param(
            True, "rotates each map about the light's axis, to the rectangle of least area; not with box=sphere"
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
        bias: Bias = param(Texel(ulps=6), "bias against self-shadowing")  # rotated maps round more
        filter: Filter = param(Hardware(), "filter of the depth comparisons")
        layers: Literal["geometry", "passes"] = param(
            "passes", "one draw for all maps by geometry shader, or one per map"
        )
        cull: bool = param(True, "skips casters that cannot shadow any receiver in the map")
        update: Update = param(Always(), "when the maps are redrawn")

        @model_validator(mode="after")
        def _agree(self) -> Self:
            if self.split.slices not in (None, self.count):
                raise ValueError(f"split={self.split.name}: found count={self.count}; allowed: {self.split.slices}")
            if self.stable and self.box != "sphere":
                raise ValueError(f"stable=true: found box={self.box}; allowed: sphere")
            return self

        @property
        def layout(self) -> MapLayout:
            """The layout of the maps."""
            clamp, cull, update = self.depth_clamp, self.cull, self.update
            return MapLayout(self.size, self.depth, "array", self.count, clamp, cull, update=update)

    params: Params

    @classmethod
    def unsupported(cls, params: Params, view: View, device: Device) -> str | None:
        if view.light.kind != "directional":
            return f"a {view.light.kind} light shines from a place; cascades follow a directional one"
        return params.layout.unsupported(device, params.bias, params.filter)

    @classmethod
    def view_slices(cls, params: Params) -> int:
        return params.count

    def build(self, stage: Stage) -> None:
        params = self.params
        self.stage, self.hull = stage, SceneHull(stage.scene)
        vertex, geometry = "casters.vert", None
        if params.layers == "geometry":
            vertex, geometry = "cascades/layers.vert", "cascades/layers.geom"
        defines = {"LAYERS": params.count, "BLENDED": int(params.blend > 0)}
        self.map = FilteredMap(stage, params, params.layout, self.hull, True, vertex, geometry, defines)
        self.resolve = self.map.resolve_pass("cascades/resolve.frag")
        self.last = LastDraw[list[tuple[Slice, LightView, Floats]]](stage, params.update)

    def draw(self, frame: Frame) -> moderngl.Texture:
        with frame.timed("fit", changes="view"):
            redraws = self.last.redraws(frame, lambda: self._windows(frame))
            self.slices, self.light_views, self.margins = zip(*self.last.window, strict=True)
        with frame.timed("depth", changes="view"):
            if redraws:
                self.map.draw(frame, self.light_views, layered=self.params.layers == "geometry")
        self.map.prepare(frame, "view", redraws, [max(view.texel) for view in self.light_views])
        frame = self.last.looked_up(frame)
        with frame.timed("resolve", changes="view"):
            return self.map.look_up(self.resolve, frame, self.map.inputs(frame.light, self._uniforms(frame)))

    def _windows(self, frame: Frame) -> tuple[list[tuple[Slice, LightView, Floats]], Floats]:
        """Each slice with its light view and the margins in it; the light views' matrices."""
        space = light_space(frame.light)
        windows = [(part, *self._light_view(space, part, frame)) for part in self._slices(frame)]
        return windows, np.stack([view.to_map() for _, view, _ in windows])

    def _slices(self, frame: Frame) -> list[Slice]:
        params, scale = self.params, self.stage.placement.scale
        near, far = frame.view.near_far
        depths = params.split.depths(near / scale, far / scale, params.count) * scale
        # Selected by depth, a cascade must contain the receivers that the previous one blends into it. Selected by box,
        # only a cascade that contains the receiver is blended.
        return slices(frame.view, depths, params.blend if params.select == "depth" else 0.0)

    def _light_view(self, space: LightSpace, part: Slice, frame: Frame) -> tuple[LightView, Floats]:
        params, padding, shift = self.params, self.params.filter.reach(self.params.size) + 1, frame.phase.shift
        light_radius = self.map.light_radius(frame.light)
        # With depth clamping a longer range would only cost depth precision and enlarge biases in units of depth.
        depth_factor = 1.0 if params.depth_clamp else params.z_mult
        center, radius = part.sphere
        if params.stable:  # the window's size must not depend on the camera's pose
            scene = space.box(self.hull.points)
            reach = light_radius * float(scene.high[2] - scene.low[2])
            half = np.array([radius + reach, radius + reach, radius * depth_factor])
            placed = snapped(space, center, half, params.size, padding, shift)
            added = np.full(4, reach)
        else:
            if params.box == "sphere":
                half = np.array([radius, radius, radius * depth_factor])
                middle = space.box(center[None]).low
                box = Box(middle - half, middle + half)
            else:
                bounds, extent = self.hull.bounds, self.hull.extent
                points = part.corners if params.box == "tight" else part.corners_within(bounds, extent)
                if params.oriented:
                    space = space.oriented(points)[0]
                box = stretched(space.box(points), depth_factor)
            wide = widened(box, space, self.hull, frame.light, light_radius)
            placed = window(wide, space, params.size, padding, shift)
            added = np.concatenate([(box.low - wide.low)[:2], (wide.high - box.high)[:2]])
        return LightView(space, placed, params.size), added / np.tile((placed.high - placed.low)[:2], 2)

    def _uniforms(self, frame: Frame) -> dict[str, Value]:
        values = map_uniforms(self.light_views)
        if self.params.select == "box":
            values["filter_margin"] = self.params.filter.reach(self.params.size)
            values["light_margin"] = np.array(self.margins)
        if self.params.select == "depth":
            forward = -frame.camera.basis()[2]
            values["view_depth"] = (*map(float, forward), -float(forward @ frame.camera.position))
            values["starts"] = np.array([part.near for part in self.slices])
            values["ends"] = np.array([part.far for part in self.slices])
        return values

    def tint(self) -> moderngl.Texture:
        return self.map.debug("cascades/tint.frag")

    def confidence(self) -> moderngl.Texture:
        return self.map.confidence()

    def map_image(self) -> NDArray[np.float32]:
        return np.hstack(list(self.map.texture.read()[:, ::-1]))

    def facts(self) -> dict[str, float]:
        params, scale = self.params, self.stage.placement.scale
        pixels = self.stage.size.pixels * (2 if params.blend else 1)  # blended, each reads two cascades
        facts = self.map.facts(pixels)
        for number, (part, light_view) in enumerate(zip(self.slices, self.light_views, strict=True), start=1):
            texel, depth_range = max(light_view.texel) / scale, (light_view.far - light_view.near) / scale
            facts |= {f"far_{number}_m": part.far / scale, f"texel_{number}_m": texel}
            bias = params.bias.effect.lengths(params.filter.radius(params.size), texel, depth_range)
            for name, value in bias.items():
                length, _, unit = name.rpartition("_")
                facts[f"{length}_{number}_{unit}"] = value
        return facts
