"""What all map techniques share: the state that casters are drawn with, and what `map.glsl` and `compare.glsl` read."""

from collections.abc import Sequence

import numpy as np

from shadowbench.geometry.lights import LightView
from shadowbench.gl.program import Comparison, Sampling, State, Texture, Value, Wrap
from shadowbench.scenes.model import Floats, vec3
from shadowbench.techniques.biases import Bias, MapKind
from shadowbench.techniques.filters import Filter


def without_meaning(kind: MapKind, bias: Bias, filter: Filter) -> str | None:
    """Why bias or filter does not serve a kind of map, in words; None when both do."""
    names = {"2d": "a 2-D map", "array": "an array of maps", "cube": "a cube map"}
    rows: tuple[Bias | Filter, ...] = (*bias.parts, filter)
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


def shown(seen: LightView, bias: Bias) -> Floats:
    """(P, 4) planes of the region whose casters a map may store: its window, and what lies before its far plane.

    A negative polygon offset brings casters from behind the far plane before it.
    """
    return seen.planes if min(bias.polygon_offset) >= 0 else seen.planes[:4]


def map_uniforms(seen: Sequence[LightView], reversed_depth: bool = False) -> dict[str, Value]:
    """What `map.glsl` needs of the light views of its layers, which share one light."""
    to_map = np.stack([view.to_map(reversed_depth) for view in seen])
    return {
        "world_to_map": to_map,
        "map_to_world": np.linalg.inv(to_map).astype(np.float64),
        "texel_width": np.array([view.texel for view in seen]),
        "depth_scale": np.array([view.depth_scale for view in seen]),
        "light_axis": vec3(seen[0].space.basis[2]),
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
