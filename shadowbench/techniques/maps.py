"""What map techniques are made of: a light view fitted to the frame, casters drawn into a map, and how it is read.

A technique with one 2-D map is `FittedView`, then `CasterMap`, then a `ResolvePass` that is given `map_uniforms` for
`map.glsl` and the map's textures.
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
from shadowbench.techniques.fits import Fit, FitContext, Visible
from shadowbench.techniques.params import TechniqueParams, one_of, param
from shadowbench.techniques.reduction import VisibleBounds

# What `recommend` tries of every map technique; biases cost alike, and their defaults are tuned.
MAP_GRID = {
    "filter": ("hard", "hardware", "pcf(taps=3)", "pcf(taps=5)"),
    "depth": ("d16", "d32f"),  # of which no other has fewer bytes, or more digits
}
_NO_BIAS = NoBias()


class FittedParams(TechniqueParams):
    """Parameters of a technique with one 2-D map that is fitted to the frame."""

    fit: Annotated[Fit, one_of(Fit)] = param(Visible(), "which part of the scene the map shows")
    size: int = param(1024, "texels along a side of the map", ge=1, le=65536)


class FittedView:
    """The light view of one 2-D map, fitted anew each frame; `reach`: texels around a receiver that a lookup reads."""

    def __init__(self, stage: Stage, fit: Fit, size: int, reach: float) -> None:
        self.hull = SceneHull(stage.scene)
        self._stage, self._fit, self._size, self._padding = stage, fit, size, reach + 1
        self._bounds = VisibleBounds(stage)

    def __call__(self, frame: Frame) -> LightView:
        """The view for a frame."""
        context = FitContext(frame.view, self._stage.placement, self.hull, lambda space: self._bounds(frame, space))
        return self._fit.light_view(context, self._size, self._padding, frame.phase.shift)


class CasterMap:
    """Casters drawn from the light into a square map of depths, and of contents if the technique stores any.

    program: with `in vec3 position`, and `uniform mat4 world_to_clip` for `draw`; its fragment shader writes the
    `components` of the contents (2-D maps only), which are 1 where there is no caster. cull: leave out casters that
    can reach no receiver that the map shows; clamp: keep those in front of near, at near.

    `texture` has the depths, `contents` the contents, `step` is the spacing of depths near 1, and `culled` how many
    triangles culling left out of the last draw.
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
        made = stage.depth_target(size, depth, kind, layers)
        self.texture, self.step = made.texture, made.step
        self._whole, self._each = made.target, made.each
        if components:
            self.contents = stage.texture((size, size), components)
            self._whole = stage.target(self.contents, depth=made.texture)
        self._casters = stage.casters(program)
        self._chunks = CasterChunks(stage.scene, cull)
        self._bias, self._state = bias, caster_state(bias, clamp, reversed_depth)
        self.culled = 0

    @property
    def stored(self) -> dict[str, tuple[Texture, Sampling]]:
        """The contents as the sampler `map_stored`: four texels weighted, 1 outside the map."""
        return {"map_stored": (self.contents, Sampling(linear=True, wrap="border", border=1.0))}

    def draw(self, frame: Frame, views: Sequence[LightView], layered: bool = False) -> None:
        """Clear, and draw what each layer's light view sees; `layered` by a program that chooses `gl_Layer` itself."""
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
        """Clear, and draw once into all layers, or once into each.

        draws: uniforms of the program, and the (P, 4) planes of the convex regions whose casters matter.
        """
        targets = self._each if len(draws) > 1 else (self._whole,)
        self._whole.clear(1.0, 1.0, 1.0, 1.0, depth=0.0 if self.reversed_depth else 1.0)
        self.culled = 0
        for target, (uniforms, regions) in zip(targets, draws, strict=True):
            ranges: Ranges | None = self._chunks.index_ranges(frame.light_uniform, *regions)
            self.culled += self._chunks.count_culled(ranges)
            self.program.set(**uniforms)
            self._casters.draw(target, state=self._state, ranges=ranges)


class BoxBlur:
    """Blurs a square texture in place by a box of taps² texels, along rows and then along columns; 1 leaves it."""

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
        """Blur."""
        for target, source, direction in self._passes:
            self._draw.program.set(direction=direction)
            self._draw.draw(target, {"source": (source, Sampling())})


def unsupported_rows(kind: MapKind, bias: Bias, filter: Filter) -> str | None:
    """Why bias or filter does not serve a kind of map, in words; None when both do."""
    names = {"2d": "a 2-D map", "array": "an array of maps", "cube": "a cube map"}
    rows: tuple[Bias | Filter, ...] = (*bias.terms, filter)
    return next((f"{row.name} has no meaning for {names[kind]}" for row in rows if kind not in row.maps), None)


def caster_state(bias: Bias, clamp: bool = True, reversed_depth: bool = False) -> State:
    """How casters are drawn into a map. `clamp` keeps those in front of near, at near."""
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
    """(P, 4) planes of the region whose casters a map may store: its window, and what lies before its far plane.

    A negative polygon offset brings casters from behind the far plane before it.
    """
    return light_view.planes if min(bias.polygon_offset) >= 0 else light_view.planes[:4]


def far_distance(view: LightView) -> float:
    """What `linear_depth.glsl` divides by: w at the far plane."""
    return view.far if view.space.perspective else 1.0


def map_uniforms(light_views: Sequence[LightView], reversed_depth: bool = False) -> dict[str, Value]:
    """What `map.glsl` needs of the light views of its layers, which share one light."""
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
    """The two samplers of a map: its depths, and their comparison. Border depths lie behind every receiver."""
    border = 0.0 if reversed_depth else 1.0
    compare: Comparison = ">=" if reversed_depth else "<="
    return {
        "map_depths": (texture, Sampling(wrap=wrap, border=border)),
        "map_compare": (texture, Sampling(linear=True, wrap=wrap, border=border, compare=compare)),
    }
