"""What is wrong with a soft shadow, in words: a line for each of its metrics that stands out."""

import math
from collections.abc import Mapping
from typing import NamedTuple

LEAST = 0.01  # visibility: smaller mean errors are not named
WIDTH_FACTOR = 1.25  # between drawn and true penumbrae
SLOPE = 0.25  # distance of `hardening` from 1
NOISY = 0.5  # share of `rmse_pen`: a hard edge has noise too, and its error is another
BANDED = 0.1  # share of the penumbra
_NAMES = ("rmse_pen", "bias_pen", "bleed", "false_dark", "noise", "banding", "width")


class SoftFault(NamedTuple):
    """A fault: its name, the set of a PreparedTruth's pixels that it is about, a line of text, and its mean error.

    error: of visibility over the region, by which faults are ordered; infinite for a cause of errors, as a wrong width.
    """

    name: str
    region: str
    line: str
    error: float = math.inf


def soft_faults(metrics: Mapping[str, float | None], wider: float | None = None) -> list[SoftFault]:
    """Faults of a soft shadow that stand out, causes first, then the largest error first.

    metrics: values of `score`, of a truth with a penumbra; wider: median log₂ of the drawn over the true width of
    penumbrae, None if unknown.
    """
    rmse, bias, bleed, dark, noise, banding, width = (metrics.get(name) or 0.0 for name in _NAMES)
    hardening = metrics.get("hardening")
    found = []
    if width >= math.log2(WIDTH_FACTOR):
        found.append(_wrong_width(width, wider))
    if hardening is not None and abs(hardening - 1) >= SLOPE:
        line = f"drawn penumbrae widen {hardening:.2g} times as much as true ones (hardening)"
        found.append(SoftFault("contact hardening", "penumbra", line))
    if abs(bias) >= LEAST:
        line = f"by {abs(bias):.2g} on average, where 1 is full light (bias_pen)"
        found.append(SoftFault(f"penumbra too {'light' if bias > 0 else 'dark'}", "penumbra", line, abs(bias)))
    if bleed >= LEAST:
        line = f"the umbra's mean visibility is {bleed:.2g}, not 0 (bleed)"
        found.append(SoftFault("light bleeding", "umbra", line, bleed))
    if dark >= LEAST:
        line = f"full light is too dark by {dark:.2g} on average (false_dark)"
        found.append(SoftFault("false shadow", "full_light", line, dark))
    if noise >= max(LEAST, NOISY * rmse):
        line = f"the error varies by {noise:.2g} where visibility should be equal (noise)"
        found.append(SoftFault("noise", "penumbra", line, noise))
    if banding >= BANDED:
        line = f"{banding:.0%} of the penumbra is flat steps of grey (banding)"
        found.append(SoftFault("banding", "penumbra", line, LEAST))
    return sorted(found, key=lambda fault: -fault.error)


def _wrong_width(width: float, wider: float | None) -> SoftFault:
    """The fault of the metric `width`, which is unsigned."""
    if wider is None or abs(wider) < width / 2:
        line = f"half of those drawn are at least {2**width:.2g} times too wide or too narrow (width)"
        return SoftFault("penumbra width", "penumbra", line)
    way = "wide" if wider > 0 else "narrow"
    return SoftFault(f"penumbra too {way}", "penumbra", f"{2**width:.2g} times too {way} (median; width)")
