"""What is wrong with a soft shadow, in words: a line for each of its metrics that stands out.

A wrong width of penumbrae is a cause of other errors, and named before them.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

Region = Literal["penumbra", "umbra", "full_light"]

LEAST = 0.01  # visibility: smaller mean errors are not named
WIDTH_FACTOR = 1.25  # between drawn and true penumbrae
SLOPE = 0.25  # distance of `hardening` from 1
NOISY = 0.5  # share of `rmse_pen`: a hard edge has noise too, and its error is another
BANDED = 0.1  # share of the penumbra
_NAMES = ("rmse_pen", "bias_pen", "bleed", "false_dark", "noise", "banding", "width", "hardening")


@dataclass(frozen=True)
class SoftFault:
    """A fault: its name, the set of a PreparedTruth's pixels that it is about, a line of text, and its mean error.

    error: of visibility over the region, by which faults are ordered; None for a cause, whose error is in the others'.
    """

    name: str
    region: Region
    line: str
    error: float | None = None


def soft_faults(metrics: Mapping[str, float | None], wider: float | None = None) -> list[SoftFault]:
    """Faults of a soft shadow that stand out, causes first, then the largest error first.

    metrics: values of `score`, of a truth with a penumbra; wider: median log₂ of the drawn over the true width of
    penumbrae, None if unknown.
    """
    value = {name: metrics.get(name) or 0.0 for name in _NAMES}
    bias, hardening = value["bias_pen"], value["hardening"]
    widens = f"drawn penumbrae widen {hardening:.2g} times as much as true ones (hardening)"
    off = f"by {abs(bias):.2g} on average, where 1 is full light (bias_pen)"
    bled = f"the umbra's mean visibility is {value['bleed']:.2g}, not 0 (bleed)"
    dark = f"full light is too dark by {value['false_dark']:.2g} on average (false_dark)"
    noisy = f"the error varies by {value['noise']:.2g} where visibility should be equal (noise)"
    banded = f"{value['banding']:.0%} of the penumbra is flat steps of grey (banding)"
    found: list[tuple[bool, SoftFault]] = [
        (value["width"] >= math.log2(WIDTH_FACTOR), _width(metrics, wider)),
        (
            metrics.get("hardening") is not None and abs(hardening - 1) >= SLOPE,
            SoftFault("contact hardening", "penumbra", widens),
        ),
        (
            abs(bias) >= LEAST,
            SoftFault(f"penumbra too {'light' if bias > 0 else 'dark'}", "penumbra", off, abs(bias)),
        ),
        (value["bleed"] >= LEAST, SoftFault("light bleeding", "umbra", bled, value["bleed"])),
        (value["false_dark"] >= LEAST, SoftFault("false shadow", "full_light", dark, value["false_dark"])),
        (
            value["noise"] >= max(LEAST, NOISY * value["rmse_pen"]),
            SoftFault("noise", "penumbra", noisy, value["noise"]),
        ),
        (value["banding"] >= BANDED, SoftFault("banding", "penumbra", banded, LEAST)),
    ]
    standing_out = [fault for stands_out, fault in found if stands_out]
    return sorted(standing_out, key=lambda fault: -math.inf if fault.error is None else -fault.error)


def _width(metrics: Mapping[str, float | None], wider: float | None) -> SoftFault:
    """A wrong width of penumbrae; `width` alone is unsigned."""
    width = metrics.get("width") or 0.0
    factor = 2**width
    if wider is None or abs(wider) < width / 2:
        line = f"half of those drawn are at least {factor:.2g} times too wide or too narrow (width)"
        return SoftFault("penumbra width", "penumbra", line)
    way = "wide" if wider > 0 else "narrow"
    return SoftFault(f"penumbra too {way}", "penumbra", f"{factor:.2g} times too {way} (median; width)")
