"""Filament in a page: https://github.com/google/filament."""

from shadowbench.plugin.engine import Engine
from shadowbench.plugin.params import SubjectParams


class Filament(Engine):
    """Filament, compiled for the web: one shadow map with PCF, fitted to camera and scene, as shipped.

    Its settings are out of reach: in the npm package `LightManager$Builder.shadowOptions` throws an error (its issue
    10043), and the filter cannot be chosen. So a map has 1024² texels, a constant bias of 0.001 and a normal bias of 1
    texel. Without post-processing pictures are linear. Spot and point lights fall off with the squared distance; a
    white surface at half the distance of the scene's far side has the exposure's brightness.
    """

    name = "filament"
    package = "filament"
    host = "web"
    scripts = ("filament/filament.js",)
    encoding = "linear"
    casts = True
    presets = {"shipped": ""}
    sources = {"shipped": "filament/include/filament/LightManager.h, ShadowOptions, 1.53.4"}

    @classmethod
    def map_size(cls, params: SubjectParams) -> int | None:
        return 1024
