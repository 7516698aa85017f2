"""Bevy in Python, on Vulkan: https://bevy.org."""

from typing import Literal

from shadowbench.plugin.engine import Engine, EngineParams
from shadowbench.plugin.params import param
from shadowbench.scenes.model import View


class BevyParams(EngineParams):
    """Parameters of Bevy."""

    size: int = param(2048, "texels along a side of each map: `DirectionalLightShadowMap.size`", ge=1, le=8192)
    distance: float = param(150.0, "last bound of `CascadeShadowConfig`; the others in proportion", gt=0, metres=True)
    filter: Literal["GAUSSIAN", "HARDWARE_2X2"] = param("GAUSSIAN", "`ShadowFilteringMethod` of the camera")
    bias: float = param(0.02, "`shadow_depth_bias`, in metres", ge=-10, le=10)
    normal_bias: float = param(1.8, "`shadow_normal_bias`, in texels along the normal", ge=-100, le=100)


class Bevy(Engine):
    """Bevy 0.18 by pybevy: four cascades, or a map of a spot light, with a depth and a normal bias.

    Materials lose their specular part here and become smoother, as its diffuse term is not Lambert's. A picture
    is taken as complete once eight frames are alike.
    """

    name = "bevy"
    Params = BevyParams
    package = "pybevy"
    host = "python"
    python = "3.12"
    vulkan = True
    lights = frozenset({"directional", "spot"})
    presets = {"shipped": ""}
    sources = {"shipped": "crates/bevy_light/src/directional_light.rs, spot_light.rs and cascade.rs, 0.18"}
    seconds = 600.0

    @classmethod
    def unsupported(cls, view: View) -> str | None:
        return "an orthographic camera" if view.camera.height else super().unsupported(view)
