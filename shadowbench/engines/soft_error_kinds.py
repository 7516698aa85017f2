"""Kinds of error of a soft shadow: faults of the whole mask by the error that each explains, then what metrics tell."""

from collections.abc import Iterator, Mapping

import numpy as np
from scipy import optimize

from shadowbench.engines.detection import Image, MaskEncoding, shift_image, shift_text, smooth
from shadowbench.engines.error_kinds import ErrorKind
from shadowbench.engines.external_mask import decode_srgb
from shadowbench.scores.comparison import Comparison
from shadowbench.scores.soft_faults import LEAST, soft_faults

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
        squares = np.inf if fault.error is None else pixels * fault.error**2
        symptoms.append((squares, ErrorKind(fault.name, pixels, fault.line)))
    return [kind for found in (causes, symptoms) for _, kind in sorted(found, key=lambda pair: -pair[0])]


def _causes(comparison: Comparison, encoding: MaskEncoding) -> Iterator[tuple[float, ErrorKind]]:
    """Faults of the whole mask, with the share of the squared error over valid pixels that each explains."""
    truth, mask, weight = comparison.truth, comparison.visibility, comparison.truth.valid.astype(np.float32)
    pixels = int(np.count_nonzero(truth.penumbra))

    def error(mask: Image, truth: Image) -> float:
        return float(np.square(mask - truth).sum(where=comparison.truth.valid, dtype=np.float64))

    as_it_is = error(mask, truth.visibility)
    exact, fitting, rest = truth.visibility, mask, as_it_is
    if encoding.shift is not None:
        shifted = shift_image(exact, encoding.shift)
        share = 1 - error(mask, shifted) / as_it_is
        if share >= EXPLAINED:
            exact, rest = shifted, error(mask, shifted)
            line = f"by {shift_text(encoding.shift)}; explains {share:.0%} of the squared error"
            yield share, ErrorKind("shift", pixels, line)
    if encoding.srgb_encoded:
        decoded = decode_srgb(mask).astype(np.float32)
        share = 1 - error(decoded, truth.visibility) / as_it_is
        if share >= EXPLAINED:
            fitting, rest = decoded, error(decoded, exact)
            line = f"soft values are too light for a linear mask; explains {share:.0%} of the squared error"
            yield share, ErrorKind("sRGB encoding", pixels, line)

    def blurred(sigma: float) -> float:
        return error(fitting, smooth(exact, weight, sigma))

    best = optimize.minimize_scalar(blurred, bounds=BLURS, method="bounded", options={"xatol": 0.05})
    share, told = 1 - float(best.fun) / max(rest, 1e-9), "squared error" if rest == as_it_is else "rest"
    if share >= EXPLAINED and rest - float(best.fun) >= LEAST_OF_ALL * as_it_is:
        line = f"the truth, blurred by a Gaussian of σ = {best.x:.2g} px, is much like it"
        yield share * rest / as_it_is, ErrorKind("blur", pixels, f"{line}; explains {share:.0%} of the {told}")
