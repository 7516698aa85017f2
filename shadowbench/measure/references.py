"""The specs that times are ratios to."""

from collections.abc import Mapping

from shadowbench.scenes.model import LightKind
from shadowbench.techniques.cube_map import CubeMap
from shadowbench.techniques.shadow_map import ShadowMap
from shadowbench.techniques.spec import Spec
from shadowbench.techniques.unshadowed import Unshadowed

USUAL = Spec(ShadowMap, ShadowMap.Params(size=1024))
"""The reference of a study that names none."""

_INSTEAD: Mapping[LightKind, Spec] = {"point": Spec(CubeMap, CubeMap.Params(size=1024))}


def reference_for(chosen: Spec, kind: LightKind) -> Spec:
    """`chosen`, or for a kind of light that it does not answer one that does: `cube-map` for a point light."""
    other = _INSTEAD.get(kind, Spec(Unshadowed, Unshadowed.Params()))
    return chosen if kind in chosen.technique.lights else other


def name_of(reference: Spec) -> str:
    """The spec as rows name it, with its map size even where that is the default: `shadow-map:size=1024`."""
    name = reference.sizeless_text
    return name if reference.map_size is None else f"{name}{',' if ':' in name else ':'}size={reference.map_size}"
