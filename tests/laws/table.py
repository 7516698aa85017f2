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
    "blurred": "equal, and with blurred moments the same visibility to rounding",
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
RAYS = [one.name for one in subjects().values() if one.exact]
MAPS = [FIXED, SCENE, VIEW, VISIBLE, SLICES, TIGHT, STABLE, "cube-map"]
ANALYSED = [*RAYS, *MAPS]

NOT_ANALYSED = Claim("none", "not analysed yet")
_CLAIMS: dict[tuple[str, str], Claim] = {}


def claim(law: str, names: list[str], kind: Kind, why: str, lights: tuple[LightKind, ...] = LIGHTS) -> None:
    for name in names:
        _CLAIMS[law, name] = Claim(kind, why, frozenset(lights))


def without(*left_out: str) -> list[str]:
    return [name for name in ANALYSED if name not in left_out]


METRES = "the map is centred on the file's origin, with sides in metres"
CASTERS = "the map covers all casters and receivers, so that another caster changes its extent"
BOUNDS = "the map is fitted to the scene's axis-aligned bounding box"
SEEN = "the map is fitted to the visible receivers, and a caster may hide some of them"
ROLL = (
    "the map's up direction is the world's y, so that a rotation rolls the map about the light and changes its extent"
)
ORIGIN = "spheres keep their size, but the texel grid's origin is the centre of the scene's bounding box"

for _law in ("translation", "scaling by a power of two"):
    claim(_law, without(FIXED), "bits", "the mask depends on the local scene only")
    claim(_law, [FIXED], "none", METRES)

claim("scaling and translation", without(FIXED), "equal", "all lengths (texels, biases, offsets) scale with the scene")
claim("scaling and translation", [FIXED], "none", METRES)

claim(
    "rotation about y by quarter turns",
    ANALYSED,
    "equal",
    "light-space bases, axis-aligned boxes and cube faces rotate with the scene",
)

claim("rotation about y", RAYS, "equal", "only geometry is used")
claim(
    "rotation about y",
    [FIXED, VISIBLE, TIGHT],
    "equal",
    "the map is fitted to the light, the camera and points, which rotate with the scene",
)
claim(
    "rotation about y",
    [SCENE],
    "equal",
    "the map of a sun is fitted to the scene's points, that of a spot to its bounding box",
    ("directional",),
)
claim("rotation about y", [STABLE], "within", ORIGIN)
claim("rotation about y", [VIEW, SLICES], "none", BOUNDS)
claim(
    "rotation about y",
    ["cube-map"],
    "none",
    "the faces are aligned with the world's axes, and phases do not shift them",
)

claim("any rotation", RAYS, "equal", "only geometry is used")
claim("any rotation", [FIXED, STABLE], "within", "the texels keep their size and roll about the light")
claim("any rotation", [SCENE, VIEW, VISIBLE, SLICES, TIGHT], "none", ROLL)
claim("any rotation", ["cube-map"], "none", "the faces are aligned with the world's axes, and phases do not shift them")

claim("subdivided triangles", ANALYSED, "equal", "the surfaces, and so their hulls, fits and silhouettes, are the same")
claim("reordered triangles", ANALYSED, "equal", "nearest depths, layer counts and hulls do not depend on the order")
claim(
    "reversed winding",
    ANALYSED,
    "equal",
    "no faces are culled at default biases; shadow volumes treat inward-wound parts as open",
)
claim(
    "duplicated meshes",
    ANALYSED,
    "equal",
    "nearest depths are the same, and doubled counts are zero at the same pixels",
)
claim(
    "a caster inside a caster",
    ANALYSED,
    "equal",
    "stored depths and hulls are those of the outer caster; counts can only grow",
)

_off = "a caster off all light rays"
claim(_off, RAYS, "equal", "no ray meets it, and its shadow volume lies behind all receivers")
claim(_off, [FIXED, TIGHT], "equal", "the fit does not depend on it, and depths behind receivers do not matter")
claim(_off, [VISIBLE], "equal", "the map is fitted to the visible receivers, and depths behind them do not matter")
claim(_off, ["cube-map"], "equal", "cube faces are not fitted, and larger distances do not matter")
claim(_off, [STABLE], "within", ORIGIN)
claim(_off, [SCENE], "none", CASTERS)
claim(_off, [VIEW, SLICES], "none", BOUNDS)

claim("an additional caster", RAYS, "subset", "a blocked ray stays blocked; counts can only grow")
claim(
    "an additional caster",
    [FIXED, TIGHT, "cube-map"],
    "subset",
    "the fit is unchanged, so stored depths can only decrease",
)
claim("an additional caster", [SCENE], "none", CASTERS)
claim("an additional caster", [VIEW, SLICES], "none", BOUNDS)
claim(
    "an additional caster",
    [STABLE],
    "none",
    "the texel grid's origin is the centre of the scene's bounding box, which another caster changes",
)
claim("an additional caster", [VISIBLE], "none", SEEN)

_sized = ["truth", "light-samples"]
claim("a vanishing light", _sized, "equal", "all points of the light are nearly its centre")
claim("a vanishing light", without(*_sized, FIXED), "bits", "the light's size is not used by the default filter")
claim("a vanishing light", [FIXED], "limit", "the least disc of taps lies within 3² texels of the receiver's")

_texels = "translation by texels of the map"
claim(_texels, [FIXED], "blurred", "a uniform blur commutes with a translation by whole texels", ("directional",))
claim(_texels, without(FIXED), "none", "the map is fitted, has other axes, or is none")

_over = "a caster over another"
_ratio = "Chebyshev's bound grows with the distance between casters over that of the lower one to the receiver"
claim(_over, [FIXED], "bleeds", _ratio, ("directional",))
claim(_over, without(FIXED), "none", "tested with one fit, as bleeding does not depend on it")

claim(
    "more PCF taps",
    [FIXED, "cube-map"],
    "agree",
    "with a constant bias, the larger kernel includes the texels of the smaller one",
)
claim("more PCF taps", [SCENE, VIEW, VISIBLE, SLICES, TIGHT, STABLE], "none", "the map is padded by the filter radius")
claim("more PCF taps", RAYS, "none", "there is no filter")


for _law in LAWS:
    claim(_law, ["soft-volume"], "none", "without a size of the light `shadow-volume`, else as `light-samples`")


def claims() -> Iterator[tuple[str, str, Claim]]:
    """Generate (law, subject, claim) of the whole table, row by row."""
    for law in LAWS:
        for subject in subjects():
            yield law, subject, _CLAIMS.get((law, subject), NOT_ANALYSED)


def misnamed() -> set[tuple[str, str]]:
    """Keys of claims whose law or subject does not exist."""
    return {key for key in _CLAIMS if key[0] not in LAWS or key[1] not in subjects()}
