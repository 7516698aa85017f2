"""The table of laws: what each technique and the truth claim about each law, with reasons.

A subject is the truth, or a built-in technique with the parameters in its name, others being at their defaults. A
technique that has not been analysed is in the table without a claim.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from typing import Literal

from shadowbench.plugin.registry import own_techniques
from shadowbench.plugin.spec import Spec, parse_spec
from shadowbench.scenes.model import LightKind

from .changes import LAWS, SIZE

Kind = Literal["bits", "equal", "within", "subset", "agree", "limit", "blurred", "bleeds", "none"]
KINDS: dict[Kind, str] = {
    "bits": "identical masks, bit for bit",
    "equal": "visibility on the same side of ½ at every pixel that is decided in both views",
    "within": "over 8 phases, the ranges of the errors before and after the change overlap",
    "subset": "no pixel that is decided in both views and shows the same triangle changes from shadow to light",
    "agree": "a pixel that is fully lit or fully in shadow with the largest kernel has the same bits with smaller ones",
    "limit": "with `filter=pcss`, a pixel whose 3² texels are all lit or all in shadow has the bits of `filter=hard`",
    "blurred": "equal, and with blurred moments the same visibility, to a step of the rasteriser's grid",
    "bleeds": "with `filter=vsm` the light below the sheets grows at every pixel as the upper one rises",
    "none": "not claimed",
}
LIGHTS: tuple[LightKind, ...] = ("directional", "point", "spot")


@dataclass(frozen=True)
class Claim:
    """A claim and its reason; lights: the kinds of light that it is restricted to."""

    kind: Kind
    why: str
    lights: frozenset[LightKind] = frozenset(LIGHTS)


@dataclass(frozen=True)
class Subject:
    """The truth or a technique. text: its spec, with maps of SIZE texels; empty for the truth."""

    name: str
    text: str
    lights: frozenset[LightKind]
    exact: bool

    @property
    def technique(self) -> str:
        return self.text.split(":")[0]

    @property
    def spec(self) -> Spec | None:
        """Its spec; None for the truth."""
        return parse_spec(self.text, {one.name: one for one in own_techniques()}) if self.text else None


@cache
def subjects() -> dict[str, Subject]:
    """All subjects by name: the truth, then every built-in technique with its variants."""
    found = [Subject("truth", "", frozenset(LIGHTS), exact=True)]
    for technique in own_techniques():
        sized = f"size={SIZE}" if "size" in technique.Params.model_fields else ""
        for named in technique.catalogue.variants:
            name = ":".join(filter(None, [technique.name, named]))
            items = ",".join(filter(None, [named, sized]))
            text = ":".join(filter(None, [technique.name, items]))
            found.append(Subject(name, text, technique.lights, technique.catalogue.exact))
    return {subject.name: subject for subject in found}


FIXED, SCENE, VIEW, VISIBLE = (f"shadow-map:fit={name}" for name in ("fixed", "scene", "view", "visible"))
SLICES, TIGHT, STABLE = (f"cascades:{box}" for box in ("box=scene", "box=tight", "box=sphere,stable=true"))
CUBE = "cube-map"
RAYS = tuple(one.name for one in subjects().values() if one.exact)
ANALYSED = (*RAYS, FIXED, SCENE, VIEW, VISIBLE, SLICES, TIGHT, STABLE, CUBE)
REST = ()
"""The analysed subjects that a law's other rows do not name."""

SUN: tuple[LightKind, ...] = ("directional",)
LOCAL = "the mask depends on the local scene only"
METRES = "the map is centred on the file's origin, with sides in metres"
CASTERS = "the map covers all casters and receivers, so that another caster changes its extent"
BOUNDS = "the map is fitted to the scene's axis-aligned bounding box"
SEEN = "the map is fitted to the visible receivers, and a caster may hide some of them"
ROLL = (
    "the map's up direction is the world's y, so that a rotation rolls the map about the light and changes its extent"
)
ORIGIN = "spheres keep their size, but the texel grid's origin is the centre of the scene's bounding box"
POINTS = "the map is fitted to the light, the camera and points, which rotate with the scene"
OF_A_SUN = "the map of a sun is fitted to the scene's points, that of a spot to its bounding box"
CENTRE = "the texel grid's origin is the centre of the scene's bounding box, which another caster changes"
FACES = "the faces are aligned with the world's axes, and phases do not shift them"
ONE_FIT = "tested with one fit, as bleeding does not depend on it"
RATIO = "Chebyshev's bound grows with the distance between casters over that of the lower one to the receiver"

Row = tuple[tuple[str, ...], Kind, str] | tuple[tuple[str, ...], Kind, str, tuple[LightKind, ...]]
TABLE: dict[str, list[Row]] = {
    "translation": [(REST, "bits", LOCAL), ((FIXED,), "none", METRES)],
    "scaling by a power of two": [(REST, "bits", LOCAL), ((FIXED,), "none", METRES)],
    "rotation about y": [
        (RAYS, "equal", "only geometry is used"),
        (
            (FIXED, VISIBLE, TIGHT),
            "equal",
            POINTS,
        ),
        (
            (SCENE,),
            "equal",
            OF_A_SUN,
            SUN,
        ),
        ((STABLE,), "within", ORIGIN),
        ((VIEW, SLICES), "none", BOUNDS),
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
        ((VISIBLE,), "equal", "the map is fitted to the visible receivers, and depths behind them do not matter"),
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
        ((FIXED,), "limit", "the least disc of taps lies within 3² texels of the receiver's"),
    ],
    "translation by texels of the map": [
        ((FIXED,), "blurred", "a uniform blur commutes with a translation by whole texels", SUN),
        (REST, "none", "the map is fitted, has other axes, or is none"),
    ],
    "a caster over another": [((FIXED,), "bleeds", RATIO, SUN), (REST, "none", ONE_FIT)],
    "more PCF taps": [
        ((FIXED, CUBE), "agree", "with a constant bias, the larger kernel includes the texels of the smaller one"),
        (REST, "none", "there is no filter, or its radius pads the map"),
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
        for subject in subjects():
            yield law, subject, made.get(subject, NOT_ANALYSED)
