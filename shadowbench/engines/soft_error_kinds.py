"""What is wrong with a soft shadow: a line for each metric of penumbrae, umbra and full light that stands out."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from shadowbench.engines.error_kinds import ErrorKind
from shadowbench.scores.comparison import Comparison

LEAST = 0.01  # visibility: smaller mean errors are not named
WIDTH_FACTOR = 1.25  # between drawn and true penumbrae
SLOPE = 0.25  # distance of `hardening` from 1
NOISY = 0.5  # share of `rmse_pen`: a hard edge has noise too, and its error is another
BANDED = 0.1  # share of the penumbra


def soft_error_kinds(comparison: Comparison, metrics: Mapping[str, float | None]) -> list[ErrorKind]:
    """Kinds of error of a soft shadow that stand out: in the penumbra, its width, umbra and full light.

    `pixels` of a kind is the size of the region that it is a mean over. metrics: values of `score` for the same
    comparison, whose truth has a penumbra.
    """
    value = {name: found or 0.0 for name, found in metrics.items()}
    truth = comparison.truth
    found: list[tuple[bool, str, NDArray[np.bool_], str]] = [
        (
            abs(value["bias_pen"]) >= LEAST,
            f"penumbra too {'light' if value['bias_pen'] > 0 else 'dark'}",
            truth.penumbra,
            f"by {abs(value['bias_pen']):.2g} on average, where 1 is full light (bias_pen)",
        ),
        (value["width"] >= np.log2(WIDTH_FACTOR), *_width(comparison, metrics["width"])),
        (
            metrics["hardening"] is not None and abs(value["hardening"] - 1) >= SLOPE,
            "contact hardening",
            truth.penumbra,
            f"drawn penumbrae widen {value['hardening']:.2g} times as much as true ones (hardening)",
        ),
        (
            value["bleed"] >= LEAST,
            "light bleeding",
            truth.umbra,
            f"the umbra's mean visibility is {value['bleed']:.2g}, not 0 (bleed)",
        ),
        (
            value["false_dark"] >= LEAST,
            "false shadow",
            truth.full_light,
            f"full light is too dark by {value['false_dark']:.2g} on average (false_dark)",
        ),
        (
            value["noise"] >= max(LEAST, NOISY * value["rmse_pen"]),
            "noise",
            truth.penumbra,
            f"the error varies by {value['noise']:.2g} where visibility should be equal (noise)",
        ),
        (
            value["banding"] >= BANDED,
            "banding",
            truth.penumbra,
            f"{value['banding']:.0%} of the penumbra is flat steps of grey (banding)",
        ),
    ]
    return [
        ErrorKind(name, int(np.count_nonzero(where)), line) for stands_out, name, where, line in found if stands_out
    ]


def _width(comparison: Comparison, width: float | None) -> tuple[str, NDArray[np.bool_], str]:
    """Name, place and line of penumbrae of a wrong width; `width` alone, None where there are too few, is unsigned."""
    across, drawn, penumbra = comparison.truth.crossings, comparison.penumbra_widths, comparison.truth.penumbra
    if width is None or across is None or drawn is None:
        return "", penumbra, ""
    wider, factor = float(np.median(np.log2(drawn / across.width))), 2**width
    if abs(wider) < width / 2:
        return "penumbra width", penumbra, f"drawn penumbrae are {factor:.2g} times too wide or too narrow (width)"
    way = "wide" if wider > 0 else "narrow"
    return f"penumbra too {way}", penumbra, f"{factor:.2g} times too {way} (median; width)"
