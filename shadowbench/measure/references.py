"""Reference specs: frame times are reported as ratios to the time of a reference."""

from collections.abc import Mapping

from shadowbench.scenes.model import LightKind
from shadowbench.techniques.cube_map import CubeMap
from shadowbench.techniques.shadow_map import ShadowMap
from shadowbench.techniques.spec import Spec
from shadowbench.techniques.unshadowed import Unshadowed

DEFAULT_REFERENCE = Spec(ShadowMap, ShadowMap.Params(size=1024))
"""Reference of a study that names none."""

_SUBSTITUTES: Mapping[LightKind, Spec] = {"point": Spec(CubeMap, CubeMap.Params(size=1024))}


def reference_for(chosen: Spec, kind: LightKind) -> Spec:
    """`chosen` if it supports the kind of light, else `cube-map` for a point light and `unshadowed` for others."""
    other = _SUBSTITUTES.get(kind, Spec(Unshadowed, Unshadowed.Params()))
    return chosen if kind in chosen.technique.lights else other


def reference_name(reference: Spec) -> str:
    """Name of a reference in rows, with its map size even if that is the default: `shadow-map:size=1024`."""
    name = reference.sizeless_text
    return name if reference.map_size is None else f"{name}{',' if ':' in name else ':'}size={reference.map_size}"
