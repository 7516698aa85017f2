"""Needs in words: each with its number and the reason in a sentence."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from shadowbench.survey.cascades import CascadeSizes
from shadowbench.survey.casters import Casters
from shadowbench.survey.depth import STEPS, THIN, BiasNeed, DepthBits
from shadowbench.survey.maps import REFERENCE_SIZE
from shadowbench.survey.penumbra import Penumbra
from shadowbench.survey.reach import Reach
from shadowbench.survey.receivers import Receivers
from shadowbench.survey.sampling import Estimate
from shadowbench.survey.survey import Needs
from shadowbench.survey.texels import Texels

_LIGHTS = {
    "directional": "parallel rays: one orthographic map, cascades, volumes and projection all answer it",
    "spot": "a cone: one perspective map holds it; cascades need parallel rays",
    "point": "it shines all round: a cube map or volumes, as one 2-D map sees less than half of it",
}


@dataclass(frozen=True)
class Explanation:
    """A need as people read it: what it is of, its number with its error, and why it matters."""

    need: str
    number: str
    reason: str


def explanations_of(needs: Needs) -> tuple[Explanation, ...]:
    """Every need that there is, in a row each."""
    return tuple(_rows(needs))


def _rows(needs: Needs) -> Iterator[Explanation]:
    yield Explanation("light", needs.light, _LIGHTS[needs.light])
    yield _receivers(needs.receivers)
    yield from _casters(needs.casters)
    yield from _texels(needs.texels)
    if needs.cascades:
        yield from _cascades(needs.cascades)
    if needs.bits:
        yield _bits(needs.bits)
    if needs.bias:
        yield from _bias(needs.bias)
    if needs.penumbra:
        yield _penumbra(needs.penumbra, needs.light == "directional")
    yield _reach(needs.reach)


def _receivers(need: Receivers) -> Explanation:
    number = f"{_share(need.planar)} on planes"
    if need.planes == 0:
        return Explanation(
            "receivers", number, "no plane holds any of what is seen: planar-projection would leave it lit"
        )
    planes = "1 plane" if need.planes == 1 else f"{need.planes} planes"
    if need.projection_suffices:
        hold = "holds" if need.planes == 1 else "hold"
        return Explanation("receivers", number, f"{planes} {hold} all that is seen: planar-projection suffices")
    left = 1 - need.planar.value
    return Explanation("receivers", number, f"planar-projection, on {planes}, would leave {left:.2%} of them lit")


def _casters(need: Casters) -> Iterator[Explanation]:
    if need.closed == need.triangles:
        reason = "all are: volumes have an inside, and their walls are counted once"
    else:
        turned = need.triangles - need.closed - need.open
        parts = [f"{need.open} are in open parts"] * (need.open > 0)
        if turned:
            parts.append(f"{turned} {'' if parts else 'are '}in closed parts not wound outwards")
        reason = f"triangles; {', '.join(parts)}, which volumes count with both signs"
    yield Explanation("closed casters", f"{need.closed} of {need.triangles}", reason)
    reason = f"of {need.edges} are outlines for the light: volumes have so many walls"
    yield Explanation("silhouette", f"{need.silhouette} edges", reason)


def _texels(need: Texels) -> Iterator[Explanation]:
    face = "a face of a cube" if need.faces > 1 else "a fitted map"
    reach = f"is what one of {face} of {REFERENCE_SIZE} reaches over 95% of what is seen"
    reason = f"{reach}; the largest {need.largest.value:.3g}"
    yield Explanation("texel", f"{_value(need.p95)} px", reason)
    yield Explanation(
        "map size", _value(need.size, "4.0f"), "of one whose texel is a pixel at most over 95% of what is seen"
    )
    if need.edge_size:
        yield Explanation(
            "map size, edges",
            _value(need.edge_size, "4.0f"),
            "of one that is right at 95% of the shadows' edge pixels (edge_p95 below 1), compared 2×2",
        )


def _cascades(need: CascadeSizes) -> Iterator[Explanation]:
    sizes = need.edge_size or need.size
    each = ", ".join(f"{count}: {size:.0f}" for count, size in sizes.items())
    yield Explanation(
        "cascades",
        f"{need.best} × {sizes[need.best]:.0f}",
        f"have the fewest texels of all numbers of cascades; sizes by number: {each}",
    )
    depths = f"the farthest seen is {need.depth_ratio:.3g} times as far as the nearest"
    if need.worthwhile:
        reason = (
            f"{depths}: so many times fewer texels than one map's for the same edges, casters drawn {need.best} times"
        )
    else:
        reason = f"{depths}: too little for cascades to pay; one fitted map needs fewer texels"
    yield Explanation("cascades save", f"{need.saving:.3g} ×", reason)


def _bits(need: DepthBits) -> Explanation:
    closest = (
        f"0.1% of the shadow is closer to its caster than {_value(need.closest)} m, over a range of {need.range:.4g} m"
    )
    if need.bits is None:
        return Explanation("depth bits", "none", f"{closest}: too little for {STEPS:g} steps of any format")
    rest = "; 32 are floats, reversed" if need.bits == 32 else ""
    return Explanation("depth bits", str(need.bits), f"{closest}: {STEPS:g} steps of {need.bits} bits are less{rest}")


def _bias(need: BiasNeed) -> Iterator[Explanation]:
    yield Explanation(
        "bias",
        f"{_value(need.needed)} m",
        f"along the light, for a map of {REFERENCE_SIZE}: acne on 0.1% of what is lit; the worst slope needs "
        f"{need.worst:.3g}. Half of it at twice the size",
    )
    if need.thinnest and need.bridged:
        yield Explanation(
            "thinnest gap",
            f"{_value(need.thinnest)} m",
            f"{1 - THIN:.0%} of the shadow has more between caster and receiver; that bias would light "
            f"{_share(need.bridged)} of the shadow",
        )


def _penumbra(need: Penumbra, sun: bool) -> Explanation:
    size = f"{np.degrees(need.radius) * 2:.2g}° across" if sun else f"of {need.radius:.3g} m radius"
    whose = f"the {'sun' if sun else 'lamp'} is {size}" + (", as the scene gives it no size" if need.assumed else "")
    enough = "hard shadows are enough" if need.hard_is_enough else "hard shadows are too sharp"
    return Explanation(
        "penumbra",
        f"{_value(need.p95)} px",
        f"is what 95% are below, half below {need.median.value:.3g}: {whose}; {enough}",
    )


def _reach(need: Reach) -> Explanation:
    sure = "" if need.sure else ", unless it hides between the pixels that were looked at"
    return Explanation(
        "casters to leave out",
        f"{need.useless} triangles",
        f"of {need.triangles} can darken nothing that is seen{sure}",
    )


def _value(estimate: Estimate, form: str = ".3g") -> str:
    if estimate.error is None:
        return f"{estimate.value:{form}} ± ?".strip()
    error = f" ± {estimate.error:.1g}" if estimate.error else ""
    return f"{estimate.value:{form}}{error}".strip()


def _share(estimate: Estimate) -> str:
    if estimate.error is None:
        return f"{estimate.value:.1%} ± ?"
    error = f" ± {estimate.error:.2%}" if estimate.error else ""
    return f"{estimate.value:.1%}{error}"
