"""The survey of a view: everything it needs of a shadow technique, in numbers and in words."""

from collections.abc import Iterator
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from shadowbench.errors import InputError
from shadowbench.scenes.model import LightShape, View
from shadowbench.survey.maps import (
    BIAS_STEPS,
    CONTACT,
    REFERENCE_SIZE,
    BiasNeed,
    CascadeSizes,
    DepthBits,
    Texels,
    bias_of,
    bits_of,
    cascades_of,
    fitted_map,
    texels_of,
)
from shadowbench.survey.samples import (
    HARD_RMSE,
    CasterCounts,
    Penumbra,
    Receivers,
    count_casters,
    penumbra_of,
    receivers_of,
    sample_view,
)

if TYPE_CHECKING:
    import pandas as pd

PLANAR_SHARE = 0.999  # least planar share of the visible receivers for which projection suffices


@dataclass(frozen=True)
class Needs:
    """The needs of a view; None where a need does not apply.

    light: kind of the light; receivers, casters: their statistics; texels: needed size of one map; cascades: needed
    sizes of cascades, under a directional light; bits, bias: needed depth format and bias; penumbra: widths for the
    light's size; pixels: number of sampled pixels, of view_width × view_size.
    """

    light: LightShape
    receivers: Receivers
    casters: CasterCounts
    texels: Texels
    cascades: CascadeSizes | None
    bits: DepthBits | None
    bias: BiasNeed | None
    penumbra: Penumbra | None
    pixels: int
    view_size: int
    view_width: int

    @property
    def frame(self) -> "pd.DataFrame":
        """A line per number: `need`, such as texels.size, and its `value`."""
        import pandas as pd  # 0.3 s, and the command does without

        line = pd.json_normalize(asdict(self)).iloc[0]
        numbers = pd.to_numeric(line, errors="coerce").dropna()
        return numbers.astype(float).rename_axis("need").reset_index(name="value")


def needs(view: View, penumbrae: bool = True) -> Needs:
    """The needs of a view from `view_of`. Raises InputError if there is no caster or no visible receiver.

    penumbrae: whether to trace the truths that `penumbra` is read from; without, it is None.
    """
    if not len(view.scene.geometry.caster_faces):
        raise InputError(f"{view.scene.name}: no mesh casts a shadow, so that `unshadowed` suffices")
    samples = sample_view(view)
    fitted = fitted_map(samples)
    texels = texels_of(fitted)
    return Needs(
        light=view.light.kind,
        receivers=receivers_of(samples),
        casters=count_casters(samples.view),
        texels=texels,
        cascades=cascades_of(fitted, texels),
        bits=bits_of(samples, fitted.depths),
        bias=bias_of(fitted),
        penumbra=penumbra_of(view, samples) if penumbrae else None,
        pixels=samples.view.size.pixels,
        **view.size.columns,
    )


_PANEL = "a panel: one perspective map from its centre covers 170° of what it lights"
_LIGHTS = {
    "directional": "parallel rays: one orthographic map, cascades, shadow volumes and projected shadows all support it",
    "spot": "a cone: one perspective map covers it; cascades need parallel rays",
    "disc": _PANEL,
    "rectangle": _PANEL,
    "point": "it shines all round: a cube map or shadow volumes, as one 2-D map covers less than half of it",
}


class Explanation(NamedTuple):
    """A need for display: its name, its number with the standard error, and its meaning."""

    need: str
    number: str
    reason: str


def explanations_of(needs: Needs) -> list[Explanation]:
    """One row for each need that applies."""
    return [Explanation(*row) for row in _rows(needs)]


def _rows(needs: Needs) -> Iterator[tuple[str, str, str]]:
    yield "light", needs.light, _LIGHTS[needs.light]
    yield "receivers", f"{needs.receivers.planar:.1%} on planes", _receivers(needs.receivers)
    yield from _casters(needs.casters)
    yield from _texels(needs.texels, soft=needs.penumbra is not None and not needs.penumbra.assumed)
    if needs.cascades:
        yield from _cascades(needs.cascades)
    if needs.bits:
        yield "depth bits", str(needs.bits.bits or "none"), _bits(needs.bits)
    if needs.bias:
        yield from _bias(needs.bias)
    if needs.penumbra:
        yield from _penumbra(needs.penumbra, needs.light)


def verdict_of(needs: Needs) -> str:
    """What a view needs, in a line, with the numbers of its rows."""
    edges, cascades = needs.texels.edge_size, needs.cascades
    if edges is None:
        shadow = "all that is seen is in shadow" if needs.receivers.shadowed else "no shadow is seen"
        return f"{shadow}, and no edge, so that any map size does"
    shape, sparing = "a cube map with faces" if needs.texels.faces > 1 else "one map", ""
    needed = f"{shape} of {edges:.0f}²"
    if cascades and cascades.worthwhile:
        needed = f"{cascades.best} cascades of {cascades.edge_size[cascades.best]:.0f}²"
        sparing = f" in place of one map of {edges:.0f}²"
    elif cascades:
        sparing = ", no cascades for these edges"
    parts = [needed + sparing]
    if needs.bits:
        parts.append(f"{needs.bits.bits} bits of depth" if needs.bits.bits else "more depth than any format has")
    if needs.bias:
        parts.append(f"a bias of {needs.bias.needed:.3g} m at {REFERENCE_SIZE}²")
    if needs.penumbra:
        parts.append("hard shadows suffice" if needs.penumbra.hard_is_enough else "hard shadows are too sharp")
    return ", ".join(parts)


