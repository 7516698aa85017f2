"""What `recommend` chooses from: techniques with a few values of what costs or is accurate, and what needs leave."""

import itertools
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from shadowbench.needs.survey import Needs
from shadowbench.scenes.model import LightKind
from shadowbench.techniques.base import Technique
from shadowbench.techniques.spec import Spec

SIZES = (256, 512, 1024, 2048, 4096)
_FILTERS = ("hard", "hardware", "pcf(taps=3)", "pcf(taps=5)")
_DEPTHS = ("d16", "d32f")  # of which no other has fewer bytes, or more digits

# What a technique is tried with. Other parameters stay at their defaults: biases cost alike, and those are tuned.
GRID: Mapping[str, Mapping[str, Sequence[Any]]] = {
    "shadow-map": {"fit": ("visible", "view", "scene"), "filter": _FILTERS, "depth": _DEPTHS, "size": SIZES},
    "cascades": {"count": (2, 3, 5), "filter": _FILTERS, "depth": _DEPTHS, "size": SIZES[:-1]},
    "cube-map": {"filter": _FILTERS, "depth": _DEPTHS, "size": SIZES},
    "shadow-volume": {"compare": ("position", "depth")},
    "planar-projection": {},
}
NO_CHOICE = {
    "ray-traced": "is traced on the CPU, with what the truth is made of: the end of the scale, not for a frame",
    "unshadowed": "draws no shadow: enough only where there is none",
}


@dataclass(frozen=True)
class Excluded:
    """Part of the space that is not tried, why, and how many specs that leaves out."""

    what: str
    why: str
    specs: int


def specs_of(technique: type[Technique], largest: int) -> list[Spec]:
    """Every spec of a technique's grid, with maps up to the device's largest; of one that is not ours, its sizes."""
    sizes = {"size": SIZES} if "size" in technique.Params.model_fields else {}
    grid = dict(GRID.get(technique.name, sizes))
    if "size" in grid:
        grid["size"] = [size for size in grid["size"] if size <= largest] or [largest]
    home = Spec(technique, technique.Params())
    choices = [dict(zip(grid, values, strict=True)) for values in itertools.product(*grid.values())]
    return [home.with_(**chosen) if chosen else home for chosen in choices]


def whole_space(known: Mapping[str, type[Technique]], light: LightKind, largest: int) -> list[Spec]:
    """All specs that answer a kind of light: what an exhaustive search would measure."""
    answering = [one for one in known.values() if light in one.lights and one.name not in NO_CHOICE]
    return [spec for technique in answering for spec in specs_of(technique, largest)]


def no_choices(known: Mapping[str, type[Technique]], light: LightKind) -> list[Excluded]:
    """The techniques that are in no space for this light, with the reason."""
    return [
        Excluded(name, NO_CHOICE.get(name) or f"answers {' and '.join(sorted(one.lights))} light, not {light}", 0)
        for name, one in known.items()
        if name in NO_CHOICE or light not in one.lights
    ]


def needed_space(
    space: Sequence[Spec], needs: Needs, least_iou: float | None, by_work: bool
) -> tuple[list[Spec], list[Excluded]]:
    """What the needs leave of a space, and what they leave out.

    least_iou: the target, None where it is of another kind; by_work: whether work is what ranks.
    """
    rules = [_depth_rule(needs), _planar_rule(needs, least_iou)]
    if by_work:
        rules.append(_compare_rule)
    left, excluded = list(space), []
    for rule in rules:
        found = {spec: reason for spec in left if (reason := rule(spec)) is not None}
        excluded += [Excluded(*reason, count) for reason, count in Counter(found.values()).items()]
        left = [spec for spec in left if spec not in found]
    return left, excluded


_Rule = Callable[[Spec], tuple[str, str] | None]  # what is excluded and why


def _depth_rule(needs: Needs) -> _Rule:
    bits = needs.bits.bits if needs.bits else None
    enough = bits == 16
    why = "16 bits separate casters from receivers, at half the bytes" if enough else _too_few(bits)
    unwanted = "d32f" if enough else "d16"
    return lambda spec: (f"depth={unwanted}", why) if getattr(spec.params, "depth", None) == unwanted else None


def _too_few(bits: int | None) -> str:
    found = f"{bits} bits are needed" if bits else "no format is known to suffice, so that the widest is taken"
    return f"the closest caster and receiver: {found}"


def _planar_rule(needs: Needs, least_iou: float | None) -> _Rule:
    """Of the shadow, what planes cannot hold stays lit: at least what is left when all that is lit is curved."""
    seen = needs.receivers
    curved, shadow = 1 - seen.planar.value, seen.shadowed.value
    most = 1 - max(curved + shadow - 1, 0.0) / shadow if shadow > 0 else 1.0
    why = None
    if seen.planes == 0:
        why = "no receiver that is seen is a plane"
    elif least_iou is not None and most < least_iou:
        why = f"only {seen.planar.value:.1%} of what is seen lies on planes: its IoU is below {most:.3g}"
    name = "planar-projection"
    return lambda spec: (name, why) if why is not None and spec.technique.name == name else None


def _compare_rule(spec: Spec) -> tuple[str, str] | None:
    if spec.technique.name == "shadow-volume" and getattr(spec.params, "compare", None) == "depth":
        return spec.text, "draws the surfaces' depth besides: faster on a GPU, but more work"
    return None


def start_size(spec: Spec, needs: Needs) -> float:
    """The map size that needs predict for a technique: right at the shadows' edges, or a texel a pixel without any."""
    texels, several = needs.texels, needs.cascades
    if spec.technique.name == "cascades" and several is not None:
        sizes, count = several.edge_size or several.size, int(getattr(spec.params, "count", several.best))
        return sizes.get(count, sizes[several.best])
    return (texels.edge_size or texels.size).value
