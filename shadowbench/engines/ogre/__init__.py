"""OGRE in Python, on OpenGL: https://www.ogre3d.org."""

from typing import Literal

from shadowbench.plugin.engine import Engine, EngineParams
from shadowbench.plugin.params import SubjectParams, param


class OgreParams(EngineParams):
    """Parameters of OGRE. Those after `technique` are of texture shadows."""

    technique: Literal["stencil", "texture"] = param("stencil", "`setShadowTechnique`: volumes or a map")
    size: int = param(512, "texels along a side of the map: `setShadowTextureSettings`", ge=1, le=8192)
    camera: Literal["Default", "Focused", "LiSPSM"] = param(
        "Default", "`setShadowCameraSetup`, without its `ShadowCameraSetup`: what the map covers"
    )
    distance: float = param(0.0, "`setShadowFarDistance`; 0: 300 near distances of the camera", ge=0, metres=True)
    filter: Literal["pcf4", "pcf16"] = param("pcf4", "`filter` of the shader generator's shadow mapping")
    bias: float = param(-1.0, "constant part of `setDepthBias` of the casters' pass; away below 0", ge=-1e4, le=1e4)
    slope_bias: float = param(-1.0, "part of `setDepthBias` by slope", ge=-100, le=100)
    cast: Literal["back", "all"] = param("back", "`setShadowCasterRenderBackFaces`")


class Ogre(Engine):
    """OGRE: stencil shadow volumes, or one shadow map from the shader generator.

    Shadows are off until a technique is chosen. Its map is a depth texture here, without which nothing shadows itself.
    A point light's map is a single one towards the camera. 16 bits index a mesh's volume, which has two vertices for
    each corner of a triangle, so that one of more than 10,922 triangles has none.
    """

    name = "ogre"
    Params = OgreParams
    package = "ogre-python"
    host = "python"
    python = "3.12"
    display = True
    encoding = "linear"
    presets = {"shipped": "", "documented": "technique=texture,camera=Focused,size=1024"}
    sources = {
        "shipped": "OgreMain/src/OgreSceneManager.cpp and Media/Main/Shadow.material, 14.6.2",
        "documented": "https://ogrecave.github.io/ogre/api/latest/_shadows.html",
    }

    @classmethod
    def map_size(cls, params: SubjectParams) -> int | None:
        return params.size if isinstance(params, OgreParams) and params.technique == "texture" else None
