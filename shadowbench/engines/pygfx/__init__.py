"""pygfx in Python, on WebGPU over Vulkan: https://pygfx.org."""

from typing import Literal

from shadowbench.plugin.engine import Engine, EngineParams
from shadowbench.plugin.params import SubjectParams, param


class PygfxParams(EngineParams):
    """Parameters of pygfx."""

    bias: float = param(0.0, "`light.shadow.bias`, taken from the depth of the receiver, from 0 to 1", ge=-1, le=1)
    cull: Literal["front", "back", "none"] = param("front", "`light.shadow.cull_mode`: the sides that do not cast")


class Pygfx(Engine):
    """pygfx: one shadow map of 1024 texels a side, with 17 taps over 5 x 5 texels; a point light's is not filtered.

    As shipped only back faces cast, whatever the material, and there is no bias. A spot light whose `shadow.camera.fov`
    is not set beforehand gets a near distance of a millionth of the far one, with which most shadows are lost.
    """

    name = "pygfx"
    Params = PygfxParams
    package = "pygfx"
    host = "python"
    python = "3.11"
    vulkan = True
    box = "given"
    phased = True
    presets = {"shipped": "", "documented": "cull=none,bias=0.001"}
    sources = {
        "shipped": "pygfx/objects/_lights.py and pygfx/renderers/wgpu/wgsl/light_shadow.wgsl, 0.17",
        "documented": "https://docs.pygfx.org/stable/_autosummary/objects/pygfx.objects.LightShadow.html"
        " for open meshes, and the bias of pygfx's example of lamps in a building",
    }

    @classmethod
    def map_size(cls, params: SubjectParams) -> int | None:
        return 1024
