"""Search space of `recommend`: a parameter grid for each technique, pruned by the survey of the view."""

import itertools
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from shadowbench.errors import InputError
from shadowbench.maps.filters import Filter
from shadowbench.plugin.base import Subject
from shadowbench.plugin.spec import Spec, parse_spec
from shadowbench.scenes.model import LightKind
from shadowbench.studies.crossing import Techniques
from shadowbench.survey.survey import Needs

SIZES = (256, 512, 1024, 2048, 4096)

Rule = Callable[[Spec], tuple[str, str] | None]  # what is excluded and why


@dataclass(frozen=True)
class Exclusion:
    """A part of the space that is not tried, the reason, and its number of specs."""

    what: str
    why: str
    specs: int


def grid_of(technique: type[Subject], soft: bool = False) -> dict[str, Sequence[Any]]:
    """Grid of parameter values of a technique, including map sizes. soft: for lights with a size."""
    grid = {**technique.catalogue.grid, **(technique.catalogue.soft_grid if soft else {})}
    if "size" in technique.Params.model_fields:
        grid.setdefault("size", SIZES)
    return grid


def specs_of(technique: type[Subject], largest: int, soft: bool = False) -> list[Spec]:
    """All specs of a technique's grid with maps up to `largest`."""
    grid = grid_of(technique, soft)
    if "size" in grid:
        grid["size"] = [size for size in grid["size"] if size <= largest] or [largest]
    home = Spec(technique, technique.Params())
    choices = [dict(zip(grid, values, strict=True)) for values in itertools.product(*grid.values())]
    return [home.with_(**chosen) if chosen else home for chosen in choices]


def full_space(known: Techniques, light: LightKind, largest: int, soft: bool = False) -> list[Spec]:
    """All specs that support a kind of light, with or without a size, as an exhaustive search would measure them."""
    refused = unavailable(known, light, soft)
    answering = [technique for name, technique in known.items() if name not in refused]
    return [spec for technique in answering for spec in specs_of(technique, largest, soft)]


def technique_names(texts: Sequence[str], known: Techniques) -> tuple[str, ...]:
    """Names of techniques, each once. Raises InputError for other texts, such as specs with parameters."""
    names = [parse_spec(text, known).technique.name for text in texts]
    for text in texts:
        if ":" in text:
            raise InputError(
                f"technique {text!r:.60}: found parameters, which the search chooses; allowed: a name alone"
            )
    return tuple(dict.fromkeys(names))


def chosen_techniques(known: Techniques, names: Sequence[str], light: LightKind, soft: bool = False) -> Techniques:
    """The named techniques, all of them if none is named. Raises InputError if no named one can be searched."""
    refused = unavailable(known, light, soft)
    if names and refused.keys() >= set(names):
        whys = "; ".join(f"{name} {refused[name]}" for name in names)
        able = ", ".join(name for name in known if name not in refused)
        raise InputError(f"nothing to search: {whys}; allowed: {able}")
    return {name: known[name] for name in names} or known


def unavailable(known: Techniques, light: LightKind, soft: bool = False) -> dict[str, str]:
    """Why techniques are never in the space for this light, by name."""
    whys = {}
    for name, technique in known.items():
        if technique.catalogue.never_recommended:
            whys[name] = technique.catalogue.never_recommended
        elif light not in technique.lights:
            whys[name] = f"supports {' and '.join(sorted(technique.lights))} light, not {light}"
        elif technique.catalogue.soft_only and not soft:
            whys[name] = "is for lights with a size"
    return whys


def untried_filters(space: Sequence[Spec], soft: bool) -> list[Exclusion]:
    """The filters of shadow maps that no spec of a space has, with the reason. soft: for a light with a size."""
    tried = {chosen.name for spec in space if (chosen := getattr(spec.params, "filter", None)) is not None}
    names = [name for name in Filter.table if name not in tried]
    if not tried or not names:
        return []
    why = "their penumbrae do not follow the light's size" if soft else "they are made for soft or smooth edges"
    return [Exclusion(f"the filters {', '.join(names)}", f"{why}; `shadowbench run -t` measures them", 0)]


def prune(space: Sequence[Spec], needs: Needs, least_iou: float | None) -> dict[Spec, tuple[str, str]]:
    """The specs of a space that the needs of a view leave out, with what and why as in `Exclusion`.

    least_iou: target IoU, None for another target.
    """
    rules = _depth_rule(needs), _planar_rule(needs, least_iou)
    reasons = {spec: next(filter(None, (rule(spec) for rule in rules)), None) for spec in space}
    return {spec: reason for spec, reason in reasons.items() if reason is not None}


def _depth_rule(needs: Needs) -> Rule:
    bits, unwanted = needs.bits.bits if needs.bits else None, "d16"
    if bits == 16:
        unwanted, why = "d32f", "by `needs` 16 bits separate casters from receivers, at half the bytes"
    elif bits:
        why = f"by `needs` {bits} bits are needed to separate casters from receivers"
    else:
        why = "no format is known to separate casters from receivers, so that the widest is taken"
    return lambda spec: (f"depth={unwanted}", why) if getattr(spec.params, "depth", None) == unwanted else None


def _planar_rule(needs: Needs, least_iou: float | None) -> Rule:
    """Excludes planar techniques if no plane is visible, or if an upper bound of their IoU misses the target.

    Shadows on curved receivers stay lit; the bound assumes that as much as possible of the lit surface is curved, and
    the reason says what is seen.
    """
    seen = needs.receivers
    curved, shadow = 1 - seen.planar, seen.shadowed
    most = 1 - max(curved + shadow - 1, 0.0) / shadow if shadow > 0 else 1.0
    why = None
    if seen.planes == 0:
        why = "no receiver that is seen is a plane"
    elif least_iou is not None and most < least_iou:
        why = (
            f"by `needs` it would leave {seen.lost:.1%} of the shadow lit: its IoU is at most about {1 - seen.lost:.3g}"
        )
    return lambda spec: (spec.technique.name, why) if why is not None and spec.technique.catalogue.only_planes else None


def start_size(spec: Spec, needs: Needs) -> float:
    """Predicted map size for a technique: one texel per pixel, at shadow edges if there are any."""
    texels, several, slices = needs.texels, needs.cascades, spec.technique.view_slices(spec.params)
    if slices > 1 and several is not None:
        return several.edge_size.get(slices, several.edge_size[several.best])
    return texels.edge_size or texels.size
