"""Detection of faults of a whole mask: flipped, rotated, inverted, shifted, sRGB-encoded, or with a raised umbra."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage
from skimage.registration import phase_cross_correlation

from shadowbench.engines.external_mask import decode_srgb
from shadowbench.scores.comparison import PENUMBRA, Comparison, PreparedTruth

Image = NDArray[np.float32]
Mask = NDArray[np.bool_]
Shift = tuple[float, float]

_TURNS = {
    "flipped vertically": (slice(None, None, -1), slice(None)),
    "flipped horizontally": (slice(None), slice(None, None, -1)),
    "rotated by 180°": (slice(None, None, -1), slice(None, None, -1)),
}
_CORRELATED = 0.5  # least absolute correlation with the truth for a mask to be reported as flipped, rotated or inverted

_STEPS = 100  # steps of a pixel in which a shift is found
_FEWEST_AT_EDGES = 64  # edge pixels needed to estimate a shift
_FARTHEST = 8.0  # largest shift in pixels; a mask that seems shifted farther shows something else
_SMALLEST = 0.2  # smallest shift in pixels; a filter alone may seem to shift a mask by less
_UNDONE = 0.5  # largest share of the squared misfit left after undoing the shift; a bias leaves more
_ALIKE = 0.8  # least correlation at edges after undoing the shift

_FEWEST = 100  # soft pixels needed for a decision: a hard mask is the same in both encodings
_BLURS = (0.0, 0.7, 1.4, 2.8, 5.6)
"""Standard deviations in pixels: a mask may be smoother than the truth by an unknown amount."""
_ALL_BLURS = (*_BLURS, 1.0, 2.0, 4.0, 8.0, 11.0)
_CLEAR = 0.75
"""Largest misfit of another encoding, relative to that of the mask as it is, to be reported. Over the built-in scenes
at 256², decoding left 1.13 and more of a linear mask's, 0.41 and less of an encoded one's."""
_RAISED = (0.05, 0.95)  # visibility in the umbra that is neither a shadow of 0 nor a missing shadow
_DARKEST = 5  # percentile of the umbra that must be raised to speak of ambient light
_FITS = 0.04  # largest misfit in the umbra, of the truth at the best blur and of the mask without its ambient light
_DEEP = 12  # px from the true edge


def smooth(values: Image, weight: Image, sigma: float) -> Image:
    """Weighted Gaussian mean of (H, W) values; 0 where the weights vanish nearby. sigma in pixels."""
    total = ndimage.gaussian_filter(weight, sigma, mode="nearest")
    mean = ndimage.gaussian_filter(values * weight, sigma, mode="nearest")
    smoothed: Image = np.divide(mean, total, out=np.zeros_like(mean), where=total > 1e-3)
    return smoothed


def shift_image(image: Image, shift: Shift) -> Image:
    """Image shifted by columns to the right and rows down, in pixels, with cubic splines."""
    across, down = shift
    result: Image = ndimage.shift(image, (down, across), order=3, mode="nearest")
    return result


def misorientation(visibility: Image, prepared: PreparedTruth) -> str | None:
    """How the mask is flipped, rotated or inverted, such as "flipped vertically"; None if it is not.

    A mask is flipped or rotated if undoing that at least halves the gap of its correlation (Pearson 1895) with the
    truth to 1, and raises the correlation above ½; it is inverted if the best correlation is below −½. Constant masks
    and truths, and symmetries of the image, cannot be decided.
    """

    def correlation(mask: Image) -> float:
        return _correlation(mask[prepared.valid], prepared.visibility[prepared.valid])

    given = correlation(visibility)
    found = {turn: correlation(visibility[slices]) for turn, slices in _TURNS.items()}
    turn = max(found, key=lambda name: abs(found[name]))
    turned = abs(found[turn]) > _CORRELATED and 1 - abs(found[turn]) < (1 - abs(given)) / 2
    inverted = (found[turn] if turned else given) < -_CORRELATED
    faults = ([turn] if turned else []) + (["inverted"] if inverted else [])
    return " and ".join(faults) or None


def _correlation(mask: Image, truth: Image) -> float:
    """Pearson correlation of (N,) values; 0 if either is constant, or nearly so."""
    if not mask.size or min(np.ptp(mask), np.ptp(truth)) < 1e-3:
        return 0.0
    return float(np.corrcoef(mask, truth)[0, 1])


def estimate_shift(comparison: Comparison) -> Shift | None:
    """Shift of the whole mask against the truth, in columns to the right and rows down; None for no shift.

    The peak of the correlation of the gradients of the mask and of the truth's `area`, as complex numbers, refined by
    the upsampled DFT of Guizar-Sicairos et al. (2008). A shift is reported only if undoing it removes at least half of
    the squared misfit and makes the mask much like the truth; a bias, by contrast, displaces each shadow differently.
    """
    valid, weight = comparison.truth.valid, comparison.truth.valid.astype(np.float32)
    images = comparison.visibility, comparison.truth.area
    inside = ndimage.gaussian_filter(_inside(valid, 3).astype(np.float32), 2.0)
    gradients = [_gradient(image) * inside for image in images]
    if not all(map(np.any, gradients)):
        return None
    (down, across), *_ = phase_cross_correlation(*gradients, upsample_factor=_STEPS, normalization=None)  # type: ignore[no-untyped-call]
    if not _SMALLEST <= max(abs(across), abs(down)) <= _FARTHEST:
        return None
    shift = round(float(across), 3), round(float(down), 3)
    mask, truth = (smooth(image, weight, 1.0) for image in images)
    there = shift_image(truth, shift)
    edges = _inside(valid, max(map(abs, shift)) + 2) & (np.abs(_gradient(there)) > 0.05)
    if np.count_nonzero(edges) < _FEWEST_AT_EDGES:
        return None
    left, before = (np.square(mask - image).sum(where=edges, dtype=np.float64) for image in (there, truth))
    return shift if left <= _UNDONE * before and _correlation(mask[edges], there[edges]) >= _ALIKE else None


def _gradient(image: Image) -> NDArray[np.complex64]:
    """Derivatives along columns, and along rows as the imaginary part; 0 of a single pixel."""
    if min(image.shape) < 2:
        return np.zeros(image.shape, np.complex64)
    down, across = np.gradient(image)
    return np.asarray(across + 1j * down, np.complex64)


def _inside(valid: Mask, margin: float) -> Mask:
    """Pixels whose neighbourhood is valid too, so that the shift brings in no invalid pixels."""
    size = 2 * int(np.ceil(margin)) + 1
    inside: Mask = ndimage.minimum_filter(valid, size, mode="constant", cval=1)
    return inside


def shift_text(shift: Shift) -> str:
    """A shift in words."""
    across, down = shift
    parts = [(across, "to the right", "to the left"), (down, "down", "up")]
    return " and ".join(
        f"{abs(value):.2f} px {forth if value > 0 else back}" for value, forth, back in parts if abs(value) >= 0.05
    )


@dataclass(frozen=True)
class MaskEncoding:
    """Global faults of a mask.

    shift: columns to the right and rows down, None for no shift; srgb_encoded: None if too few pixels are soft to
    decide; umbra: visibility of the mask's umbra if that is not 0; floor: that of every pixel, None if unknown.
    """

    shift: Shift | None
    srgb_encoded: bool | None = None
    umbra: float | None = None
    floor: Image | np.float32 | None = field(default=None, compare=False)

    def lowered(self, visibility: Image) -> Image:
        """The visibility that would have been without what raises the umbra."""
        return visibility if self.floor is None else _lowered(visibility, self.floor)


def _lowered(visibility: Image, floor: Image | np.float32) -> Image:
    level = np.minimum(floor, np.float32(_RAISED[1]))
    lowered: Image = np.clip((visibility - level) / (1 - level), 0, 1)
    return lowered


def detect_encoding(comparison: Comparison) -> MaskEncoding:
    """The encoding under which a mask fits the truth best: linear, sRGB-encoded, or linear with a raised umbra.

    The misfit is the mean absolute difference of soft pixels from the truth's `area`, with the mask's shift undone and
    at the best blur. Linear unless another encoding fits clearly better.
    """
    truth, given = comparison.truth, comparison.visibility
    soft = truth.valid & (given > PENUMBRA[0]) & (given < PENUMBRA[1])
    if np.count_nonzero(soft) < _FEWEST:
        return MaskEncoding(estimate_shift(comparison))
    inside = given[truth.shadow_interior]
    umbra = float(np.median(inside)) if len(inside) >= _FEWEST else 0.0
    readings = [(given, MaskEncoding(None, False)), (decode_srgb(given).astype(np.float32), MaskEncoding(None, True))]
    if _RAISED[0] < umbra < _RAISED[1]:
        raised = MaskEncoding(None, False, round(umbra, 3), np.float32(round(umbra, 3)))
        readings.append((_lowered(given, np.float32(umbra)), raised))
    found = []
    for values, encoding in readings:
        one = Comparison(values, truth)
        shift = estimate_shift(one)
        found.append((_misfit(one, soft, shift), replace(encoding, shift=shift)))
    misfit, best = min(found, key=lambda one: one[0])
    return best if misfit < _CLEAR * found[0][0] else found[0][1]


def screenshot_encoding(comparison: Comparison) -> MaskEncoding:
    """The shift of screenshots, which were decoded from sRGB already, and their umbra with ambient light not taken off.

    Ambient light a and light d · N·L leave a / (a + d · N·L) of visibility in the umbra: the same on each plane,
    whatever its colour. The pixels' level is known if the mask without that, or without one value, fits the truth.
    """
    truth, inside = comparison.truth, comparison.truth.shadow_interior
    deep = inside & (truth.squared_edge_distance >= _DEEP**2)  # which soft edges do not reach
    inside = deep if np.count_nonzero(deep) >= _FEWEST else inside
    if np.count_nonzero(inside) < _FEWEST:
        return MaskEncoding(estimate_shift(comparison))
    found, cosine = comparison.visibility[inside], truth.cosine[inside]
    umbra = round(float(np.median(found)), 3)
    lit_or_dark = not _RAISED[0] < umbra < _RAISED[1] or np.percentile(found, _DARKEST) < umbra / 4
    if lit_or_dark or _misfit(comparison, inside, None, _ALL_BLURS) < _FITS:  # as soft edges alone make it
        return MaskEncoding(estimate_shift(comparison))
    levels = []
    for percentile in (_DARKEST, 50):  # soft edges may reach most of a narrow umbra
        ratio = np.float32(np.percentile(found * cosine / np.maximum(1 - found, 1e-3), percentile))
        levels.append(ratio / np.maximum(ratio + truth.cosine, np.float32(1e-6)))
        levels.append(np.full_like(truth.cosine, np.percentile(found, percentile)))
    lowered = [Comparison(_lowered(comparison.visibility, level), truth) for level in levels]
    best = int(np.argmin([_misfit(one, inside, None, _ALL_BLURS) for one in lowered]))
    shift = estimate_shift(lowered[best])
    if _misfit(lowered[best], inside, shift, _ALL_BLURS) < _FITS:
        return MaskEncoding(shift, umbra=umbra, floor=levels[best])
    return MaskEncoding(estimate_shift(comparison), umbra=umbra)


def _misfit(comparison: Comparison, where: Mask, shift: Shift | None, blurs: Sequence[float] = _BLURS) -> float:
    """Mean absolute difference of a mask from the truth's `area`, shifted and at the best blur."""
    area, weight = comparison.truth.area, comparison.truth.valid.astype(np.float32)
    truth = area if shift is None else shift_image(area, shift)
    blurred = (smooth(truth, weight, blur) if blur else truth for blur in blurs)
    return min(float(np.abs(comparison.visibility - image).mean(where=where, dtype=np.float64)) for image in blurred)
