"""EEVEE of Blender, as a module of Python: https://www.blender.org."""

from shadowbench.plugin.engine import Engine, EngineParams
from shadowbench.plugin.params import param


class BlenderParams(EngineParams):
    """Parameters of EEVEE."""

    samples: int = param(
        16,
        "`eevee.taa_render_samples`: of a pixel, as many as `taa_samples` of viewports; final renders: 64",
        ge=1,
        le=4096,
    )
    rays: int = param(1, "`eevee.shadow_ray_count`: rays of a sample through the map", ge=1, le=4)
    steps: int = param(6, "`eevee.shadow_step_count`: samples of the map along a ray", ge=1, le=16)
    radius: float = param(1.0, "`light.shadow_filter_radius`: blur at the edges, in texels", ge=0, le=5)
    resolution: float = param(0.001, "`light.shadow_maximum_resolution`: least width of a texel in metres", ge=0, le=10)
    scale: float = param(1.0, "`eevee.shadow_resolution_scale`", gt=0, le=4)


class Blender(Engine):
    """Blender's EEVEE: virtual shadow maps, with rays traced through them, averaged over samples.

    A light is a point here and a pixel's samples are in its centre, so what is soft at an edge is the filter's.
    """

    name = "blender"
    Params = BlenderParams
    package = "bpy"
    host = "python"
    python = "3.11"
    encoding = "linear"
    presets = {"shipped": ""}
    sources = {"shipped": "source/blender/makesdna/DNA_light_types.h and DNA_scene_types.h (`taa_samples`), 5.0.1"}
    seconds = 600.0
