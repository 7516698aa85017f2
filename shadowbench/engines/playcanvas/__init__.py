"""PlayCanvas in a page: https://playcanvas.com."""

from typing import Literal

from shadowbench.plugin.engine import Engine, EngineParams
from shadowbench.plugin.params import SubjectParams, param


class PlayCanvasParams(EngineParams):
    """Parameters of PlayCanvas."""

    size: int = param(
        1024, "texels along a side of a directional light's map: `light.shadowResolution`", ge=16, le=8192
    )
    atlas: int = param(2048, "that of the map of others: `scene.lighting.shadowAtlasResolution`", ge=32, le=8192)
    cascades: Literal[1, 2, 3, 4] = param(1, "`light.numCascades`; they share the map of a directional light")
    distance: float = param(40.0, "`light.shadowDistance`: from the camera, where shadows end", gt=0, metres=True)
    filter: Literal["pcf1", "pcf3", "pcf5", "vsm16", "vsm32", "pcss"] = param("pcf3", "`light.shadowType`")
    bias: float = param(0.05, "`light.shadowBias`", ge=0, le=1)
    normal_bias: float = param(0.0, "`light.normalOffsetBias`", ge=0, le=1)


class PlayCanvas(Engine):
    """PlayCanvas: one shadow map or cascades, fitted to the camera's frustum, on WebGL 2.

    A directional light has no shadows beyond `shadowDistance`, 40 m as shipped. Lighting is clustered, as shipped: spot
    and point lights share an atlas, in which a point light has six small maps, and their filters are pcf1, pcf3 and
    pcf5. Their maps begin and end where the light's range does, which here is twice the distance of the scene's far
    side; with it the light fades. `shadowBias` is a slope-scaled offset of the map, and has little effect on pcss. The
    manual names no values: those of the preset `documented` are an example's.
    """

    name = "playcanvas"
    Params = PlayCanvasParams
    package = "playcanvas"
    host = "web"
    imports = {"playcanvas": "playcanvas/build/playcanvas.mjs"}
    casts = True
    presets = {
        "shipped": "",
        "documented": "size=2048,distance=50,bias=0.2,normal_bias=0.05",
        "tuned": "bias=0.2,normal_bias=0.05",
    }
    sources = {
        "shipped": "src/framework/components/light/component.js and src/scene/light.js, 2.23.3",
        "documented": "https://github.com/playcanvas/engine: examples/src/examples/graphics/lights-baked.example.mjs",
        "tuned": "found by a search under lamps, map size 1024, on lamp-by-wall and lamp-over-table",
    }

    @classmethod
    def view_slices(cls, params: SubjectParams) -> int:
        """Number of frustum slices with a map of their own."""
        return params.cascades if isinstance(params, PlayCanvasParams) else 1
