"""Wrong pixels of a mask classified as acne, leak, peter-panning or displaced edge."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage, optimize

from shadowbench.engines.detection import Image, MaskEncoding, shift_image, shift_text, smooth
from shadowbench.engines.external_mask import decode_srgb
from shadowbench.scores.comparison import INTERIOR_PX, Comparison
from shadowbench.scores.metrics import LEAST, leading_error, soft_faults

Mask = NDArray[np.bool_]

_GREY = (0.1, 0.9)
_FAINT = 0.96  # visibility below which a lit pixel is darker than rounding makes it
_FEWEST = 10  # faintly dark pixels to speak of
_SCATTERED = 0.9  # share of the light up to which they are acne


@dataclass(frozen=True)
class ErrorKind:
    """One kind of error: its name, number of pixels, and a line of text."""

    name: str
    pixels: int
    line: str


def error_kinds(comparison: Comparison, metrics: dict[str, float | None]) -> list[ErrorKind]:
    """Kinds of error among the wrong pixels of a mask, that of `leading_error` first, then most pixels first.

    Connected wrong pixels (visibility on the other side of ½ than the truth) form a patch. A patch of false light is
    peter-panning if more than half of it lies close to the occluder; any patch is a displaced edge if more than half
    of it lies within 4 px of the true edge; the rest is acne where dark and a leak where lit.
    Empty if no pixel is wrong. metrics: values of `score` for the same comparison.
    """
    prepared = comparison.truth
    false_shadow, false_light = wrong_pixels(comparison)
    at_edge = prepared.squared_edge_distance < INTERIOR_PX**2  # closer than the interiors of the metrics acne and leak
    dark_edge, acne = _split(false_shadow, at_edge)
    contact, far_from_caster = _split(false_light, prepared.contact)
    lit_edge, leak = _split(far_from_caster, at_edge)
    displaced = dark_edge | lit_edge
    leaks = ", leaks included" if (leak & prepared.contact).any() else ""  # most of their patches lies farther away
    reach = np.sqrt(np.percentile(prepared.squared_edge_distance[displaced], 95)) if displaced.any() else 0.0
    elsewhere = comparison.lit & prepared.shadow_interior & ~leak  # what the metric leak counts besides leaks
    others = ", peter-panning included" if (elsewhere & prepared.contact).any() else ""
    share = {name: _share(metrics[name]) for name in ("contact", "acne", "leak")}
    lines = {
        "displaced edge": (displaced, f"these wrong pixels lie within {reach:.3g} px of the true edge (95% of them)"),
        "peter-panning": (contact, f"{share['contact']} of the shadow next to its caster is lit{leaks} (contact)"),
        "acne": (acne, f"{share['acne']} of the lit interior is dark (acne)"),
        "leak": (leak, f"{share['leak']} of the shadow's interior is lit{others} (leak)"),
    }
    found = [ErrorKind(name, int(np.count_nonzero(pixels)), line) for name, (pixels, line) in lines.items()]
    leading = {"contact": "peter-panning"}.get(name := leading_error(metrics) or "", name)
    return sorted((kind for kind in found if kind.pixels), key=lambda kind: (kind.name != leading, -kind.pixels))


def faint_kinds(comparison: Comparison) -> list[ErrorKind]:
    """Pixels of full light that are darker than they should be, but lighter than ½, away from edges; none for few."""
    truth, mask = comparison.truth, comparison.visibility
    beyond = INTERIOR_PX + 2 * max(edge_widths(comparison))
    inside = truth.lit_interior & (truth.squared_edge_distance > beyond**2)
    faint = inside & comparison.lit & (mask < _FAINT)
    pixels, all_pixels = int(np.count_nonzero(faint)), int(np.count_nonzero(inside))
    if pixels < max(_FEWEST, 1e-3 * all_pixels):
        return []
    share, darker = pixels / all_pixels, 1 - float(mask[faint].mean(dtype=np.float64))
    line = f"{share:.1%} of the light away from edges is darker than it should be, by {darker:.2g}"
    return [ErrorKind("faint acne" if share < _SCATTERED else "dimmed light", pixels, line)]


def edge_widths(comparison: Comparison) -> tuple[float, float]:
    """How far in pixels a mask is grey around the true edge, into light and into shadow; 0 without an edge.

    As far as most pixels at that distance are grey. A side that is grey beyond, far from the edge, is not so because
    of it, as with acne or ambient light, and counts as much as the other.
    """
    truth, mask = comparison.truth, comparison.visibility
    grey, reaches = (mask > _GREY[0]) & (mask < _GREY[1]), []
    for side in (truth.lit, truth.shadow):
        distance = np.sqrt(truth.squared_edge_distance[side]).astype(np.intp)
        if not truth.edge.any() or not len(distance):
            return 0.0, 0.0
        pixels, found = np.bincount(distance), np.bincount(distance, grey[side])
        many = found > pixels / 2
        first = 1 if side is truth.lit else 0  # edge pixels are in shadow
        end = first + int(np.argmin(np.append(many[first:], False)))
        beyond = pixels[end:].sum()
        reaches.append(float(end - first) if beyond and found[end:].sum() < beyond / 4 else None)
    other = next((reach for reach in reaches if reach is not None), 0.0)
    lit, shadow = (other if reach is None else reach for reach in reaches)
    return lit, shadow


def wrong_pixels(comparison: Comparison) -> tuple[Mask, Mask]:
    """(N, N) masks of false shadow and of false light: valid pixels on the other side of ½ than the truth."""
    prepared = comparison.truth
    return comparison.shadow & prepared.lit, comparison.lit & prepared.shadow


def _split(wrong: Mask, place: Mask) -> tuple[Mask, Mask]:
    """The patches of which more than half lies in a region, and the others."""
    patches, count = ndimage.label(wrong)
    sizes = np.bincount(patches.ravel(), minlength=count + 1)
    there = np.bincount(patches[place], minlength=count + 1) > sizes / 2
    inside: Mask = wrong & there[patches]
    return inside, wrong & ~inside


def _share(value: float | None) -> str:
    if value is None:
        return "none"
    return f"{value:.2%}" if value >= 1e-4 else f"{100 * value:.2g}%"


EXPLAINED = 0.5  # least share of the squared error
LEAST_OF_ALL = 0.1  # of the squared error, for a blur besides another cause
BLURS = (0.3, 16.0)  # px, standard deviations


def soft_error_kinds(
    comparison: Comparison, metrics: Mapping[str, float | None], encoding: MaskEncoding
) -> list[ErrorKind]:
    """Kinds of error of a soft shadow that stand out, causes before their symptoms.

    First what is wrong with the whole mask, a shift, an sRGB encoding or a blur, by the share of the squared error that
    it explains; then the width of penumbrae; then errors in penumbra, umbra and full light, by their squared sums.
    `pixels` of a kind is the size of the region that it is about. metrics: values of `score` for the same comparison,
    whose truth has a penumbra; encoding: faults found by `detect_encoding`.
    """
    truth = comparison.truth
    causes = list(_causes(comparison, encoding)) if (metrics["rmse_pen"] or 0.0) >= LEAST else []
    symptoms = []
    for fault in soft_faults(metrics, comparison.width_bias):
        pixels = int(np.count_nonzero(getattr(truth, fault.region)))
        symptoms.append((pixels * fault.error**2, ErrorKind(fault.name, pixels, fault.line)))
    return [kind for found in (causes, symptoms) for _, kind in sorted(found, key=lambda pair: -pair[0])]


def _causes(comparison: Comparison, encoding: MaskEncoding) -> Iterator[tuple[float, ErrorKind]]:
    """Faults of the whole mask, with the share of the squared error over valid pixels that each explains."""
    truth, mask, weight = comparison.truth, comparison.visibility, comparison.truth.valid.astype(np.float32)
    pixels = int(np.count_nonzero(truth.penumbra))

    def error(mask: Image, truth: Image) -> float:
        return float(np.square(mask - truth).sum(where=comparison.truth.valid, dtype=np.float64))

    as_it_is = error(mask, truth.visibility)
    exact = truth.visibility
    if encoding.shift is not None:
        shifted = shift_image(exact, encoding.shift)
        share = 1 - error(mask, shifted) / as_it_is
        if share >= EXPLAINED:
            exact = shifted
            line = f"by {shift_text(encoding.shift)}; explains {share:.0%} of the squared error"
            yield share, ErrorKind("shift", pixels, line)
    if encoding.srgb_encoded:
        decoded = decode_srgb(mask).astype(np.float32)
        share = 1 - error(decoded, truth.visibility) / as_it_is
        if share >= EXPLAINED:
            mask = decoded
            line = f"soft values are too light for a linear mask; explains {share:.0%} of the squared error"
            yield share, ErrorKind("sRGB encoding", pixels, line)
    rest = error(mask, exact)
    best = optimize.minimize_scalar(
        lambda sigma: error(mask, smooth(exact, weight, sigma)), bounds=BLURS, method="bounded", options={"xatol": 0.05}
    )
    share, told = 1 - float(best.fun) / max(rest, 1e-9), "squared error" if rest == as_it_is else "rest"
    if share >= EXPLAINED and rest - float(best.fun) >= LEAST_OF_ALL * as_it_is:
        line = f"the truth, blurred by a Gaussian of σ = {best.x:.2g} px, is much like it"
        yield share * rest / as_it_is, ErrorKind("blur", pixels, f"{line}; explains {share:.0%} of the {told}")
