"""Babylon.js in a page: https://www.babylonjs.com."""

from typing import Literal

from shadowbench.plugin.engine import Engine, EngineParams
from shadowbench.plugin.params import SubjectParams, param


class BabylonParams(EngineParams):
    """Parameters of Babylon.js."""

    size: int = param(
        1024, "texels along a side of the map, or of each cascade: `ShadowGenerator(size, …)`", ge=16, le=8192
    )
    cascades: Literal[1, 2, 3, 4] = param(1, "`CascadedShadowGenerator.numCascades`; 1 is a `ShadowGenerator`")
    filter: Literal["none", "poisson", "esm", "blur_esm", "close_esm", "blur_close_esm", "pcf", "pcss"] = param(
        "none", "`ShadowGenerator.filter`"
    )
    quality: Literal["low", "medium", "high"] = param("high", "`filteringQuality` of pcf and pcss")
    light_size: float = param(0.1, "`contactHardeningLightSizeUVRatio` of pcss", ge=0, le=1)
    depth_scale: float = param(50.0, "`depthScale` of the exponential filters", gt=0, le=10000)
    bias: float = param(0.00005, "`ShadowGenerator.bias`, added to the depth in the map, from 0 to 1", ge=-1, le=1)
    normal_bias: float = param(
        0.0, "`ShadowGenerator.normalBias`: casters shrink, in units of the scene", ge=-10, le=10
    )
    back_faces: bool = param(False, "`ShadowGenerator.forceBackFacesOnly`: back faces cast")


class Babylon(Engine):
    """Babylon.js: one shadow map or cascades, with a bias and a choice of filters, on WebGL 2.

    As shipped there is no filter and almost no bias, and maps have no size: 1024 is the documentation's. Cascades are
    for directional lights alone, choose their own boxes, and know the filters none, pcf and pcss. Point lights get
    Poisson sampling in place of pcf and pcss, and maps that are not blurred. The filters esm and blur_esm are for
    receivers that do not cast: others they light or darken altogether. `normalBias` needs meshes with normals. The
    depth of a map is the camera's unless the light has `shadowMinZ` and `shadowMaxZ`, which are set here; beyond it
    nothing is in shadow. Scenes are left-handed, as by default: in others `forceBackFacesOnly` has front faces cast.
    """

    name = "babylon"
    Params = BabylonParams
    package = "babylonjs"
    host = "web"
    scripts = ("babylonjs/babylon.js", "babylonjs-loaders/babylonjs.loaders.min.js")
    box = "given"
    phased = True
    casts = True
    presets = {"shipped": "", "documented": "filter=pcf,bias=0.01", "tuned": "bias=0.01"}
    sources = {
        "shipped": "packages/dev/core/src/Lights/Shadows/shadowGenerator.ts, 9.28.0",
        "documented": "https://doc.babylonjs.com/features/featuresDeepDive/lights/shadows#bias",
        "tuned": "found by a search under suns, map size 1024, on cube-on-plane, stairs, statue and colonnade",
    }

    @classmethod
    def view_slices(cls, params: SubjectParams) -> int:
        """Number of frustum slices with a map of their own."""
        return params.cascades if isinstance(params, BabylonParams) else 1