def _receivers(need: Receivers) -> str:
    if need.planes == 0:
        return "no visible receiver is on a plane: planar-projection would leave all of them lit"
    planes = "1 plane" if need.planes == 1 else f"{need.planes} planes"
    if need.planar >= PLANAR_SHARE:
        return f"all visible receivers are on {planes}: planar-projection suffices"
    return f"planar-projection, on {planes}, would leave the others lit: {need.lost:.1%} of the shadow"


def _casters(need: CasterCounts) -> Iterator[tuple[str, str, str]]:
    reason = "triangles, all in closed parts: shadow volumes extrude each silhouette edge once"
    if need.closed < need.triangles:
        inwards = need.triangles - need.closed - need.open
        parts = [f"{need.open} are in open parts"] * (need.open > 0)
        if inwards:
            parts.append(f"{inwards} {'' if parts else 'are '}in closed parts not wound outwards")
        reason = f"triangles; {', '.join(parts)}, which shadow volumes count with signed weights"
    yield "closed casters", f"{need.closed} of {need.triangles}", reason
    if need.cut_out:
        tests = "maps, planar-projection and rays test alpha, shadow volumes do not"
        yield (
            "cut-outs",
            f"{need.cut_out} triangles",
            f"of {need.triangles}, opaque on {need.opaque:.0%} of their area: {tests}",
        )
    seen = f"of {need.edges} are on the silhouette as seen from the light"
    yield "silhouette", f"{need.silhouette} edges", f"{seen}: shadow volumes have {need.walls} walls"


def _texels(need: Texels, soft: bool) -> Iterator[tuple[str, str, str]]:
    kind = f"a cube map with faces of {REFERENCE_SIZE}²" if need.faces > 1 else f"a fitted map of {REFERENCE_SIZE}²"
    reason = f"95th percentile of a texel's extent in the image, for {kind}; the largest is {need.largest:.3g}"
    yield "texel", f"{need.p95:.3g} px", reason
    yield "map size", f"{need.size:.0f}", "for texels of at most one pixel on 95% of the visible receivers"
    if need.edge_size:
        centre = ", of a light without its size" if soft else ""
        yield (
            "map size, edges",
            f"{need.edge_size:.0f}",
            "predicted, mostly within a factor of 2, for 95% of the shadows' edge pixels to be right "
            f"(edge_p95 below 1{centre}), with 2×2 comparisons and the default bias",
        )


def _cascades(need: CascadeSizes) -> Iterator[tuple[str, str, str]]:
    sizes = need.edge_size
    each = ", ".join(f"{count}: {size:.0f}" for count, size in sizes.items())
    reason = f"number and map size with the fewest texels in total; sizes by number: {each}"
    yield "cascades", f"{need.best} × {sizes[need.best]:.0f}", reason
    reason = "no gain: one fitted map needs fewer texels for the edges in view"
    if need.worthwhile:
        reason = f"fewer texels than one map for the same edges, with casters drawn {need.best} times"
    depths = f"the farthest visible receiver is {need.depth_ratio:.3g} times as far as the nearest"
    yield "cascades save", f"{need.saving:.3g} ×", f"{reason}; {depths}"


def _bits(need: DepthBits) -> str:
    within = f"0.1% of the shadow is within {need.closest:.3g} m of its caster in depth"
    closest = f"{within}, over a range of {need.range:.4g} m"
    if need.bits is None:
        return f"{closest}: less than {BIAS_STEPS:g} steps of any format"
    rest = "; 32 is a float format with reversed depth" if need.bits == 32 else ""
    return f"{closest}: more than {BIAS_STEPS:g} steps of {need.bits} bits{rest}"


def _bias(need: BiasNeed) -> Iterator[tuple[str, str, str]]:
    yield (
        "bias",
        f"{need.needed:.3g} m",
        f"along the light, for a map of {REFERENCE_SIZE}² without filtering: leaves acne on 0.1% of the lit "
        f"receivers; the steepest slope needs {need.worst:.3g} m. Half as much at twice the size",
    )
    if need.thinnest is not None and need.bridged is not None:
        exceeded = f"exceeded by {1 - CONTACT:.0%} of the shadow"
        lit = f"the bias above would light {need.bridged:.1%} of the shadow"
        yield "thinnest gap", f"{need.thinnest:.3g} m", f"in depth between caster and receiver, {exceeded}; {lit}"


def _penumbra(need: Penumbra, light: LightShape) -> Iterator[tuple[str, str, str]]:
    lamp, size = "lamp", f"of {need.radius:.3g} m radius"
    if light == "directional":
        lamp, size = "sun", f"{np.degrees(need.radius) * 2:.2g}° across"
    elif light == "rectangle":
        size = f"of {need.radius * 2:.3g} m along its longer side"
    assumed = " (assumed, as the scene gives its light no size)" if need.assumed else ""
    widths = f"95th percentile of the penumbra's largest width, the median is {need.median:.3g}"
    yield "penumbra", f"{need.p95:.3g} px", f"{widths}: the {lamp} is {size}{assumed}"
    verdict = f"at most {HARD_RMSE:g}: they suffice" if need.hard_is_enough else f"above {HARD_RMSE:g}: too sharp"
    hard = "RMSE of exact hard shadows, as the centre of the light casts them, over the scored receivers"
    yield "error of hard", f"{need.hard_rmse:.3g}", f"{hard}; {need.share:.1%} of the shadow is penumbra; {verdict}"
