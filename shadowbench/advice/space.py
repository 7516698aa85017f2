"""What `recommend` chooses from: techniques with a few values of what costs or is accurate, and what needs leave."""

import itertools
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from shadowbench.scenes.model import LightKind
from shadowbench.survey.survey import Needs
from shadowbench.techniques.base import Technique
from shadowbench.techniques.spec import Spec

SIZES = (256, 512, 1024, 2048, 4096)


@dataclass(frozen=True)
class Excluded:
    """Part of the space that is not tried, why, and how many specs that leaves out."""

    what: str
    why: str
    specs: int


def grid_of(technique: type[Technique]) -> dict[str, Sequence[Any]]:
    """What is tried of a technique, its map sizes among it."""
    sizes = {"size": SIZES} if "size" in technique.Params.model_fields else {}
    return {**technique.grid, **(sizes if "size" not in technique.grid else {})}


def specs_of(technique: type[Technique], largest: int) -> list[Spec]:
    """Every spec of a technique's grid, with maps up to the device's largest."""
    grid = grid_of(technique)
    if "size" in grid:
        grid["size"] = [size for size in grid["size"] if size <= largest] or [largest]
    home = Spec(technique, technique.Params())
    choices = [dict(zip(grid, values, strict=True)) for values in itertools.product(*grid.values())]
    return [home.with_(**chosen) if chosen else home for chosen in choices]


def whole_space(known: Mapping[str, type[Technique]], light: LightKind, largest: int) -> list[Spec]:
    """All specs that answer a kind of light: what an exhaustive search would measure."""
    answering = [one for one in known.values() if light in one.lights and not one.never_recommended]
    return [spec for technique in answering for spec in specs_of(technique, largest)]


def no_choices(known: Mapping[str, type[Technique]], light: LightKind) -> list[Excluded]:
    """The techniques that are in no space for this light, with the reason."""
    return [
        Excluded(name, one.never_recommended or f"answers {' and '.join(sorted(one.lights))} light, not {light}", 0)
        for name, one in known.items()
        if one.never_recommended or light not in one.lights
    ]


def needed_space(
    space: Sequence[Spec], needs: Needs, least_iou: float | None, by_work: bool
) -> tuple[list[Spec], list[Excluded]]:
    """What the needs leave of a space, and what they leave out.

    least_iou: the target, None where it is of another kind; by_work: whether work is what ranks.
    """
    rules = [_depth_rule(needs), _planar_rule(needs, least_iou)]
    if by_work:
        rules.append(_work_rule)
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
    return lambda spec: (spec.technique.name, why) if why is not None and spec.technique.only_planes else None


def _work_rule(spec: Spec) -> tuple[str, str] | None:
    reason = spec.technique.extra_work(spec.params)
    return None if reason is None else (spec.text, reason)


def start_size(spec: Spec, needs: Needs) -> float:
    """The map size that needs predict for a technique: right at the shadows' edges, or a texel a pixel without any."""
    texels, several, slices = needs.texels, needs.cascades, spec.technique.view_slices(spec.params)
    if slices > 1 and several is not None:
        sizes = several.edge_size or several.size
        return sizes.get(slices, sizes[several.best])
    return (texels.edge_size or texels.size).value
