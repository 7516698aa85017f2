"""three.js in a page: https://threejs.org."""

from typing import Literal

from shadowbench.plugin.engine import Engine, EngineParams
from shadowbench.plugin.params import param


class ThreeParams(EngineParams):
    """Parameters of three.js."""

    size: int = param(512, "texels along a side of the map: `shadow.mapSize`", ge=1, le=8192)
    filter: Literal["basic", "pcf", "vsm"] = param("pcf", "`renderer.shadowMap.type`")
    radius: float = param(1.0, "`shadow.radius` of the filters pcf and vsm", ge=0, le=100)
    bias: float = param(0.0, "`shadow.bias`, added to the depth of the receiver, from 0 to 1", ge=-1, le=1)
    normal_bias: float = param(0.0, "`shadow.normalBias`, along the normal, in units of the scene", ge=-10, le=10)
    cast: Literal["shipped", "front", "back", "both"] = param("shipped", "`material.shadowSide`: the sides that cast")


class Three(Engine):
    """three.js: one shadow map with a bias and a choice of filters, on WebGL 2.

    By default materials that are single-sided cast by their back faces, and those that are double-sided by both: then
    the bias, 0 as shipped, has to be negative. The filter vsm has the visible sides cast, and no point lights. Meshes
    without normals are shaded flat, and `shadow.normalBias` has no effect on them.
    """

    name = "three"
    Params = ThreeParams
    package = "three"
    host = "web"
    imports = {"three": "three/build/three.module.js", "three/addons/": "three/examples/jsm/"}
    box = "given"
    phased = True
    casts = True
    presets = {"shipped": "", "documented": "bias=-0.0001", "tuned": "bias=-0.00184,normal_bias=0.00528,cast=back"}
    sources = {
        "shipped": "src/lights/LightShadow.js and src/renderers/webgl/WebGLShadowMap.js, r187",
        "documented": "https://threejs.org/docs/#api/en/lights/shadows/LightShadow.bias, in the order of 0.0001",
        "tuned": "found by a search under suns, map size 1024, on cube-on-plane, stairs, statue and colonnade",
    }
