"""three.js in a page: https://threejs.org."""

from typing import Literal

from shadowbench.plugin.engine import Engine, EngineParams
from shadowbench.plugin.params import param


class ThreeParams(EngineParams):
    """Parameters of three.js."""

    size: int = param(512, "texels along a side of the map: `shadow.mapSize`", ge=1, le=8192)
    filter: Literal["basic", "pcf", "vsm"] = param("pcf", "`renderer.shadowMap.type`")
    bias: float = param(0.0, "`shadow.bias`, added to the depth in the map", ge=-1, le=1)
    normal_bias: float = param(0.0, "`shadow.normalBias`, along the normal", ge=-10, le=10)
    cast: Literal["shipped", "front", "back", "both"] = param("shipped", "`material.shadowSide`: the sides that cast")


class Three(Engine):
    """three.js: one shadow map with a bias and a choice of filters, on WebGL 2.

    Materials that are single-sided cast by their back faces, and those that are double-sided by both.
    """

    name = "three"
    Params = ThreeParams
    host = "web"
    imports = {"three": "three/build/three.module.js", "three/addons/": "three/examples/jsm/"}
    box = "given"
    phased = True
    casts = True
    presets = {"shipped": "", "documented": "bias=-0.0005"}
    sources = {
        "shipped": "src/lights/LightShadow.js and src/renderers/webgl/WebGLShadowMap.js, r187",
        "documented": "https://threejs.org/docs/#api/en/lights/shadows/LightShadow.bias",
    }
