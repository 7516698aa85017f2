"""Kinds of error of a soft shadow: faults of the whole mask by the error that each explains, then what metrics tell."""

from collections.abc import Iterator, Mapping

import numpy as np
from scipy import optimize

from shadowbench.engines.encoding import MaskEncoding
from shadowbench.engines.error_kinds import ErrorKind
from shadowbench.engines.external_mask import decode_srgb
from shadowbench.engines.shift import shift_text
from shadowbench.engines.smoothing import Image, shift_image, smooth
from shadowbench.scores.comparison import Comparison
from shadowbench.scores.soft_faults import LEAST, soft_faults

EXPLAINED = 0.5  # least share of the squared error
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
        squares = np.inf if fault.error is None else pixels * fault.error**2
        symptoms.append((squares, ErrorKind(fault.name, pixels, fault.line)))
    return [kind for found in (causes, symptoms) for _, kind in sorted(found, key=lambda pair: -pair[0])]


def _causes(comparison: Comparison, encoding: MaskEncoding) -> Iterator[tuple[float, ErrorKind]]:
    """Faults of the whole mask, with the share of the squared error over valid pixels that each explains."""
    truth, mask, weight = comparison.truth, comparison.visibility, comparison.truth.valid.astype(np.float32)
    pixels = int(np.count_nonzero(truth.penumbra))

    def error(mask: Image, truth: Image) -> float:
        return float(np.square(mask - truth).sum(where=comparison.truth.valid, dtype=np.float64))

    def blurred(sigma: float) -> float:
        return error(mask, smooth(truth.visibility, weight, sigma))

    as_it_is = error(mask, truth.visibility)
    candidates = []
    if encoding.shift is not None:
        undone = error(mask, shift_image(truth.visibility, encoding.shift))
        candidates.append((undone, "shift", f"by {shift_text(encoding.shift)}"))
    if encoding.srgb_encoded:
        undone = error(decode_srgb(mask).astype(np.float32), truth.visibility)
        candidates.append((undone, "sRGB encoding", "soft values are too light for a linear mask"))
    best = optimize.minimize_scalar(blurred, bounds=BLURS, method="bounded", options={"xatol": 0.05})
    candidates.append(
        (float(best.fun), "blur", f"the truth, blurred by a Gaussian of σ = {best.x:.2g} px, is much like it")
    )
    for undone, name, line in candidates:
        share = 1 - undone / as_it_is
        if share >= EXPLAINED:
            yield share, ErrorKind(name, pixels, f"{line}; explains {share:.0%} of the squared error")
