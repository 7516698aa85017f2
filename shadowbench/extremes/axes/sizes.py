"""Axes of precision: depth format, map size, view size."""

from shadowbench.extremes.axes.model import MAP_SIZE, VIEW_SIZE, Axis, Setting, base_view
from shadowbench.scenes.model import LightKind

_REVERSED = "d32f-reversed"


def _depth_format(name: str, kind: LightKind) -> Setting:
    if name == _REVERSED:
        return Setting((base_view(kind),), params={"reversed": True, "depth": "d32f"})
    return Setting((base_view(kind),), params={"depth": name})


def _map_size(texels: float, kind: LightKind) -> Setting:
    return Setting((base_view(kind),), params={"size": int(texels)})


def _view_size(pixels: float, kind: LightKind) -> Setting:
    return Setting((base_view(kind, int(pixels)),))


DEPTH_FORMAT = Axis(
    name="depth-format",
    about="depth formats from reversed 32-bit float to 16 bits: precision of the depth comparison",
    unit="",
    values=(_REVERSED, "d32f", "d24", "d16"),
    default="d32f",
    quick=(_REVERSED, "d32f", "d16"),
    lights=("directional", "spot", "point"),
    invariant="the bias suits the precision of each depth format",
    change=_depth_format,
    ordered=False,
)
MAP_TEXELS = Axis(
    name="map-size",
    about="texels along a side of the shadow map: aliasing of a small map, memory of a large one",
    unit="texels",
    values=(16, 32, 64, 128, 256, 512, MAP_SIZE, 2048, 4096, 8192, 16384),
    default=MAP_SIZE,
    quick=(16, 256, MAP_SIZE, 2048),
    lights=("directional", "spot", "point"),
    invariant="a coarse map blurs edges, a fine one is right, and none leaks light",
    change=_map_size,
)
VIEW_PIXELS = Axis(
    name="view-size",
    about="pixels along a side of the picture, over a shadow map of fixed size",
    unit="px",
    values=(16, 32, 64, 128, VIEW_SIZE, 512, 1024, 2048, 4096),
    default=VIEW_SIZE,
    quick=(16, VIEW_SIZE, 512),
    lights=("directional", "point"),
    invariant="the same shadows, sampled finer",
    change=_view_size,
)
