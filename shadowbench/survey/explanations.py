"""Needs as text: a row with the number and a sentence for each."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from shadowbench.scenes.model import LightShape
from shadowbench.survey.depth import BIAS_STEPS, CONTACT, BiasNeed, DepthBits
from shadowbench.survey.maps import REFERENCE_SIZE
from shadowbench.survey.penumbra import HARD_RMSE, Penumbra
from shadowbench.survey.receivers import Casters, Receivers
from shadowbench.survey.relevant_casters import RelevantCasters
from shadowbench.survey.sampling import Estimate
from shadowbench.survey.survey import Needs
from shadowbench.survey.texels import CascadeSizes, Texels

GROUND_FACTOR = 1.5
"""Ratio of the map sizes needed with and without an assumed ground from which both are told."""
_LIGHTS = {
    "directional": "parallel rays: one orthographic map, cascades, shadow volumes and projected shadows all support it",
    "spot": "a cone: one perspective map covers it; cascades need parallel rays",
    "disc": "a panel: one perspective map from its centre covers 170° of what it lights",
    "rectangle": "a panel: one perspective map from its centre covers 170° of what it lights",
    "point": "it shines all round: a cube map or shadow volumes, as one 2-D map covers less than half of it",
}


@dataclass(frozen=True)
class Explanation:
    """A need for display: its name, its number with the standard error, and its meaning."""

    need: str
    number: str
    reason: str


def explanations_of(needs: Needs) -> tuple[Explanation, ...]:
    """One row for each need that applies."""
    return tuple(_rows(needs))


def _rows(needs: Needs) -> Iterator[Explanation]:
    yield Explanation("light", needs.light, _LIGHTS[needs.light])
    yield _receivers(needs.receivers)
    yield from _casters(needs.casters)
    yield from _texels(needs.texels, soft=needs.penumbra is not None and not needs.penumbra.assumed)
    if needs.without_ground:
        yield from _ground(needs.texels, needs.without_ground)
    if needs.cascades:
        yield from _cascades(needs.cascades)
    if needs.bits:
        yield _bits(needs.bits)
    if needs.bias:
        yield from _bias(needs.bias)
    if needs.penumbra:
        yield from _penumbra(needs.penumbra, needs.light)
    yield _reach(needs.reach)


def _receivers(need: Receivers) -> Explanation:
    number = f"{_share(need.planar)} on planes"
    if need.planes == 0:
        reason = "no visible receiver is on a plane: planar-projection would leave all of them lit"
        return Explanation("receivers", number, reason)
    planes = "1 plane" if need.planes == 1 else f"{need.planes} planes"
    if need.projection_suffices:
        return Explanation("receivers", number, f"all visible receivers are on {planes}: planar-projection suffices")
    lost = f"{need.lost.value:.1%} of the shadow"
    return Explanation("receivers", number, f"planar-projection, on {planes}, would leave the others lit: {lost}")


def _casters(need: Casters) -> Iterator[Explanation]:
    if need.closed == need.triangles:
        reason = "triangles, all in closed parts: shadow volumes extrude each silhouette edge once"
    else:
        inwards = need.triangles - need.closed - need.open
        parts = [f"{need.open} are in open parts"] * (need.open > 0)
        if inwards:
            parts.append(f"{inwards} {'' if parts else 'are '}in closed parts not wound outwards")
        reason = f"triangles; {', '.join(parts)}, which shadow volumes count with signed weights"
    yield Explanation("closed casters", f"{need.closed} of {need.triangles}", reason)
    reason = f"of {need.edges} are on the silhouette as seen from the light: shadow volumes have {need.walls} walls"
    yield Explanation("silhouette", f"{need.silhouette} edges", reason)


def _texels(need: Texels, soft: bool) -> Iterator[Explanation]:
    kind = f"a cube map with faces of {REFERENCE_SIZE}²" if need.faces > 1 else f"a fitted map of {REFERENCE_SIZE}²"
    reason = f"95th percentile of a texel's extent in the image, for {kind}; the largest is {need.largest.value:.3g}"
    yield Explanation("texel", f"{_value(need.p95)} px", reason)
    yield Explanation(
        "map size",
        _value(need.size, "4.0f"),
        "for texels of at most one pixel on 95% of the visible receivers",
    )
    if need.edge_size:
        yield Explanation(
            "map size, edges",
            _value(need.edge_size, "4.0f"),
            "predicted, mostly within a factor of 2, for 95% of the shadows' edge pixels to be right "
            f"(edge_p95 below 1{', of a light without its size' if soft else ''}), "
            "with 2×2 comparisons and the default bias",
        )


def _ground(need: Texels, without: Texels) -> Iterator[Explanation]:
    if need.edge_size is None:
        return
    name, ground = "without ground", "without the ground that was assumed (--no-ground)"
    if without.edge_size is None:
        yield Explanation(name, "–", f"{ground} no shadow's edge is visible: the sizes above are for shadows on it")
    elif not 1 / GROUND_FACTOR <= need.edge_size.value / without.edge_size.value <= GROUND_FACTOR:
        number = _value(without.edge_size, "4.0f")
        yield Explanation(name, number, f"map size, edges, {ground}, instead of {need.edge_size.value:.0f} with it")


def _cascades(need: CascadeSizes) -> Iterator[Explanation]:
    sizes = need.edge_size or need.size
    each = ", ".join(f"{count}: {size:.0f}" for count, size in sizes.items())
    yield Explanation(
        "cascades",
        f"{need.best} × {sizes[need.best]:.0f}",
        f"number and map size with the fewest texels in total; sizes by number: {each}",
    )
    depths = f"the farthest visible receiver is {need.depth_ratio:.3g} times as far as the nearest"
    if need.worthwhile:
        reason = f"fewer texels than one map for the same edges, with casters drawn {need.best} times; {depths}"
    else:
        reason = f"no gain: one fitted map needs fewer texels; {depths}"
    yield Explanation("cascades save", f"{need.saving:.3g} ×", reason)


def _bits(need: DepthBits) -> Explanation:
    closest = (
        f"0.1% of the shadow is within {_value(need.closest)} m of its caster in depth, over a range of "
        f"{need.range:.4g} m"
    )
    if need.bits is None:
        return Explanation("depth bits", "none", f"{closest}: less than {BIAS_STEPS:g} steps of any format")
    rest = "; 32 is a float format with reversed depth" if need.bits == 32 else ""
    return Explanation(
        "depth bits", str(need.bits), f"{closest}: more than {BIAS_STEPS:g} steps of {need.bits} bits{rest}"
    )


def _bias(need: BiasNeed) -> Iterator[Explanation]:
    yield Explanation(
        "bias",
        f"{_value(need.needed)} m",
        f"along the light, for a map of {REFERENCE_SIZE}² without filtering: leaves acne on 0.1% of the lit "
        f"receivers; the steepest slope needs {need.worst:.3g} m. Half as much at twice the size",
    )
    if need.thinnest and need.bridged:
        yield Explanation(
            "thinnest gap",
            f"{_value(need.thinnest)} m",
            f"in depth between caster and receiver, exceeded by {1 - CONTACT:.0%} of the shadow; the bias above would "
            f"light {_share(need.bridged)} of the shadow",
        )


def _penumbra(need: Penumbra, light: LightShape) -> Iterator[Explanation]:
    sun = light == "directional"
    size = f"{np.degrees(need.radius) * 2:.2g}° across" if sun else f"of {need.radius:.3g} m radius"
    if light == "rectangle":
        size = f"of {need.radius * 2:.3g} m along its longer side"
    whose = f"the {'sun' if sun else 'lamp'} is {size}" + (
        " (assumed, as the scene gives its light no size)" if need.assumed else ""
    )
    yield Explanation(
        "penumbra",
        f"{_value(need.p95)} px",
        f"95th percentile of the penumbra's largest width, the median is {need.median.value:.3g}: {whose}",
    )
    verdict = f"at most {HARD_RMSE:g}: they suffice" if need.hard_is_enough else f"above {HARD_RMSE:g}: too sharp"
    yield Explanation(
        "error of hard",
        _value(need.hard_rmse),
        "RMSE of exact hard shadows, as the centre of the light casts them, over the scored receivers; "
        f"{_share(need.share)} of the shadow is penumbra; {verdict}",
    )


def _reach(need: RelevantCasters) -> Explanation:
    unsure = "" if need.sure else ", as far as the samples show"
    return Explanation(
        "casters to leave out",
        f"{need.useless} triangles",
        f"of {need.triangles} cannot shadow any visible receiver{unsure}",
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
