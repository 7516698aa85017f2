"""What somebody hands to a function of the package, as plain values; InputError for what is none."""

import operator
from collections.abc import Iterable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from shadowbench.errors import InputError


def several(given: Any, what: str, allowed: str, *kinds: type) -> list[Any]:
    """One thing of some kinds as a list, or the things that a list, an array or a series holds."""
    if isinstance(given, kinds):
        return [given]
    things = list(given) if isinstance(given, Iterable) and not isinstance(given, str | bytes) else [given]
    for thing in things:
        if not isinstance(thing, kinds):
            raise _refused(what, thing, allowed)
    return things


def whole(given: Any, what: str, least: int, most: int) -> int:
    """A whole number of any library's."""
    try:
        number = None if isinstance(given, bool) else operator.index(given)
    except TypeError:
        number = None
    if number is None or not least <= number <= most:
        raise _refused(what, given, f"whole numbers from {least} to {most}")
    return number


def number(given: Any, what: str) -> float:
    """A real number of any library's."""
    if isinstance(given, bool | str | bytes) or not hasattr(given, "__float__"):
        raise _refused(what, given, "a number")
    return float(given)


def of_kind(given: Any, what: str, allowed: str, *kinds: type) -> Any:
    """A thing of some kinds."""
    if not isinstance(given, kinds):
        raise _refused(what, given, allowed)
    return given


def lit_share(given: Any, what: str, shape: tuple[int, ...]) -> NDArray[Any]:
    """A mask of a shape: floats or booleans as they are, uint8 and uint16 over their largest."""
    mask = np.asarray(given)
    of_levels = mask.dtype in (np.uint8, np.uint16)
    if np.ma.isMaskedArray(given) or not (of_levels or mask.dtype.kind in "bf"):
        raise InputError(
            f"{what}: found {type(given).__name__} of {mask.dtype}; "
            "allowed: an array of floats, booleans, uint8 or uint16"
        )
    if mask.shape != shape:
        raise InputError(f"{what}: found shape {mask.shape}; allowed: {shape}, that of the truth")
    if not of_levels:
        return mask
    if mask.max() == 1:
        raise InputError(f"{what}: found {mask.dtype} up to 1; allowed: up to its largest, which is lit")
    return mask / np.iinfo(mask.dtype).max


def _refused(what: str, found: object, allowed: str) -> InputError:
    shown = f"{found!r:.60}".splitlines() or [""]
    return InputError(f"{what}: found {shown[0]} ({type(found).__name__}); allowed: {allowed}")
