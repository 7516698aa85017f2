"""VTK in Python, on OpenGL: https://vtk.org."""

from shadowbench.plugin.engine import Engine, EngineParams
from shadowbench.plugin.params import param


class VtkParams(EngineParams):
    """Parameters of VTK."""

    size: int = param(1024, "texels along a side of the map: `vtkShadowMapBakerPass.SetResolution`", ge=1, le=8192)
    exponent: float = param(11.0, "`vtkShadowMapBakerPass.SetExponentialConstant`", gt=0, le=1e6)


class Vtk(Engine):
    """VTK: an exponential shadow map, without a filter and without a bias, in two render passes.

    Point lights have no shadows, nor have spot lights whose cone is 180° or wider.
    """

    name = "vtk"
    Params = VtkParams
    package = "vtk"
    host = "python"
    python = "3.11"
    encoding = "linear"
    lights = frozenset({"directional", "spot"})
    presets = {"shipped": "", "documented": "exponent=80"}
    sources = {
        "shipped": "Rendering/OpenGL2/vtkShadowMapBakerPass.h, 9.7.2",
        "documented": "vtkShadowMapBakerPass.SetExponentialConstant: what the authors of exponential maps recommend",
    }
