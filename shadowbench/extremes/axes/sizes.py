"""Axes of precision: format of the map's depths, texels of the map, pixels of the view."""

from shadowbench.extremes.axes.model import MAP_SIZE, VIEW_SIZE, Axis, Setting, base
from shadowbench.scenes.model import LightKind

_REVERSED = "d32f-reversed"


def _depth_format(name: str, kind: LightKind) -> Setting:
    if name == _REVERSED:
        return Setting((base(kind),), params={"reversed": True, "depth": "d32f"})
    return Setting((base(kind),), params={"depth": name})


def _map_size(texels: float, kind: LightKind) -> Setting:
    return Setting((base(kind),), params={"size": int(texels)})


def _view_size(pixels: float, kind: LightKind) -> Setting:
    return Setting((base(kind, int(pixels)),))


DEPTH_FORMAT = Axis(
    name="depth-format",
    about="depth formats from reversed 32-bit float to 16 bits: precision of the depth comparison",
    unit="",
    values=(_REVERSED, "d32f", "d24", "d16"),
    home="d32f",
    quick=(_REVERSED, "d32f", "d16"),
    lights=("directional", "spot", "point"),
    holds="a bias follows the step of its format",
    change=_depth_format,
    ordered=False,
)
MAP_TEXELS = Axis(
    name="map-size",
    about="texels along a side of the shadow map: aliasing of a small map, memory of a large one",
    unit="texels",
    values=(16, 32, 64, 128, 256, 512, MAP_SIZE, 2048, 4096, 8192, 16384),
    home=MAP_SIZE,
    quick=(16, 256, MAP_SIZE, 2048),
    lights=("directional", "spot", "point"),
    holds="a coarse map blurs edges, a fine one is right, and none opens a surface",
    change=_map_size,
)
VIEW_PIXELS = Axis(
    name="view-size",
    about="pixels along a side of the picture, over a shadow map of fixed size",
    unit="px",
    values=(16, 32, 64, 128, VIEW_SIZE, 512, 1024, 2048, 4096),
    home=VIEW_SIZE,
    quick=(16, VIEW_SIZE, 512),
    lights=("directional", "point"),
    holds="the same shadows, sampled finer",
    change=_view_size,
)
