"""The table of laws: what each technique and the truth claim about each law, with reasons.

A subject is the truth, or a built-in technique with the parameters in its name, others being at their defaults. A
technique that has not been analysed is in the table without a claim.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal

from shadowbench.plugin.registry import own_techniques
from shadowbench.plugin.spec import Spec, has_size, parse_spec
from shadowbench.scenes.model import LightKind

from .changes import LAWS

SIZE = 96  # texels along a side of the maps
Kind = Literal["bits", "equal", "within", "subset", "none"]
KINDS: dict[Kind, str] = {
    "bits": "identical masks, bit for bit",
    "equal": "visibility on the same side of ½ at every pixel that is decided in both views",
    "within": "over 8 phases, the ranges of the errors before and after the change overlap",
    "subset": "no pixel that is decided in both views and shows the same triangle changes from shadow to light",
    "none": "not claimed",
}
LIGHTS: tuple[LightKind, ...] = ("directional", "point", "spot")


@dataclass(frozen=True)
class Claim:
    """A claim and its reason; lights: the kinds of light that it is restricted to."""

    kind: Kind
    why: str
    lights: frozenset[LightKind] = frozenset(LIGHTS)


SUBJECTS: dict[str, Spec | None] = {"truth": None}
"""Specs with maps of SIZE texels, by the subject's name: every built-in technique with its variants; the truth."""
RAYS: tuple[str, ...] = ("truth",)
"""The exact subjects."""
for _technique in own_techniques():
    for _items in _technique.catalogue.variants:
        _name = f"{_technique.name}:{_items}".rstrip(":")
        _spec = parse_spec(_name, {_technique.name: _technique})
        SUBJECTS[_name] = _spec.with_(size=SIZE) if has_size(_technique) else _spec
        RAYS += (_name,) * _technique.catalogue.exact

FIXED, SCENE, VIEW, VISIBLE = (f"shadow-map:fit={name}" for name in ("fixed", "scene", "view", "visible"))
SLICES, TIGHT, STABLE = (f"cascades:{box}" for box in ("box=scene", "box=tight", "box=sphere,stable=true"))
CUBE = "cube-map"
ANALYSED = (*RAYS, FIXED, SCENE, VIEW, VISIBLE, SLICES, TIGHT, STABLE, CUBE)
REST = ()
"""The analysed subjects that a law's other rows do not name."""

SUN: tuple[LightKind, ...] = ("directional",)
LOCAL = "the mask depends on the local scene only"
METRES = "the map is centred on the file's origin, with sides in metres"
CASTERS = "the map covers all casters and receivers, so that another caster changes its extent"
BOUNDS = "the map is fitted to the scene's axis-aligned bounding box"
SEEN = "the map is fitted to the visible receivers, and a caster may hide some of them"
SIDES = "a side of the map is parallel to one of the scene's hull or bounds, which the change moves"
ROLL = (
    "the map's up direction is the world's y, so that a rotation rolls the map about the light and changes its extent"
)
ORIGIN = "spheres keep their size, but the texel grid's origin is the centre of the scene's bounding box"
POINTS = "the map is fitted to the light, the camera and points, which rotate with the scene"
OF_A_SUN = "the map of a sun is fitted to the scene's points, that of a spot to its bounding box"
CENTRE = "the texel grid's origin is the centre of the scene's bounding box, which another caster changes"
FACES = "the faces are aligned with the world's axes, and phases do not shift them"

Row = tuple[tuple[str, ...], Kind, str] | tuple[tuple[str, ...], Kind, str, tuple[LightKind, ...]]
TABLE: dict[str, list[Row]] = {
    "translation": [(REST, "bits", LOCAL), ((FIXED,), "none", METRES)],
    "scaling by a power of two": [(REST, "bits", LOCAL), ((FIXED,), "none", METRES)],
    "rotation about y": [
        (RAYS, "equal", "only geometry is used"),
        ((FIXED, TIGHT), "equal", POINTS),
        ((SCENE,), "equal", OF_A_SUN, SUN),
        ((STABLE,), "within", ORIGIN),
        ((VIEW, SLICES), "none", BOUNDS),
        ((VISIBLE,), "none", SIDES),
        ((CUBE,), "none", FACES),
    ],
    "any rotation": [
        (RAYS, "equal", "only geometry is used"),
        ((FIXED, STABLE), "within", "the texels keep their size and roll about the light"),
        (REST, "none", ROLL),
        ((CUBE,), "none", FACES),
    ],
    "subdivided triangles": [(REST, "equal", "the surfaces, and so their hulls, fits and silhouettes, are the same")],
    "reordered triangles": [(REST, "equal", "nearest depths, layer counts and hulls do not depend on the order")],
    "reversed winding": [
        (REST, "equal", "no faces are culled at default biases; shadow volumes treat inward-wound parts as open"),
    ],
    "a caster inside a caster": [
        (REST, "equal", "stored depths and hulls are those of the outer caster; counts can only grow"),
    ],
    "a caster off all light rays": [
        (RAYS, "equal", "no ray meets it, and its shadow volume lies behind all receivers"),
        ((FIXED, TIGHT), "equal", "the fit does not depend on it, and depths behind receivers do not matter"),
        ((VISIBLE,), "none", SIDES),
        ((CUBE,), "equal", "cube faces are not fitted, and larger distances do not matter"),
        ((STABLE,), "within", ORIGIN),
        ((SCENE,), "none", CASTERS),
        ((VIEW, SLICES), "none", BOUNDS),
    ],
    "an additional caster": [
        (RAYS, "subset", "a blocked ray stays blocked; counts can only grow"),
        ((FIXED, TIGHT, CUBE), "subset", "the fit is unchanged, so stored depths can only decrease"),
        ((SCENE,), "none", CASTERS),
        ((VIEW, SLICES), "none", BOUNDS),
        ((STABLE,), "none", CENTRE),
        ((VISIBLE,), "none", SEEN),
    ],
    "a vanishing light": [
        (("truth", "light-samples"), "equal", "all points of the light are nearly its centre"),
        (REST, "bits", "the light's size is not used by the default filter"),
    ],
}
NOT_ANALYSED = Claim("none", "not analysed yet")
SOFT = Claim("none", "without a size of the light `shadow-volume`, else as `light-samples`")


def claims() -> Iterator[tuple[str, str, Claim]]:
    """Generate (law, subject, claim) of the whole table, row by row."""
    for law in LAWS:
        named = {name for names, *_ in TABLE[law] for name in names}
        rest = [name for name in ANALYSED if name not in named]
        made = {}
        for names, kind, why, *lights in TABLE[law]:
            made |= dict.fromkeys(names or rest, Claim(kind, why, frozenset(*lights or [LIGHTS])))
        made["soft-volume"] = SOFT
        for subject in SUBJECTS:
            yield law, subject, made.get(subject, NOT_ANALYSED)
