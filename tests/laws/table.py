"""The table of laws: what each technique and the truth claim about each law, with reasons.

A subject is the truth, or one of our own techniques with what its name says, its fit above all; other parameters are
the defaults. A technique that nobody has argued for stands in the table by itself, without a claim.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from typing import Literal

from shadowbench.scenes.model import LightKind
from shadowbench.techniques.registry import own_techniques
from shadowbench.techniques.spec import Spec, parse_spec

from .changes import LAWS

Kind = Literal["bits", "equal", "within", "subset", "agree", "none"]
KINDS: dict[Kind, str] = {
    "bits": "the same bits, at every pixel",
    "equal": "the same side of ½ at every pixel that is decided in both",
    "within": "the errors over 8 phases are neither all above nor all below those over 8 phases before",
    "subset": "no pixel that is decided in both, and shows the same triangle, turns from shadow to light",
    "agree": "a pixel whose widest kernel is all lit or all dark is the same with fewer taps, bit for bit",
    "none": "not claimed",
}
LIGHTS: tuple[LightKind, ...] = ("directional", "point", "spot")


@dataclass(frozen=True)
class Claim:
    """What is claimed, why; `lights` restricts it to some of the kinds that the subject answers."""

    kind: Kind
    why: str
    lights: frozenset[LightKind] = frozenset(LIGHTS)


@dataclass(frozen=True)
class Subject:
    """The truth, whose text is empty, or a technique as a spec says it; `SIZE` texels where it has a map."""

    name: str
    text: str
    lights: frozenset[LightKind]
    exact: bool

    @property
    def technique(self) -> str:
        return self.text.split(":")[0]

    @property
    def spec(self) -> Spec | None:
        """None for the truth."""
        return parse_spec(self.text, {one.name: one for one in own_techniques()}) if self.text else None


SIZE = 96  # texels along a side of the maps


@cache
def subjects() -> dict[str, Subject]:
    """The columns by name: the truth, then every technique of this package with its variants."""
    found = [Subject("truth", "", frozenset(LIGHTS), exact=True)]
    for technique in own_techniques():
        sized = f"size={SIZE}" if "size" in technique.Params.model_fields else ""
        for named in technique.variants:
            name = ":".join(filter(None, [technique.name, named]))
            items = ",".join(filter(None, [named, sized]))
            text = ":".join(filter(None, [technique.name, items]))
            found.append(Subject(name, text, technique.lights, technique.exact))
    return {subject.name: subject for subject in found}


FIXED, SCENE, VIEW, VISIBLE = (f"shadow-map:fit={name}" for name in ("fixed", "scene", "view", "visible"))
SLICES, TIGHT, STABLE = (f"cascades:{box}" for box in ("box=scene", "box=tight", "box=sphere,stable=true"))
RAYS = [one.name for one in subjects().values() if one.exact]
MAPS = [FIXED, SCENE, VIEW, VISIBLE, SLICES, TIGHT, STABLE, "cube-map"]
ARGUED = [*RAYS, *MAPS]

UNARGUED = Claim("none", "nobody has argued for it yet")
_CLAIMS: dict[tuple[str, str], Claim] = {}


def claim(law: str, names: list[str], kind: Kind, why: str, lights: tuple[LightKind, ...] = LIGHTS) -> None:
    for name in names:
        _CLAIMS[law, name] = Claim(kind, why, frozenset(lights))


def without(*left_out: str) -> list[str]:
    return [name for name in ARGUED if name not in left_out]


METRES = "the map lies about the file's origin, its sides in metres"
CASTERS = "the window holds every caster and receiver, and another one moves it"
BOUNDS = "the window is fitted to the scene's box along the world's axes, and follows it"
SEEN = "the window is fitted to what is seen, and a caster may hide some of it"
ROLL = "up of a map is the world's y: a turn rolls the map over its scene, and the window has another size"
ORIGIN = "spheres keep their size; the grid's origin is the middle of the scene's box"

for _law in ("moved", "scaled by a power of two"):
    claim(_law, without(FIXED), "bits", "an answer is a function of the local scene alone")
    claim(_law, [FIXED], "none", METRES)

claim("scaled and moved", without(FIXED), "equal", "every length in use follows the scene: texels, biases, offsets")
claim("scaled and moved", [FIXED], "none", METRES)

claim("a quarter turn about y", ARGUED, "equal", "bases, boxes along the axes and faces of a cube turn along")

claim("a turn about y", RAYS, "equal", "nothing but geometry is used")
claim(
    "a turn about y", [FIXED, VISIBLE, TIGHT], "equal", "the window hangs on light, camera and points that turn along"
)
claim(
    "a turn about y",
    [SCENE],
    "equal",
    "a sun's window holds the scene's points; a spot's is fitted to its box",
    ("directional",),
)
claim("a turn about y", [STABLE], "within", ORIGIN)
claim("a turn about y", [VIEW, SLICES], "none", BOUNDS)
claim("a turn about y", ["cube-map"], "none", "the faces keep to the world's axes, and no phase says what that costs")

claim("any turn", RAYS, "equal", "nothing but geometry is used")
claim("any turn", [FIXED, STABLE], "within", "the texels keep their size, and roll about the light")
claim("any turn", [SCENE, VIEW, VISIBLE, SLICES, TIGHT], "none", ROLL)
claim("any turn", ["cube-map"], "none", "the faces keep to the world's axes, and no phase says what that costs")

claim("triangles split", ARGUED, "equal", "the same surfaces; hulls, windows and silhouettes are theirs")
claim("another order", ARGUED, "equal", "nearest depths, sums of layers and hulls have no order")
claim("another winding", ARGUED, "equal", "casters are not culled at default biases; inward bodies count as open ones")
claim("casters twice", ARGUED, "equal", "nearest depths are the same; twice a count is 0 where the count is")
claim("a caster in a caster", ARGUED, "equal", "stored depths and hulls are the outer one's; a count only grows")

_off = "a caster off all ways to the light"
claim(_off, RAYS, "equal", "no ray meets it; a volume behind all receivers is never entered")
claim(_off, [FIXED, TIGHT], "equal", "the window is not the scene's; depths behind receivers are never compared")
claim(_off, [VISIBLE], "equal", "the window is what is seen; depths behind receivers are never compared")
claim(_off, ["cube-map"], "equal", "faces have no window; farther distances are never compared")
claim(_off, [STABLE], "within", ORIGIN)
claim(_off, [SCENE], "none", CASTERS)
claim(_off, [VIEW, SLICES], "none", BOUNDS)

claim("another caster", RAYS, "subset", "a ray that is stopped stays so; a count only grows")
claim("another caster", [FIXED, TIGHT, "cube-map"], "subset", "in a window that stays, stored depths only come nearer")
claim("another caster", [SCENE], "none", CASTERS)
claim("another caster", [VIEW, SLICES], "none", BOUNDS)
claim(
    "another caster", [STABLE], "none", "the grid's origin is the middle of the scene's box, which another caster moves"
)
claim("another caster", [VISIBLE], "none", SEEN)

claim(
    "more PCF taps", [FIXED, "cube-map"], "agree", "with a constant bias, a wider box holds the narrower ones' texels"
)
claim(
    "more PCF taps", [SCENE, VIEW, VISIBLE, SLICES, TIGHT, STABLE], "none", "the window is padded by the filter's reach"
)
claim("more PCF taps", RAYS, "none", "takes no taps")


def claims() -> Iterator[tuple[str, str, Claim]]:
    """(law, subject, claim) for all of the table, by rows."""
    for law in LAWS:
        for subject in subjects():
            yield law, subject, _CLAIMS.get((law, subject), UNARGUED)


def misnamed() -> set[tuple[str, str]]:
    """What is claimed of laws or subjects that there are none of."""
    return {key for key in _CLAIMS if key[0] not in LAWS or key[1] not in subjects()}
