"""The specs that times are ratios to."""

from collections.abc import Mapping

from shadowbench.scenes.model import LightKind
from shadowbench.techniques.cube_map import CubeMap
from shadowbench.techniques.shadow_map import ShadowMap
from shadowbench.techniques.spec import Spec, parse_spec
from shadowbench.techniques.unshadowed import Unshadowed

REFERENCE = "shadow-map:size=1024"
"""The reference of a study that names none."""

USUAL = parse_spec(REFERENCE, {ShadowMap.name: ShadowMap})
_INSTEAD: Mapping[LightKind, Spec] = {"point": parse_spec("cube-map:size=1024", {CubeMap.name: CubeMap})}


def reference_for(chosen: Spec, kind: LightKind) -> Spec:
    """`chosen`, or for a kind of light that it does not answer one that does: `cube-map` for a point light."""
    other = _INSTEAD.get(kind, Spec(Unshadowed, Unshadowed.Params()))
    return chosen if kind in chosen.technique.lights else other


def name_of(reference: Spec) -> str:
    """The spec as rows name it, with its map size even where that is the default: `shadow-map:size=1024`."""
    name = reference.sizeless_text
    return name if reference.map_size is None else f"{name}{',' if ':' in name else ':'}size={reference.map_size}"
