"""Panda3D in Python, on OpenGL: https://www.panda3d.org."""

from typing import Literal

from shadowbench.plugin.engine import Engine, EngineParams
from shadowbench.plugin.params import param


class Panda3DParams(EngineParams):
    """Parameters of Panda3D."""

    size: int = param(512, "texels along a side of the map: `setShadowCaster`", ge=1, le=8192)
    cast: Literal["shipped", "front", "back", "both"] = param(
        "shipped", "the sides that cast: `CullFaceAttrib` of the light's `setInitialState`"
    )
    offset: int = param(0, "`DepthOffsetAttrib` of the light's `setInitialState`: away below 0", ge=-1000, le=1000)


class Panda3D(Engine):
    """Panda3D: one shadow map with four taps, from its shader generator.

    As shipped, materials that are single-sided cast by their back faces, and those that are double-sided by both. There
    is no bias but the depth offset of a render state.
    """

    name = "panda3d"
    Params = Panda3DParams
    package = "panda3d"
    host = "python"
    python = "3.11"
    display = True
    encoding = "linear"
    box = "given"
    phased = True
    presets = {"shipped": "", "tuned": "cast=both,offset=-2"}
    sources = {
        "shipped": "panda/src/pgraphnodes/lightLensNode.cxx, 1.10.16",
        "tuned": "found by a search under suns, map size 1024, on cube-on-plane, stairs, statue and colonnade",
    }
